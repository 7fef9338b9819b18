"""`naive-bayes`: every frame for itself, P(c | w) in proportion to P(c) P(w | c). What time and order add to is this.

P(w | c) = (n_c(w) + delta) / (n_c + delta V); the prior P(c) is that of the training words.
"""

import numpy as np

from placerec.methods.training_set import MakeStepper, TrainingSet, log_word_p, normalised


def fit(training: TrainingSet) -> MakeStepper:
    """Belief from the last selected word alone."""
    scores = log_word_p(training) + np.log(training.prior)[:, None]
    beliefs = [normalised(column) for column in scores.T]
    return lambda: lambda word, elapsed: beliefs[word]
