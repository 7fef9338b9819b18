"""Discounting: how much of a seen n-gram's relative frequency is kept, and what the shorter context gets.

Every rule is a function of the n-grams' counts (m,), of their contexts (`Context`, arrays (m,)) and of V, the size of
the vocabulary; it returns (`factor`, `lower`), float64 (m,): with interpolation p(w|h) = factor c/T + lower p(w|h'),
as a back-off model p(w|h) = factor c/T for seen n-grams, and the mass left goes to the shorter context. Sources:
section 5 of our SRILM specification; `lidstone` is formula (c) of the readings of the paper, section 1.2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from placerec.arrays import Floats


@dataclass(frozen=True)
class Context:
    """What is known of n-grams' contexts, float64 (m,): occurrences, and distinct words, all, twice or thrice seen."""

    total: Floats
    types: Floats
    types2: Floats
    types3: Floats


Discount = Callable[[Floats, Context, int], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Rule:
    """How an order is estimated: without `discount` by relative frequency; n-grams seen less than `minimum` are out.

    `exhaustible`: whether a context that leaves nothing to unseen words is done again (section 6.4).
    """

    discount: Discount | None = None
    interpolate: bool = False
    minimum: float = 1
    exhaustible: bool = True


def witten_bell(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    """Witten & Bell 1991, method C: a context yields a new word as often as it did so far."""
    total, types = context.total, context.types
    whole = np.ceil(total)
    return total / (total + types), types / (whole + types)


def additive(delta: float) -> Discount:
    """SRILM's -addsmooth: (c + delta) / (T + V delta) for seen n-grams; the lower order is reached by back-off only."""
    return partial(_additive, max(0.0, delta))


def _additive(delta: float, count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    return (1 + delta / count) / (1 + V * delta / context.total), np.zeros_like(count)


def lidstone(delta: float) -> Discount:
    """Interpolated Lidstone: V delta imagined occurrences after each context, spread as the shorter context says."""
    return partial(_lidstone, delta)


def _lidstone(delta: float, count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    mass = V * delta
    return context.total / (context.total + mass), mass / (context.total + mass)


def absolute(discount: float) -> Discount:
    """Ney's absolute discounting: a constant, cut to 0..1, is taken off every count."""
    return partial(_absolute, min(1.0, max(0.0, discount)))


def _absolute(discount: float, count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    factor = np.where(count < discount, 0.0, (count - discount) / count)
    return factor, discount * context.types / np.ceil(context.total)


def natural(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    """Ristad's natural discounting."""
    total, types = context.total, context.types
    kept = (total * (total + 1) + types * (1 - types)) / (total * (total + 1) + 2 * types)
    return np.where(types == V, 1.0, kept), np.zeros_like(count)


def good_turing(factors: Sequence[float]) -> Discount:
    """Good-Turing: `factors[c]` for counts c below len(factors), 1 above."""
    return partial(_good_turing, np.array([*factors, 1.0]))


def _good_turing(factors: Floats, count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    return factors[np.minimum(count, len(factors) - 1).astype(np.int64)], np.zeros_like(count)


def modified_kneser_ney(d1: float, d2: float, d3: float) -> Discount:
    """Chen & Goodman 1998: a discount each for counts of 1, 2, and 3 or more (of left neighbours, at lower orders)."""
    return partial(_modified_kneser_ney, d1, d2, d3)


def _modified_kneser_ney(
    d1: float, d2: float, d3: float, count: Floats, context: Context, V: int
) -> tuple[Floats, Floats]:
    discount = np.select([count == 1, count == 2], [d1, d2], d3)
    types, twos, threes = context.types, context.types2, context.types3
    return (count - discount) / count, (d1 * (types - twos) + d2 * (twos - threes) + d3 * threes) / context.total
