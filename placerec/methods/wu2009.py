"""`wu2009`: Wu, Christensen & Rehg 2009, a hidden Markov model over discretised images.

P(x_t = c | z_1..t) is in proportion to P(z_t | c) times the prediction, with P(w | c) = (n_c(w) + delta) / (n_c + delta
V). This is order 1 with Lidstone's rule, to the byte: the probabilities are rounded as an ARPA file rounds them.

Simplified: one word an image. The original describes sub-windows with CENTRIST and multiplies their probabilities
(from memory).
"""

from placerec.hohmm import Emissions
from placerec.lm import count_ngrams
from placerec.lm.arpa import as_printed
from placerec.lm.backoff import unite_models
from placerec.methods.training_set import TrainingSet
from placerec.model import ModelOptions, estimate_place


def fit(training: TrainingSet) -> Emissions:
    """Emissions of one word at a time."""
    options = ModelOptions(1, "lidstone-backoff", training.delta)
    texts = [[[training.vocabulary[i] for i in visit] for visit in visits] for visits in training.sentences]
    counted = [count_ngrams(text, 1, vocabulary=training.vocabulary) for text in texts]
    return unite_models([as_printed(estimate_place(counts, options)) for counts in counted])
