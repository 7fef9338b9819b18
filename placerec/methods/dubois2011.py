"""`dubois2011`: Dubois, Guillaume, Frenoux & Tarroux 2011 (ESANN), Bayesian filtering with a Markov chain per place.

P(w | w', c) = (n_c(w', w) + delta) / (n_c(w') + delta V), through the filter of eq. 1: order 2, with Lidstone's rule
and nothing behind it, so that after an unseen w' all words are equally probable (readings 1.2a). The paper describes it
as "n = 2 with LL and without interpolation". Its order is always 2, whatever that of the models.

Open in the paper: the first word of a sequence. Here its probability is P(w | c) = (n_c(w) + delta) / (n_c + delta V).
"""

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.methods.tables import PairEmissions, count_pairs
from placerec.methods.training_set import TrainingSet, log_word_p


def fit(training: TrainingSet) -> PairEmissions:
    """Emissions of a word after the one before it."""
    delta, V = training.delta, len(training.vocabulary)
    pairs = count_pairs(training)
    alone = log_word_p(training).T / np.log(10)

    def score(ids: Ints, before: Ints) -> Floats:
        counts, totals = pairs.look_up(before[0], ids)
        scores: Floats = np.log10((counts + delta) / (totals + delta * V))
        return np.where((before[0] >= 0)[:, None], scores, alone[ids])

    return PairEmissions(training.vocabulary, 1, score)
