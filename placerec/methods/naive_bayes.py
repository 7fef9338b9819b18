"""What every other system has to beat: `majority`, and `naive-bayes`, every frame for itself.

`majority` believes the prior P(c) for ever, whatever is seen. `naive-bayes`: P(c | w) in proportion to P(c) P(w | c).

P(w | c) = (n_c(w) + delta) / (n_c + delta V); the prior P(c) is that of the training words.
"""

import numpy as np

from placerec.hohmm.filter import normalised
from placerec.methods.training_set import MakeStepper, TrainingSet, log_word_p


def fit_majority(training: TrainingSet) -> MakeStepper:
    """Believe the prior for ever."""
    return lambda: lambda word, elapsed: training.prior


def fit(training: TrainingSet) -> MakeStepper:
    """Belief from the last selected word alone."""
    scores = log_word_p(training) + np.log(training.prior)[:, None]
    beliefs = [normalised(column) for column in scores.T]
    return lambda: lambda word, elapsed: beliefs[word]
