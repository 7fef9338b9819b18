"""Which n-grams there are: a table per order, sorted, so that a look-up is a binary search on whole arrays.

Words are numbered in the order of their code points (for UTF-8 that is byte order, the order of SRILM's files), so
number order is text order. The n-grams of order n are rows; a row is known by the row of its first n-1 words in the
table below and by its last word. Order 1 is dense: row = word number.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Numbers
from placerec.lm.row_index import RowIndex
from placerec.lm.vocabulary import Vocabulary

_NO_ROWS = np.zeros(0, np.int64)
# Rows that are looked up at once: what is computed on the way stays in the processor's cache.
_PART = 1 << 15
# Of a number >= 0.
_BITS = 63


@dataclass(frozen=True)
class Trie:
    """The n-grams of orders 1..N over `vocabulary`.

    `keys[n-1]`, int64 (m_n,), ascending: prefix row times V plus last word. `keys[0]` is 0..V-1. `known_suffixes`: the
    `suffixes`, from whoever makes the trie and has them.
    """

    vocabulary: Vocabulary
    keys: tuple[Ints, ...] = field(repr=False)
    known_suffixes: tuple[Ints, ...] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"Trie({self.sizes})"

    @property
    def sizes(self) -> str:
        """How many n-grams there are of each order, in words."""
        return f"order {self.order}: " + ", ".join(f"{len(keys)} {n}-grams" for n, keys in enumerate(self.keys, 1))

    @property
    def order(self) -> int:
        return len(self.keys)

    def prefix(self, n: int) -> Ints:
        """Rows of order n-1, int64 (m_n,): each n-gram without its last word (n >= 2)."""
        return self.keys[n - 1] // len(self.vocabulary)

    def word(self, n: int) -> Ints:
        """The last word of each n-gram, int64 (m_n,)."""
        return self.keys[n - 1] % len(self.vocabulary) if n > 1 else self.keys[0]

    def find(self, n: int, prefix: Ints, word: Ints) -> Ints:
        """Rows of order n with these prefix rows and last words, int64, -1 where there is none (or either is -1)."""
        if n == 1:
            return word
        keys = self.keys[n - 1]
        if len(keys) == 0:
            return np.full(np.shape(word), -1, np.int64)
        wanted = np.where((prefix >= 0) & (word >= 0), prefix * len(self.vocabulary) + word, -1)
        row = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[row] == wanted, row, -1)

    @cached_property
    def suffixes(self) -> tuple[Ints, ...]:
        """Per order n, rows of order n-1, int64 (m_n,): each n-gram without its first word; -1 where not listed.

        Order 1 has zeros.
        """
        if self.known_suffixes is not None:
            return self.known_suffixes
        size, found = len(self.vocabulary), [np.zeros(len(self.vocabulary), np.int64)]
        for n in range(2, self.order + 1):
            index = RowIndex(self.keys[n - 2]) if n > 2 else None
            found.append(_without_first(self.keys[n - 1], size, index, found[-1]))
        return tuple(found)

    @property
    def closed(self) -> bool:
        """Whether every n-gram without its first word is listed too."""
        return all(bool((rows >= 0).all()) for rows in self.suffixes)

    def with_endings(self) -> "Trie":
        """The trie of these n-grams and all their endings."""
        if self.closed:
            return self
        return closed_trie(self.vocabulary, self.order, [self.matrix(n) for n in range(1, self.order + 1)])[0]

    def matrix(self, n: int) -> Ints:
        """The word numbers of the n-grams of order n, int64 (m_n, n)."""
        numbers = np.empty((len(self.keys[n - 1]), n), np.int64)
        rows = np.arange(len(numbers))
        for k in range(n, 0, -1):
            numbers[:, k - 1] = self.word(k)[rows]
            rows = self.prefix(k)[rows] if k > 1 else rows
        return numbers

    def texts(self, n: int) -> list[str]:
        """The n-grams of order n as words joined by blanks."""
        if n == 1:
            return list(self.vocabulary.words)
        shorter, words = self.texts(n - 1), self.vocabulary.words
        return [
            f"{shorter[row]} {words[word]}"
            for row, word in zip(self.prefix(n).tolist(), self.word(n).tolist(), strict=True)
        ]

    def context_ranks(self) -> Iterator[Ints]:
        """Per order n, the place int64 (m_n,) of each n-gram when read from its last word to its first.

        SRILM sorts the contexts of its files so (section 7 of our specification).
        """
        rank = np.arange(len(self.vocabulary))
        yield rank
        for n in range(2, self.order + 1):
            by_word = np.lexsort((rank[self.prefix(n)], self.word(n)))
            rank = np.empty(len(by_word), np.int64)
            rank[by_word] = np.arange(len(by_word))
            yield rank

    def keep(self, masks: Sequence[Mask]) -> "Trie":
        """The trie of the rows that `masks`, bool (m_n,) per order, name; prefixes of kept rows must be kept."""
        words = self.vocabulary.words
        vocabulary = Vocabulary.of(words[number] for number in np.flatnonzero(masks[0]).tolist())
        new_word = np.cumsum(masks[0]) - 1
        new_row, keys = new_word, [np.arange(len(vocabulary))]
        for n in range(2, self.order + 1):
            kept = self.keys[n - 1][masks[n - 1]]
            keys.append(new_row[kept // len(words)] * len(vocabulary) + new_word[kept % len(words)])
            new_row = np.cumsum(masks[n - 1]) - 1
        return Trie(vocabulary, tuple(keys))


def runs(values: Ints) -> tuple[Ints, Ints]:
    """The distinct values of an ascending array int64 (m,), and for each entry which of them it is, int64 (m,)."""
    new = changes(values)
    return values[np.flatnonzero(new)], np.cumsum(new) - 1


def distinct(keys: Sequence[Ints]) -> Ints:
    """The distinct numbers of all `keys`, ascending, int64 (m,)."""
    return runs(np.sort(np.concatenate([_NO_ROWS, *keys])))[0]


def per_context(prefix: Ints, size: int, values: Numbers | None = None) -> Floats:
    """Sums float64 (size,) of `values` (default: ones) over the rows that share a prefix row."""
    return np.bincount(prefix, weights=values, minlength=size).astype(np.float64)


def changes(values: Ints) -> Mask:
    """Where a value differs from the one before, bool (m,); the first one does."""
    changed = np.ones(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=changed[1:])
    return changed


def _without_first(keys: Ints, size: int, index: RowIndex | None, shorter: Ints) -> Ints:
    """The `suffixes` (m,) of one order, of which these are the keys (m,); `shorter` are those of the order below.

    `size`: V. `index`: of the keys of the order below; None if that is order 1.
    """
    if index is None:
        return keys % size
    rows = np.empty(len(keys), np.int64)
    for start in range(0, len(rows), _PART):
        its = keys[start : start + _PART]
        prefix = its // size
        ending = shorter[prefix]
        wanted = (ending - prefix) * size + its
        wanted[ending < 0] = -1
        rows[start : start + _PART] = index.find(wanted)
    return rows


def build_trie(vocabulary: Vocabulary, order: int, ngrams: Sequence[Numbers]) -> tuple[Trie, list[list[Numbers]]]:
    """The trie of n-grams, each group a matrix of word numbers, integers (m, n), n <= order, and of all their prefixes.

    Also the rows, integers (m,), of every group's n-grams' prefixes: of length 1, 2, ..., n. It takes least time where
    n-grams of one context stand side by side.
    """
    size, keys, index = len(vocabulary), [np.arange(len(vocabulary))], None
    suffixes = [np.zeros(size, np.int64)]
    rows = [[matrix[:, 0]] for matrix in ngrams]
    heads = [_heads(matrix) for matrix in ngrams]
    for n in range(2, order + 1):
        own = [i for i, matrix in enumerate(ngrams) if matrix.shape[1] == n]
        wide = [i for i, matrix in enumerate(ngrams) if matrix.shape[1] > n]
        its = [_keys(rows[i][-1], ngrams[i][:, n - 1], size) for i in own]
        wanted = [_keys(rows[i][-1][heads[i]], ngrams[i][heads[i], n - 1], size) for i in wide]
        listed, places = _distinct_and_places(its)
        below, index = index, RowIndex(listed) if n < order else None
        found = [index.find(key) for key in wanted] if index else []
        if any((row < 0).any() for row in found):
            # Mostly every prefix is an n-gram of its own: then there is less to sort.
            listed = distinct([listed, *wanted])
            index = RowIndex(listed)
            found, places = [index.find(key) for key in wanted], [index.find(key) for key in its]
        suffixes.append(_without_first(listed, size, below, suffixes[-1]))
        keys.append(listed)
        for i, row in zip(own, places, strict=True):
            rows[i].append(row.astype(_narrow(listed), copy=False))
        for i, row in zip(wide, found, strict=True):
            rows[i].append(np.repeat(row.astype(_narrow(listed)), np.diff(heads[i], append=len(ngrams[i]))))
    return Trie(vocabulary, tuple(keys), tuple(suffixes)), rows


def _heads(ngrams: Numbers) -> Ints:
    """Where n-grams (m, n) begin that share all but the last word, int64 (h,)."""
    changed = np.zeros(len(ngrams), bool)
    changed[:1] = True
    for column in ngrams.T[:-1]:
        changed[1:] |= column[1:] != column[:-1]
    return np.flatnonzero(changed)


def _keys(prefix: Numbers, word: Numbers, size: int) -> Ints:
    keys = prefix.astype(np.int64)
    keys *= size
    keys += word
    return keys


def _distinct_and_places(parts: Sequence[Ints]) -> tuple[Ints, list[Numbers]]:
    """The distinct numbers >= 0 of all parts, ascending, int64 (m,), and where each part's numbers are among them."""
    numbers = np.concatenate([_NO_ROWS, *parts])
    bits = len(numbers).bit_length()
    if int(numbers.max(initial=0)).bit_length() + bits <= _BITS:
        # Numbers are sorted much faster than their places: here both are one.
        numbers <<= bits
        numbers |= np.arange(len(numbers))
        numbers.sort()
        place = numbers & (1 << bits) - 1
        numbers >>= bits
    else:
        place = np.argsort(numbers)
        numbers = numbers[place]
    new = changes(numbers)
    rows = np.empty(len(numbers), _narrow(numbers))
    rows[place] = np.cumsum(new, dtype=rows.dtype) - 1
    listed = numbers if new.all() else numbers[np.flatnonzero(new)]
    return listed, np.split(rows, np.cumsum([len(part) for part in parts[:-1]]))[: len(parts)]


