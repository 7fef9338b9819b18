"""Log probabilities as models store them: float32 to the base of 10; and the arrays that go with them."""

import numpy as np

from placerec.arrays import Floats, Singles

EPSILON = 3e-6
# What SRILM writes for the logarithm of 0; whatever is below the second is one, however it was added up; and the least
# logarithm that compute-best-mix goes on with.
LOG_ZERO, ABOUT_LOG_ZERO, LEAST_LOG10 = -99.0, -90.0, -320.0
LN10 = 2.30258509299404568402


def p_of(log10_p: Singles) -> Floats:
    """Probabilities float64 of float32 log10 probabilities, by the specification's exp(x ln 10)."""
    return np.exp(log10_p.astype(np.float64) * LN10)


def log10(p: Floats) -> Singles:
    """float32 log10 of float64 probabilities; -inf for 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log10(p).astype(np.float32)
