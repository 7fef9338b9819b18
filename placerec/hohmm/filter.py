"""The Bayesian filter of eq. 1: a belief over places, one word at a time.

With selected words z_1, z_2, ... and places c: bel(x_t = c) is in proportion to P(z_t | z_{t-n:t-1}, c) times the
predicted belief; before the first word it is uniform (readings A2 to A4). Everything is kept as natural logarithms.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from placerec.hohmm.transitions import Transition, logsumexp

LN10 = np.log(10.0)
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Filtered:
    """Beliefs float64 (T, C) after each of T words, and how many words no place could explain."""

    belief: Floats = field(repr=False)
    unexplained: int


def uniform(places: int) -> Floats:
    """The log belief (C,) before anything is seen."""
    return np.full(places, -np.log(places))


def update(predicted: Floats, log10_p: Floats) -> tuple[Floats, bool]:
    """The log belief (C,) after a word with log10_p (C,) under each place, and whether any place explains it.

    If all places give it probability zero, the prediction is kept.
    """
    weighed = predicted + log10_p * LN10
    total = logsumexp(weighed)
    if not np.isfinite(total):
        return predicted, False
    return weighed - total, True


def filter_stream(log10_p: Floats, transition: Transition) -> Filtered:
    """Filter one sequence: `log10_p` float64 (T, C) of each word under each place, after the words before it."""
    steps, places = log10_p.shape
    belief = np.empty((steps, places))
    log_belief = uniform(places)
    unexplained = 0
    for t in range(steps):
        predicted = transition.predict(log_belief) if t else log_belief
        log_belief, explained = update(predicted, log10_p[t])
        unexplained += not explained
        belief[t] = np.exp(log_belief)
    return Filtered(belief / belief.sum(axis=1, keepdims=True), unexplained)
