"""`guillaume2011`: Guillaume, Dubois, Frenoux & Tarroux 2011, a temporal bag of words.

After N words the place is the one with the greatest log P(c) + sum of log P(w_i | c) over them (readings 3.3): neither
their order nor the order of places counts. P(w | c) = (n_c(w) + delta) / (n_c + delta V).

Which words are in the bag is open. Here, all since the last change of place, which CUSUM detects without any training
and without a time scale: for each place the evidence that it explains the words since some moment better than the best
place of the bag is summed up, from 0 on whenever it falls below; when one sum reaches THRESHOLD, the bag is that
place's words since then. THRESHOLD is what a change costs in the filter of the paper, ln(0.99 / 0.01), for two places.

Simplified: the detector is a textbook one (Page's cumulative sums) in place of the thesis's, which is not described in
the paper.
"""

from math import log

import numpy as np

from placerec.arrays import Floats
from placerec.hohmm.filter import normalised
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, log_word_p

THRESHOLD = log(0.99 / 0.01)


def fit(training: TrainingSet, *, threshold: float = THRESHOLD) -> MakeStepper:
    """Belief from the words since the last change, which takes evidence of `threshold` nats."""
    log_p, prior = log_word_p(training).T.copy(), np.log(training.prior)
    places = len(prior)

    def make_stepper() -> StepFunction:
        bag, evidence = np.zeros(places), np.zeros(places)
        # Row c: the scores of the words since the evidence for c last fell to 0.
        since = np.zeros((places, places))

        def step(word: int, elapsed: int) -> Floats:
            bag[:] += log_p[word]
            since[:] += log_p[word]
            evidence[:] += log_p[word] - log_p[word, bag.argmax()]
            fallen = evidence <= 0
            evidence[fallen], since[fallen] = 0, 0
            rival = evidence.argmax()
            if evidence[rival] >= threshold:
                bag[:] = since[rival]
                evidence[:], since[:] = 0, 0
            return normalised(prior + bag)

        return step

    return make_stepper