def _narrow(keys: Ints) -> type[np.signedinteger[Any]]:
    """A type for the rows of these keys: they are many, and held for as long as a trie is made."""
    return np.int32 if len(keys) < 1 << 31 else np.int64


def endings(ngrams: Numbers) -> list[Numbers]:
    """The n-grams without their first word, without their first two, ...: matrices (m, n-1), ..., (m, 1)."""
    return [ngrams[:, start:] for start in range(1, ngrams.shape[1])]


def closed_trie(vocabulary: Vocabulary, order: int, ngrams: Sequence[Numbers]) -> tuple[Trie, list[list[Numbers]]]:
    """The trie of n-grams, each group a matrix of word numbers, integers (m, n), of all their prefixes and endings.

    Also the rows, integers (m,), of every group's n-grams' prefixes: of length 1, 2, ..., n.
    """
    trie, rows = build_trie(vocabulary, order, ngrams)
    if not trie.closed:
        trie, rows = build_trie(vocabulary, order, [*ngrams, *(end for group in ngrams for end in endings(group))])
    return trie, rows[: len(ngrams)]


def united_trie(vocabulary: Vocabulary, tries: Sequence[Trie]) -> tuple[Trie, list[list[Ints]]]:
    """The trie of all n-grams of all `tries`, over `vocabulary`, which must list all their words.

    Also the rows int64 (m_n,) of the n-grams of every trie: of length 1, 2, ...
    """
    words = [vocabulary.ids(trie.vocabulary.words) for trie in tries]
    keys, rows = [np.arange(len(vocabulary))], [[word] for word in words]
    for n in range(2, max(trie.order for trie in tries) + 1):
        wanted = [
            _keys(its[n - 2][trie.prefix(n)], word[trie.word(n)], len(vocabulary)) if n <= trie.order else _NO_ROWS
            for trie, word, its in zip(tries, words, rows, strict=True)
        ]
        listed, places = _distinct_and_places(wanted)
        keys.append(listed)
        for its, place in zip(rows, places, strict=True):
            its.append(place.astype(np.int64))
    known = _united_suffixes(keys, tries, rows) if all(trie.closed for trie in tries) else None
    return Trie(vocabulary, tuple(keys), known), rows


def _united_suffixes(keys: Sequence[Ints], tries: Sequence[Trie], rows: Sequence[Sequence[Ints]]) -> tuple[Ints, ...]:
    """The suffixes of a trie with these keys, of which every n-gram is one of the `tries`, in these `rows`."""
    found = [np.zeros(len(keys[0]), np.int64)]
    for n in range(2, len(keys) + 1):
        suffixes = np.empty(len(keys[n - 1]), np.int64)
        for trie, its in zip(tries, rows, strict=True):
            if n <= trie.order:
                suffixes[its[n - 1]] = its[n - 2][trie.suffixes[n - 1]]
        found.append(suffixes)
    return tuple(found)
