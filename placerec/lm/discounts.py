"""Discounting: how much of a seen n-gram's relative frequency is kept, what the shorter context gets, and the fits.

Every rule is a function of the n-grams' counts (m,), of their contexts (`Context`, arrays (m,)) and of V, the size of
the vocabulary; it returns (`factor`, `lower`), float64 (m,): with interpolation p(w|h) = factor c/T + lower p(w|h'),
as a back-off model p(w|h) = factor c/T for seen n-grams, and the mass left goes to the shorter context. Sources:
sections 4.4 and 5 of our SRILM specification; `lidstone` is formula (c) of the readings of the paper, section 1.2.
Good-Turing's factors and Kneser-Ney's discounts are fitted on counts of counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import LanguageModelError
from placerec.lm.counts import NgramCounts
from placerec.lm.logs import EPSILON, shown


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
    delta = max(0.0, delta)
    return lambda count, context, V: ((1 + delta / count) / (1 + V * delta / context.total), np.zeros_like(count))


def lidstone(delta: float) -> Discount:
    """Interpolated Lidstone: V delta imagined occurrences after each context, spread as the shorter context says."""

    def shared(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
        mass = V * delta
        return context.total / (context.total + mass), mass / (context.total + mass)

    return shared


def jelinek_mercer(weights: Floats, bins_of: Callable[[Floats], Ints]) -> Discount:
    """Jelinek & Mercer 1980: the relative frequency has a weight, by how often the context was seen."""

    def shared(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
        weight = weights[bins_of(context.total)]
        return weight, 1 - weight

    return shared


def absolute(discount: float) -> Discount:
    """Ney's absolute discounting: a constant, cut to 0..1, is taken off every count."""
    off = min(1.0, max(0.0, discount))
    return lambda count, context, V: (
        np.where(count < off, 0.0, (count - off) / count),
        off * context.types / np.ceil(context.total),
    )


def natural(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    """Ristad's natural discounting."""
    total, types = context.total, context.types
    kept = (total * (total + 1) + types * (1 - types)) / (total * (total + 1) + 2 * types)
    return np.where(types == V, 1.0, kept), np.zeros_like(count)


def good_turing(factors: Sequence[float]) -> Discount:
    """Good-Turing: `factors[c]` for counts c below len(factors), 1 above."""
    kept = np.array([*factors, 1.0])
    return lambda count, context, V: (
        kept[np.minimum(count, len(kept) - 1).astype(np.int64)],
        np.zeros_like(count),
    )


def modified_kneser_ney(d1: float, d2: float, d3: float) -> Discount:
    """Chen & Goodman 1998: a discount each for counts of 1, 2, and 3 or more (of left neighbours, at lower orders)."""

    def shared(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
        off = np.select([count == 1, count == 2], [d1, d2], d3)
        types, twos, threes = context.types, context.types2, context.types3
        return (count - off) / count, (d1 * (types - twos) + d2 * (twos - threes) + d3 * threes) / context.total

    return shared


def counts_of_counts(
    counts: NgramCounts, n: int, top: int, predictable: Mask, meta: Ints, *, once: bool = False
) -> Ints:
    """How many n-grams of order n occur 0, 1, ..., `top` times, int64 (top+1,).

    `predictable` bool (V,): words whose n-grams count when they come last. `meta` int64 (V,): k > 0 for a word that
    stands for "n-grams that occur k times", as often as the count of that word says (`once`: once).
    """
    trie = counts.trie
    word, count, seen = trie.word(n), counts.counts[n - 1], counts.seen[n - 1]
    plain = count[seen & predictable[word] & (count <= top)].astype(np.int64)
    tally = np.bincount(plain, minlength=top + 1)
    said = seen & (meta[word] > 0) & (meta[word] <= top)
    np.add.at(tally, meta[word[said]], 1 if once else count[said].astype(np.int64))
    return tally


def good_turing_factors(tally: Ints, top: int) -> tuple[list[float] | None, list[str]]:
    """Good-Turing's factors for counts 0..top (1 for 0), or None where it is disabled; and what is to be warned of.

    `tally`: counts of counts up to top + 1. `top` may be lowered on the way.
    """
    warnings: list[str] = []
    if tally[1] == 0:
        warnings.append("warning: no singleton counts")
        top = 0
    while top > 0 and tally[top + 1] == 0:
        warnings.append(f"warning: count of count {top + 1} is zero -- lowering maxcount")
        top -= 1
    if top <= 0:
        return None, [*warnings, "GT discounting disabled"]
    factors = [1.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        common = np.float64((top + 1) * tally[top + 1]) / np.float64(tally[1])
        for k in range(1, top + 1):
            if tally[k] == 0:
                warnings.append(f"warning: count of count {k} is zero")
                factors.append(1.0)
                continue
            ratio = np.float64((k + 1) * tally[k + 1]) / np.float64(k * tally[k])
            factor = float((ratio - common) / (1 - common))
            if not np.isfinite(factor) or factor <= EPSILON or ratio > 1:
                warnings.append(f"warning: discount coeff {k} is out of range: {shown(factor)}")
                factor = 1.0
            factors.append(factor)
    return factors, warnings


def left_neighbour_counts(counts: NgramCounts, n: int, predictable: Mask) -> NgramCounts:
    """The counts with those of order n replaced by numbers of distinct words to the left (Kneser & Ney 1995).

    N-grams whose first word is not predictable (<s>) keep their counts. Order n+1 must still hold plain counts.
    """
    trie = counts.trie
    own = counts.counts[n - 1]
    first = np.arange(len(own))
    for k in range(n, 1, -1):
        first = trie.prefix(k)[first]
    longer = counts.seen[n] & (counts.counts[n] > 0)
    second = np.arange(len(longer))
    for k in range(n + 1, 2, -1):
        second = trie.prefix(k)[second]
    # `second` is the row of the first two words; its last word is the second word.
    rows = trie.suffixes[n][longer & predictable[trie.word(2)[second]]]
    neighbours = np.bincount(rows, minlength=len(own)).astype(own.dtype)
    modified = np.where(predictable[first], 0, own) + np.where(counts.seen[n - 1], neighbours, 0)
    return replace(counts, counts=(*counts.counts[: n - 1], modified, *counts.counts[n:]))


def kneser_ney_discount(n1: int, n2: int) -> float:
    """The one discount of original Kneser-Ney; LanguageModelError where a count of counts is zero."""
    if n1 == 0 or n2 == 0:
        raise LanguageModelError("one of required KneserNey count-of-counts is zero")
    return n1 / (n1 + 2 * n2)


def modified_kneser_ney_discounts(n1: int, n2: int, n3: int, n4: int) -> tuple[float, float, float]:
    """The discounts for counts of 1, 2 and more (Chen & Goodman 1998); they may come out negative.

    Raises LanguageModelError where a count of counts is zero, as in small closed vocabularies.
    """
    if 0 in (n1, n2, n3, n4):
        raise LanguageModelError("one of required modified KneserNey count-of-counts is zero")
    y = n1 / (n1 + 2 * n2)
    return 1 - 2 * y * n2 / n1, 2 - 3 * y * n3 / n2, 3 - 4 * y * n4 / n3
