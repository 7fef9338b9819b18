"""Counts files as arrays: section 4.2 of our SRILM specification."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints
from placerec.lm.counts import NgramCounts, tabulate
from placerec.srilm.text.counts_file import MOST_TOKENS, counted
from placerec.srilm.text.fields import FILLED, Fields, comments, eight_digits, split_lines, usual_blocks, without_lines
from placerec.srilm.text.numbering import Numbering
from placerec.srilm.text.streams import Lines, Streams
from placerec.srilm.text.vocabulary import WordList

# int64, or float64 if they are real numbers.
Counts = NDArray[Any]
_BLOCK = 1 << 19
# Digits that are taken apart many at a time, and of which all numbers are int64.
_FEW, _MOST_DIGITS = 8, 18
_TENS = 10 ** np.arange(_FEW + 1)
_POINTS = bytes.maketrans(b".", b"0")


@dataclass(frozen=True)
class Table:
    """N-grams and their counts, by order n = 1, 2, ...: SRILM's numbers of words int64 (m, n), counts (m,).

    `places` int64 (m,): where an n-gram stands among all of the file, by number.
    """

    ngrams: Sequence[Ints] = ()
    counts: Sequence[Counts] = ()
    places: Sequence[Ints] = ()

    @property
    def size(self) -> int:
        """A number above all places."""
        return max((int(place[-1]) + 1 for place in self.places if len(place)), default=0)

    @property
    def total(self) -> int:
        """The sum of integer counts, however large it is."""
        halves = [(count >> 32, count & (1 << 32) - 1) for count in self.counts if count.dtype == np.int64]
        return sum((int(high.sum()) << 32) + int(low.sum()) for high, low in halves)

    def emptied(self) -> "Table":
        """The n-grams of this table, each with count 0."""
        return Table(self.ngrams, [np.zeros_like(count) for count in self.counts], self.places)

    def within(self, other: "Table") -> "Table":
        """The n-grams that `other` holds too, as n-gram or as the beginning of one."""
        wider = [ngram for matrix in other.ngrams for ngram in matrix.tolist()]
        held = {tuple(ngram[:n]) for ngram in wider for n in range(1, len(ngram) + 1)}
        kept = [np.array([tuple(ngram) in held for ngram in matrix.tolist()], bool) for matrix in self.ngrams]
        columns = ([own[mask] for own, mask in zip(its, kept, strict=True)] for its in (self.counts, self.places))
        return Table([matrix[mask] for matrix, mask in zip(self.ngrams, kept, strict=True)], *columns)

    def count(self, order: int, words: WordList, *, fractional: bool) -> NgramCounts:
        """The counts of the n-grams up to `order` over the sorted vocabulary; repeated n-grams add up."""
        vocabulary, sorted_number = words.sorted()
        dtype = np.float64 if fractional else np.int64
        groups = [sorted_number[matrix] for matrix in self.ngrams[:order]]
        return tabulate(vocabulary, order, groups, [count.astype(dtype) for count in self.counts[:order]])


def read_counts(
    name: str,
    order: int,
    words: WordList,
    streams: Streams,
    *,
    fractional: bool,
    limited: bool = False,
    minima: Sequence[float] | None = None,
) -> Table:
    """The n-grams up to `order` of a counts file, those of `tabled`."""
    lines = streams.lines(name)
    blocks = lines.blocks(_BLOCK)
    tables: list[Table] = []
    # Which words are asked for, and names that stand for nothing, are looked at one by one.
    if not (limited or minima is not None or words.meta_tag is not None or words.nameless):
        odd: list[bytes] = []
        tables += _plain_tables(lines, usual_blocks(blocks, odd), order, words, fractional, odd)
        blocks = chain(odd, blocks)
    rest = lines.of(line for block in blocks for line in BytesIO(block))
    start = max((table.size for table in tables), default=0)
    careful = tabled(
        counted(lines, rest, fractional),
        order,
        words,
        fractional=fractional,
        limited=limited,
        minima=minima,
        start=start,
    )
    return _joined([*tables, careful])


def _plain_tables(
    lines: Lines, blocks: Iterable[bytes], order: int, words: WordList, fractional: bool, odd: list[bytes]
) -> Iterator[Table]:
    """The tables of blocks of lines, up to the first block with a line that is not plain, which is handed back."""
    numbering, place = Numbering(words, adding=True), 0
    for block in blocks:
        fields, length = split_lines(block.lower() if words.lower else block)
        fields, used = without_lines(fields, length, comments(fields, length))
        size = used[used > 0]
        last = np.cumsum(size) - 1
        counts = _numbers(fields, last, fractional)
        if counts is None or ((size < 2) | (size > MOST_TOKENS)).any():
            odd.append(block)
            return
        lines.number += len(length)
        yield _table(fields, last, size - 1, counts, place, order, numbering)
        place += len(size)


def _table(
    fields: Fields, last: Ints, size: Ints, counts: Counts, start: int, order: int, numbering: Numbering
) -> Table:
    """The n-grams of lines: their last fields hold the counts, the `size` (m,) before each of these words."""
    short = size <= order
    is_word = np.repeat(short, size + 1)
    is_word[last] = False
    numbers = numbering.numbers(fields, np.flatnonzero(is_word))
    end = np.cumsum(np.where(short, size, 0))
    rows = [np.flatnonzero(size == n) for n in range(1, min(order, int(size.max(initial=0))) + 1)]
    ngrams = [numbers[end[row][:, None] - n + np.arange(n)] for n, row in enumerate(rows, start=1)]
    return Table(ngrams, [counts[row] for row in rows], [start + row for row in rows])


def _numbers(fields: Fields, at: Ints, fractional: bool) -> Counts | None:
    """The counts in the fields `at`; None if one has other characters than digits (and points), or too many."""
    if fractional:
        texts = [fields.text(i) for i in at.tolist()]
        if not b"".join(texts).translate(_POINTS).isdigit():
            return None
        try:
            return np.array([*map(float, texts)])
        except ValueError:
            return None
    size = fields.lengths[at]
    digits, plain = eight_digits(fields.eights[fields.starts[at]], FILLED.take(size, mode="clip"))
    counts: Ints = digits.astype(np.int64) // _TENS[_FEW - np.minimum(size, _FEW)]
    for i in np.flatnonzero(~plain | (size > _FEW)).tolist():
        text = fields.text(int(at[i]))
        if not text.isdigit() or len(text) > _MOST_DIGITS:
            return None
        counts[i] = int(text)
    return counts


def tabled(
    counts: Iterable[tuple[list[str], float]],
    order: int,
    words: WordList,
    *,
    fractional: bool = False,
    limited: bool = False,
    minima: Sequence[float] | None = None,
    start: int = 0,
) -> Table:
    """The table of n-grams up to `order` and their counts, one by one; the first one has the place `start`.

    `limited`: those with a word that is not listed are left out. `minima`: so are, instead, those seen more rarely than
    the minimum of their order, the last one repeats (-read-with-mincounts); with a meta tag, the counts of counts of
    what is left out after each prefix that is kept come last.
    """
    ngrams: list[list[int]] = []
    values: list[float] = []
    dropped: dict[tuple[str, ...], Counter[int]] = {}
    for ngram, count in counts:
        if len(ngram) > order:
            continue
        if minima is not None:
            if count < minima[min(len(ngram), len(minima)) - 1]:
                dropped.setdefault(tuple(ngram[:-1]), Counter())[int(count)] += 1
                continue
        elif limited and any(
            words.normal(word) not in words.index and words.occurrences(words.normal(word)) < 0 for word in ngram
        ):
            continue
        ngrams.append([words.number(word) for word in ngram])
        values.append(count)
    if words.meta_tag is not None:
        kept = {tuple(ngram[:-1]) for ngram in ngrams}
        for prefix, tally in dropped.items():
            numbers = [words.known(word) for word in prefix]
            if tuple(numbers) in kept:
                for k, times in sorted(tally.items()):
                    ngrams.append([*numbers, words.add(f"{words.meta_tag}{k}")])
                    values.append(times)
    return _of_rows(ngrams, np.array(values, np.float64 if fractional else np.int64), start)


def _of_rows(ngrams: Sequence[Sequence[int]], counts: Counts, start: int) -> Table:
    size = np.array([*map(len, ngrams)], np.int64)
    rows = [np.flatnonzero(size == n) for n in range(1, int(size.max(initial=0)) + 1)]
    matrices = [np.array([ngrams[i] for i in row.tolist()], np.int64) for row in rows]
    return Table(
        [matrix.reshape(-1, n) for n, matrix in enumerate(matrices, start=1)],
        [counts[row] for row in rows],
        [start + row for row in rows],
    )


def _joined(tables: Sequence[Table]) -> Table:
    orders = range(max(len(table.ngrams) for table in tables))
    columns = zip(*((table.ngrams, table.counts, table.places) for table in tables), strict=True)
    return Table(*([np.concatenate([own[n] for own in its if n < len(own)]) for n in orders] for its in columns))
