"""`pronobis2010`: Pronobis, Mozos, Caputo & Jensfelt 2010, accumulation over time with confidence.

Outputs are averaged in bins, and bins added up, so that a robot that stands still does not hear one witness many times;
the decision waits until it is confident (readings 3.5). Here bins are BIN frames, S(c) is the sum over the last BINS of
them of the mean of log P(w | c) in each, P(w | c) = (n_c(w) + delta) / (n_c + delta V), and the belief is in proportion
to exp S(c). Where the best place is not TWICE as probable as the second, the belief before it is kept.

Simplified: words in place of SVM margins, and neither laser nor their integration (SVM-DAS); bins of time, since tokens
have no pose, in place of bins of position and heading; bins are dropped by age, and not at doors, which nobody detects
here (both from memory). BIN and BINS are a second and six of them at the five frames a second of COLD.
"""

from collections import deque
from math import log

import numpy as np

from placerec.arrays import Floats
from placerec.hohmm.filter import normalised
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, lead, log_word_p

BIN, BINS = 5, 6
TWICE = log(2)


def fit(training: TrainingSet, *, frames: int = BIN, bins: int = BINS, confidence: float = TWICE) -> MakeStepper:
    """Belief from the last `bins` bins of so many `frames`, kept while the lead is below `confidence` nats."""
    log_p = log_word_p(training).T.copy()
    places = len(training.places)

    def make_stepper() -> StepFunction:
        belief = np.full(places, 1 / places)
        # Number of the bin, sum of its log P, number of its words.
        kept: deque[tuple[int, Floats, int]] = deque()
        frame = 0

        def step(word: int, elapsed: int) -> Floats:
            nonlocal belief, frame
            frame += elapsed
            now = frame // frames
            if kept and kept[-1][0] == now:
                _, total, words = kept.pop()
                kept.append((now, total + log_p[word], words + 1))
            else:
                kept.append((now, log_p[word], 1))
            while kept[0][0] <= now - bins:
                kept.popleft()
            scores: Floats = sum((total / words for _, total, words in kept), np.zeros(places))
            if lead(scores) >= confidence:
                belief = normalised(scores)
            return belief

        return step

    return make_stepper
