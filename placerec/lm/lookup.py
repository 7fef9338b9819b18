"""A back-off model that only answers questions: per order a hash table of its n-grams, each packed into one number.

That is less than a Draft, and there sooner: nothing is sorted, and an ending needs no row of its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask, Singles
from placerec.lm.row_index import RowIndex


class Entries(NamedTuple):
    """N-grams of one order: words int64 (m, n), log10 p float32 (m,), which are contexts (m,), their weights."""

    words: Ints
    log10_p: Singles
    weighted: Mask
    backoff: Singles


class Table(NamedTuple):
    """The same for looking up: log10 p and weights float32 (m+1,), at the end those of what is not listed: -inf, 0."""

    rows: RowIndex
    log10_p: Singles
    backoff: Singles


class Lookup(NamedTuple):
    """The tables of orders 1..N over words 0..V-1.

    A code is a number whose digits, to the base of V+1, are words: the number of a word plus 1, and 0 for what is not
    listed. In front of an n-gram zeros change nothing, so that what is shorter is found in no table but its own.
    """

    V: int
    tables: Sequence[Table]

    def digits(self, ids: Ints) -> Ints:
        """The digits of word numbers int64 (T,); 0 for -1, and for numbers from V on."""
        digits = ids + 1
        digits[digits > self.V] = 0
        return digits

    def contexts(self, digits: Ints, starts: Ints) -> list[Ints]:
        """Codes (T,) of the 0, 1, ..., N-1 words before each word of a text; sequences begin at `starts`."""
        before = [np.zeros(len(digits), np.int64)]
        while len(before) < len(self.tables):
            codes = np.zeros(len(digits), np.int64)
            if len(before) > 1:
                np.multiply(before[-1][:-1], self.V + 1, out=codes[1:])
            codes[1:] += digits[:-1]
            codes[starts] = 0
            before.append(codes)
        return before

    def find(self, contexts: Sequence[Ints], digits: Ints) -> tuple[Singles, NDArray[np.int8]]:
        """log10 p float32 (T,) of words after contexts, and the length (T,) of the n-gram that answers, 0 for none."""
        order, base = len(self.tables), self.V + 1
        codes = contexts[-1] * base
        codes += digits
        row = self.tables[-1].rows.find(codes)
        log10_p, answered = self.tables[-1].log10_p.take(row, mode="wrap"), np.full(len(digits), order, np.int8)
        left = np.flatnonzero(row < 0)
        paid = []
        for n in range(order - 1, 0, -1):
            table = self.tables[n - 1]
            # What may answer now, and the contexts that did not help before: both have n words.
            row = table.rows.find(np.concatenate([contexts[n - 1][left] * base + digits[left], contexts[n][left]]))
            paid.append((left, table.backoff[row[len(left) :]]))
            row = row[: len(left)]
            log10_p[left], answered[left] = table.log10_p[row], n
            left = left[row < 0]
        answered[left] = 0
        weight = np.zeros(len(digits), np.float32)
        # From short contexts to long: so SRILM adds their weights up.
        for at, its in reversed(paid):
            weight[at] += its
        with np.errstate(invalid="ignore"):
            log10_p += weight
        return log10_p, answered


def build_lookup(V: int, orders: Sequence[Sequence[Entries]]) -> Lookup | None:
    """The tables of a model over words 0..V-1, each order in any number of pieces; None if it needs a Draft.

    That is so where an n-gram is listed twice or its context has no weight, and where codes do not fit into int64.
    """
    if (V + 1) ** len(orders) >= 2**63:
        return None
    tables: list[Table] = []
    weighted = np.zeros(0, bool)
    for pieces in orders:
        codes = np.concatenate([np.zeros(0, np.int64), *(_codes(V, piece.words) for piece in pieces)])
        rows = RowIndex(codes)
        if not rows.distinct or (tables and not _has_contexts(codes // (V + 1), tables[-1].rows, weighted)):
            return None
        weighted = np.concatenate([np.zeros(0, bool), *(piece.weighted for piece in pieces)])
        weights = (np.where(piece.weighted, piece.backoff, np.float32(0)) for piece in pieces)
        tables.append(
            Table(
                rows,
                np.concatenate([*(piece.log10_p for piece in pieces), _NOT_LISTED]),
                np.concatenate([*weights, _NO_WEIGHT]),
            )
        )
    return Lookup(V, tables)


_NOT_LISTED, _NO_WEIGHT = np.array([-np.inf], np.float32), np.zeros(1, np.float32)


def _codes(V: int, words: Ints) -> Ints:
    codes = words[:, 0] + 1
    for k in range(1, words.shape[1]):
        codes *= V + 1
        codes += words[:, k]
        codes += 1
    return codes


def _has_contexts(contexts: Ints, rows: RowIndex, weighted: Mask) -> bool:
    """Whether all contexts are listed with a weight; they are looked up once where they follow each other."""
    row = rows.find(contexts[np.diff(contexts, prepend=-1) != 0])
    return bool((row >= 0).all() and weighted[row].all())
