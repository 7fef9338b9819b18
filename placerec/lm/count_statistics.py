"""What discounts are fitted on: counts of counts, Good-Turing factors, Kneser-Ney's left-neighbour counts.

Sources: sections 4.4, 5.2 and 5.3 of our SRILM specification.
"""

from dataclasses import replace

import numpy as np

from placerec.arrays import Ints, Mask
from placerec.errors import LanguageModelError
from placerec.lm.counts import NgramCounts
from placerec.lm.logs import EPSILON
from placerec.lm.trie import per_context


def counts_of_counts(counts: NgramCounts, n: int, top: int, predictable: Mask, meta: Ints) -> Ints:
    """How many n-grams of order n occur 0, 1, ..., `top` times, int64 (top+1,).

    `predictable` bool (V,): words whose n-grams count when they come last. `meta` int64 (V,): k > 0 for a word that
    stands for "n-grams that occur k times", as often as its count says.
    """
    trie = counts.trie
    word, count, seen = trie.word(n), counts.counts[n - 1], counts.seen[n - 1]
    plain = count[seen & predictable[word] & (count <= top)].astype(np.int64)
    tally = np.bincount(plain, minlength=top + 1)
    said = seen & (meta[word] > 0) & (meta[word] <= top)
    np.add.at(tally, meta[word[said]], count[said].astype(np.int64))
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
                warnings.append(f"warning: discount coeff {k} is out of range: {factor:.6g}")
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


# The largest float64 that is an int64.
_LARGEST = np.nextafter(2.0**63, 0)


def recomputed(counts: NgramCounts) -> NgramCounts:
    """The counts with every n-gram that has extensions replaced by their sum (`-recompute`)."""
    values = list(counts.counts)
    for n in range(counts.order, 1, -1):
        seen = counts.seen[n - 1]
        prefix = counts.trie.prefix(n)[seen]
        sums = per_context(prefix, len(values[n - 2]), values[n - 1][seen].astype(np.float64))
        if values[n - 2].dtype == np.int64:
            sums = np.minimum(sums, _LARGEST)
        parents = np.bincount(prefix, minlength=len(values[n - 2])) > 0
        values[n - 2] = np.where(parents, sums.astype(values[n - 2].dtype), values[n - 2])
    return replace(counts, counts=tuple(values))
