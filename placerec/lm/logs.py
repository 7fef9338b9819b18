"""Log probabilities as models store them: float32 to the base of 10; and the arrays that go with them."""

import math
from collections.abc import Sequence

import numpy as np

from placerec.arrays import Floats, Singles

EPSILON = 3e-6
# What SRILM writes for the logarithm of 0; whatever is below the second is one, however it was added up; and the least
# logarithm that compute-best-mix goes on with.
LOG_ZERO, ABOUT_LOG_ZERO, LEAST_LOG10 = -99.0, -90.0, -320.0
LN10 = 2.30258509299404568402
# How far numpy's exp and log10 may be off, together, times 1 and the logarithm.
_UNSURE = 4e-15


def p_of(log10_p: Singles) -> Floats:
    """Probabilities float64 of float32 log10 probabilities, by the specification's exp(x ln 10)."""
    return np.exp(log10_p.astype(np.float64) * LN10)


def log10(p: Floats) -> Singles:
    """float32 log10 of float64 probabilities; -inf for 0, nan (as C has it, without sign) for less."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(p < 0, np.nan, np.log10(p)).astype(np.float32)


def log10_of_sum(
    total: Floats,
    log10_probs: Sequence[Singles],
    weights: Sequence[Floats | float],
    *,
    start: Floats | float = 0.0,
    divisor: Floats | float = 1.0,
) -> Singles:
    """float32 log10 of `total` (m,): of (start + sum of weight * p) / divisor, of which log10 p is float32 (m,).

    A weight that is a power of ten makes log10 p + k of log10 p: often just between two float32 numbers, so that the
    last bit of the functions decides. There the C library is asked, as SRILM does.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.where(total < 0, np.nan, np.log10(total))
        single = value.astype(np.float32)
        beyond = np.abs(value - single) - np.spacing(np.abs(single)).astype(np.float64) / 2
        unsure = np.flatnonzero(np.abs(beyond) < _UNSURE * (1 + np.abs(value)))
    if len(unsure):
        columns = (start, divisor, *weights, *log10_probs)
        rows = zip(*(np.broadcast_to(one, len(total))[unsure].tolist() for one in columns), strict=True)
        single[unsure] = [_log10_of_sum(start, divisor, parts) for start, divisor, *parts in rows]
    return single


def _log10_of_sum(total: float, divisor: float, parts: Sequence[float]) -> float:
    for weight, log10_p in zip(parts[: len(parts) // 2], parts[len(parts) // 2 :], strict=True):
        total += weight * math.exp(log10_p * LN10)
    return math.log10(total / divisor)


def shown(value: float, digits: int = 6) -> str:
    """A number as C prints it with %.*g: the sign of what is no number is shown, too."""
    if math.isnan(value):
        return "-nan" if math.copysign(1, value) < 0 else "nan"
    return f"{value:.{digits}g}"
