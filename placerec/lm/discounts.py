"""Discounting: how much of a seen n-gram's relative frequency is kept, and what the shorter context gets.

Every rule is a function of `count` (m,), and of `total` and `types` (m,) of the n-gram's context (occurrences, and
distinct words after it), and of V, the vocabulary's size; it returns (`factor`, `lower`), float64 (m,): with
interpolation p(w|h) = factor c/T + lower p(w|h'), as a back-off model p(w|h) = factor c/T for seen n-grams and the
mass left goes to the shorter context. Sources: section 5.1 of our SRILM specification; `paper/readings.md` 1.2.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.errors import LanguageModelError

Floats = NDArray[np.float64]
Discount = Callable[[Floats, Floats, Floats, int], tuple[Floats, Floats]]


def witten_bell(count: Floats, total: Floats, types: Floats, V: int) -> tuple[Floats, Floats]:
    """Witten & Bell 1991, method C: a context yields a new word as often as it did so far."""
    return total / (total + types), types / (total + types)


def additive(delta: float) -> Discount:
    """SRILM's -addsmooth: (c + delta) / (T + V delta) for seen n-grams; the lower order is reached by back-off only."""

    def discount(count: Floats, total: Floats, types: Floats, V: int) -> tuple[Floats, Floats]:
        return (1 + delta / count) / (1 + V * delta / total), np.zeros_like(count)

    return discount


def lidstone(delta: float) -> Discount:
    """Interpolated Lidstone: V delta imagined occurrences after each context, spread as the shorter context says."""

    def discount(count: Floats, total: Floats, types: Floats, V: int) -> tuple[Floats, Floats]:
        mass = V * delta
        return total / (total + mass), mass / (total + mass)

    return discount


@dataclass(frozen=True)
class Smoothing:
    """A discount, used for interpolation or for back-off."""

    discount: Discount
    interpolate: bool


SMOOTHINGS: dict[str, Callable[[float], Smoothing]] = {
    "witten-bell": lambda delta: Smoothing(witten_bell, True),
    "witten-bell-backoff": lambda delta: Smoothing(witten_bell, False),
    "lidstone": lambda delta: Smoothing(lidstone(delta), True),
    "lidstone-backoff": lambda delta: Smoothing(additive(delta), False),
}


def smoothing(name: str, delta: float = 1.0) -> Smoothing:
    """The smoothing of that name (SMOOTHINGS lists them); `delta` > 0 is used by the lidstone ones.

    Raises LanguageModelError for an unknown name or a delta that leaves unseen words without probability.
    """
    if name not in SMOOTHINGS:
        raise LanguageModelError(f"smoothing {name!r} is unknown; choose one of {', '.join(SMOOTHINGS)}")
    if not 0 < delta < float("inf"):
        raise LanguageModelError(f"delta {delta:g} must be a number above 0: it is what unseen words live on")
    return SMOOTHINGS[name](delta)
