"""`guillaume2011`: Guillaume, Dubois, Frenoux & Tarroux 2011, a temporal bag of words.

After N words the place is the one with the greatest log P(c) + sum of log P(w_i | c) over them (readings 3.3): neither
their order nor the order of places counts. P(w | c) = (n_c(w) + delta) / (n_c + delta V).

Which words are in the bag is open. Here, all since the last change of place, which CUSUM detects without any training
and without a time scale: for each place the evidence that it explains the words since some moment better than the best
place of the bag is summed up, from 0 on whenever it falls below; when one sum reaches THRESHOLD, the bag is that
place's words since then. THRESHOLD is what a change costs in the filter of the paper, ln(0.99 / 0.01), for two places.
Variants, by the arguments of `fit`: the last `window` words; words that count less by `forgetting` at each new one; no
detection of changes; or detection by the last `recent` words, if their best place beats the bag's by THRESHOLD on them.

Simplified: the detectors are textbook ones in place of the thesis's, which are not described in the paper.
"""

from collections import deque
from collections.abc import Callable
from math import log

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError
from placerec.hohmm.filter import normalised
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, log_word_p

THRESHOLD = log(0.99 / 0.01)
DETECTORS = ("cusum", "recent", "none")
# From the log P(w | c) (C,) of one more word and the scores of the bag with it to those of the bag from now on.
Detect = Callable[[Floats, Floats], Floats]


def fit(
    training: TrainingSet,
    *,
    window: int | None = None,
    forgetting: float = 1.0,
    detector: str = "cusum",
    threshold: float = THRESHOLD,
    recent: int = 10,
) -> MakeStepper:
    """Belief from the words since the last change.

    `window`: None for all words; `forgetting`: from 0 (the last word alone) to 1 (none); `detector`: one of DETECTORS.
    `threshold` in nats. Raises ModelError for values out of range, and for a window with a detector or with forgetting.
    """
    if detector not in DETECTORS or not 0 <= forgetting <= 1 or recent < 1 or (window is not None and window < 1):
        raise ModelError(f"a bag of window {window}, forgetting {forgetting}, detector {detector!r} makes no sense")
    if window is not None and (detector != "none" or forgetting != 1):
        raise ModelError("a bag of a fixed window forgets by itself: it takes neither forgetting nor a detector")
    log_p, prior = log_word_p(training).T.copy(), np.log(training.prior)
    start: dict[str, Callable[[], Detect]] = {
        "cusum": lambda: _cusum(len(prior), threshold),
        "recent": lambda: _recent(recent, threshold),
        "none": lambda: lambda word, scores: scores,
    }

    def make_stepper() -> StepFunction:
        scores = np.zeros(len(prior))
        bag: deque[Floats] = deque(maxlen=window or 1)
        detect = start[detector]()

        def step(word: int, elapsed: int) -> Floats:
            nonlocal scores
            if window is not None:
                bag.append(log_p[word])
                return normalised(prior + sum(bag))
            scores = detect(log_p[word], forgetting * scores + log_p[word])
            return normalised(prior + scores)

        return step

    return make_stepper


def _cusum(places: int, threshold: float) -> Detect:
    """Page's cumulative sums, of each place against the best of the bag."""
    # Row c: the scores of the words since the evidence for c last fell to 0.
    since = np.zeros((places, places))
    evidence = np.zeros(places)

    def detect(word: Floats, scores: Floats) -> Floats:
        best = int(scores.argmax())
        since[:] += word
        evidence[:] += word - word[best]
        fallen = evidence <= 0
        evidence[fallen], since[fallen] = 0, 0
        rival = int(evidence.argmax())
        if evidence[rival] < threshold:
            return scores
        bag: Floats = since[rival].copy()
        evidence[:], since[:] = 0, 0
        return bag

    return detect


def _recent(words: int, threshold: float) -> Detect:
    """The last words' best place against the bag's."""
    last: deque[Floats] = deque(maxlen=words)

    def detect(word: Floats, scores: Floats) -> Floats:
        last.append(word)
        bag: Floats = np.sum(last, axis=0)
        return bag if bag.max() - bag[scores.argmax()] >= threshold else scores

    return detect
