"""Counting n-grams: one sort of packed windows gives the counts of all orders (any order, any vocabulary)."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.lm.trie import Ints, Trie, Vocabulary, build_trie, endings

# Tokens counted at once.
_BLOCK = 1 << 18
SENTENCE_START, SENTENCE_END, UNKNOWN = "<s>", "</s>", "<unk>"
Numbers = NDArray[Any]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class NgramCounts:
    """How often each n-gram occurs: `counts[n-1]` int64 or float64 (m_n,), beside the rows of `trie`.

    `seen[n-1]` bool (m_n,): whether the row is an n-gram of the counts (perhaps with count 0). The others are there
    because order 1 lists the whole vocabulary, and because every n-gram's ending has a row.
    """

    trie: Trie
    counts: tuple[Numbers, ...] = field(repr=False)
    seen: tuple[Mask, ...] = field(repr=False)

    @property
    def order(self) -> int:
        return self.trie.order


def count_ngrams(
    sentences: Iterable[Sequence[str]], order: int, *, vocabulary: Iterable[str] | None = None, markers: bool = True
) -> NgramCounts:
    """Count the n-grams of orders 1..`order` in sentences of words.

    With `markers`, every sentence is counted between <s> and </s>. With `vocabulary` the vocabulary is closed: other
    words are counted as <unk>. No n-gram spans two sentences. The semantics are those of ngram-count
    (sections 3 and 4 of our SRILM specification).
    """
    tokens: list[int] = []
    lengths: list[int] = []
    numbers: defaultdict[str, int] = defaultdict(lambda: len(numbers))
    for word in (UNKNOWN, SENTENCE_START, SENTENCE_END, *(vocabulary or ())):
        numbers[word]
    closed = vocabulary is not None
    for sentence in sentences:
        words = _marked(sentence) if markers else sentence
        if words:
            tokens.extend([numbers.get(word, 0) for word in words] if closed else [numbers[word] for word in words])
            lengths.append(len(words))
    ordered = Vocabulary.of(numbers)
    ids = ordered.ids(list(numbers))[np.array(tokens, np.int64)]
    return count_ids(ids, np.array(lengths, np.int64), order, ordered)


def _marked(sentence: Sequence[str]) -> list[str]:
    start = [] if sentence and sentence[0] == SENTENCE_START else [SENTENCE_START]
    end = [] if sentence and sentence[-1] == SENTENCE_END else [SENTENCE_END]
    return [*start, *sentence, *end] if sentence else []


def count_ids(
    ids: Ints,
    lengths: Ints,
    order: int,
    vocabulary: Vocabulary,
    *,
    weights: Numbers | None = None,
    renumbered: Ints | None = None,
) -> NgramCounts:
    """Count the n-grams of word numbers `ids` (T,), cut into sentences of `lengths`.

    `weights` (T,), int64 or float64: what an n-gram counts for that starts at this word; 1 by default.
    `renumbered`: the vocabulary's number of each word number, if `ids` are others.
    """
    bits = max(1, len(vocabulary).bit_length())
    if order * bits > 63:
        known = ids if renumbered is None else renumbered[ids]
        columns, counts = _wide_windows(known, lengths, order, bits, weights)
    else:
        windows, counts = _distinct_windows(ids, lengths, order, bits, weights, renumbered)
        columns = [(windows, order)]
    return _table(columns, counts, bits, vocabulary)


def _distinct_windows(
    ids: Ints, lengths: Ints, order: int, bits: int, weights: Numbers | None, renumbered: Ints | None
) -> tuple[Ints, Numbers]:
    """The distinct windows of `order` words, packed and ascending, and how often each occurs.

    Block by block, since sorting what fits in a cache is faster, and two at a time.
    """
    ends = np.cumsum(lengths)
    cuts = np.unique(np.searchsorted(ends, np.arange(_BLOCK, len(ids) + _BLOCK, _BLOCK), side="left") + 1)
    cuts = np.concatenate([[0], np.minimum(cuts, len(lengths))]) if len(ids) > _BLOCK else np.array([0, len(lengths)])

    def block(i: int) -> tuple[Ints, Numbers]:
        first, last = int(cuts[i]), int(cuts[i + 1])
        start, end = (int(ends[first - 1]) if first else 0), int(ends[last - 1]) if last else 0
        known = ids[start:end] if renumbered is None else renumbered[ids[start:end]]
        packed = _packed_windows(known, lengths[first:last], range(order), bits)
        return _summed(packed, None if weights is None else weights[start:end])

    if len(cuts) == 2:
        return block(0)
    with ThreadPoolExecutor(2) as pool:
        parts = list(pool.map(block, range(len(cuts) - 1)))
    windows = np.concatenate([windows for windows, _ in parts])
    return _summed(windows, np.concatenate([counts for _, counts in parts]))


def _summed(windows: Ints, weights: Numbers | None) -> tuple[Ints, Numbers]:
    """The distinct windows, ascending, and the sums of their weights."""
    if weights is None:
        windows = np.sort(windows)
        starts = np.flatnonzero(_changes(windows))
        return windows[starts], np.diff(starts, append=len(windows))
    order = np.argsort(windows, kind="stable")
    windows = windows[order]
    starts = np.flatnonzero(_changes(windows))
    return windows[starts], np.add.reduceat(weights[order], starts) if len(starts) else weights


def _wide_windows(
    ids: Ints, lengths: Ints, order: int, bits: int, weights: Numbers | None
) -> tuple[list[tuple[Ints, int]], Numbers]:
    """Distinct windows that need more than one number each: columns of packed words, and the counts."""
    width = max(1, 63 // bits)
    spans = [range(start, min(start + width, order)) for start in range(0, order, width)]
    columns = [_packed_windows(ids, lengths, span, bits) for span in spans]
    by_window = np.lexsort(columns[::-1])
    columns = [column[by_window] for column in columns]
    starts = np.flatnonzero(np.any([_changes(column) for column in columns], axis=0))
    counted = np.ones(len(ids), np.int64) if weights is None else weights[by_window]
    counts = np.add.reduceat(counted, starts) if len(starts) else counted
    return [(column[starts], len(span)) for column, span in zip(columns, spans, strict=True)], counts


def _packed_windows(ids: Ints, lengths: Ints, span: range, bits: int) -> Ints:
    """The words at these distances from each position, packed (T,); 0 stands for what is behind the sentence's end."""
    packed = np.zeros(len(ids), np.int64)
    symbols = ids + 1
    ends = np.cumsum(lengths)
    for distance in span:
        packed <<= bits
        packed[: max(0, len(ids) - distance)] |= symbols[distance:]
    # The last words of each sentence reached into the next one.
    for left in range(1, span.stop):
        at = (ends - left)[lengths >= left]
        shifts = [bits * (span.stop - 1 - distance) for distance in span if distance >= left]
        keep = ~sum(((1 << bits) - 1) << shift for shift in shifts)
        packed[at] &= keep
    return packed


def _changes(values: Ints) -> Mask:
    changed = np.ones(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=changed[1:])
    return changed


def _table(columns: Sequence[tuple[Ints, int]], counts: Numbers, bits: int, vocabulary: Vocabulary) -> NgramCounts:
    """The table of all n-grams in which distinct windows, sorted, begin."""
    keys: list[Ints] = [np.arange(len(vocabulary))]
    tallies: list[Numbers] = [np.zeros(len(vocabulary), counts.dtype)]
    seen = np.zeros(len(vocabulary), bool)
    row = np.zeros(len(counts), np.int64)
    new = np.zeros(len(counts), bool)
    for n, (digit, changed) in enumerate(_digits(columns, bits), start=1):
        new |= changed
        starts = np.flatnonzero(new)
        # Digit 0 is the padding behind a sentence's end: such a window holds no n-gram of this order.
        inside = digit[starts] > 0
        tally = np.add.reduceat(counts, starts)[inside] if len(starts) else counts
        if n == 1:
            tallies[0][digit[starts[inside]] - 1] = tally
            seen[digit[starts[inside]] - 1] = True
            row = digit - 1
        else:
            keys.append(row[starts[inside]] * len(vocabulary) + digit[starts[inside]] - 1)
            tallies.append(tally)
            row = np.cumsum(new & (digit > 0)) - 1
    every = (np.ones(len(key), bool) for key in keys[1:])
    return NgramCounts(Trie(vocabulary, tuple(keys)), tuple(tallies), (seen, *every))


def _digits(columns: Sequence[tuple[Ints, int]], bits: int) -> Iterator[tuple[Ints, Mask]]:
    """Per word of the sorted windows: the word (T,), and where it differs from the window before (bool (T,))."""
    for packed, width in columns:
        for left in range(width - 1, -1, -1):
            digit = (packed >> (bits * left)) & ((1 << bits) - 1)
            yield digit, _changes(digit)


def tabulate(vocabulary: Vocabulary, order: int, ngrams: Sequence[Ints], values: Sequence[Numbers]) -> NgramCounts:
    """The counts in a table: groups of n-grams, matrices int64 (m, n), and their counts (m,), int64 or float64.

    Repeated n-grams add up. Prefixes that the table lacks are there with count 0.
    """
    ends = [matrix for ngram in ngrams for matrix in endings(ngram)]
    trie, rows = build_trie(vocabulary, order, [*ngrams, *ends])
    dtype = np.result_type(np.int64, *values)
    counts = [np.zeros(len(keys), dtype) for keys in trie.keys]
    seen = [np.zeros(len(keys), bool) for keys in trie.keys]
    for group, value in zip(rows, values, strict=False):
        np.add.at(counts[len(group) - 1], group[-1], value)
        for n, its in enumerate(group):
            seen[n][its] = True
    return NgramCounts(trie, tuple(counts), tuple(seen))


def add_counts(*tables: NgramCounts) -> NgramCounts:
    """The sum of several counts over one vocabulary."""
    groups, values = [], []
    for table in tables:
        for n in range(1, table.order + 1):
            kept = table.seen[n - 1]
            groups.append(table.trie.matrix(n)[kept])
            values.append(table.counts[n - 1][kept])
    return tabulate(tables[0].trie.vocabulary, max(table.order for table in tables), groups, values)


def format_counts(counts: NgramCounts, *, only: int | None = None, count: str = "%d") -> str:
    """SRILM's counts file, sorted: each n-gram is followed by its extensions (`ngram-count -sort -write`).

    `only`: n-grams of this order alone. `count`: how a count is printed.
    """
    trie = counts.trie
    paths: list[Ints] = []
    lines: list[str] = []
    for n in range(1, trie.order + 1) if only is None else (only,):
        rows = np.flatnonzero(counts.seen[n - 1])
        texts = trie.texts(n)
        values = counts.counts[n - 1][rows].tolist()
        lines += [f"{texts[row]}\t{count % value}\n" for row, value in zip(rows.tolist(), values, strict=True)]
        path = np.full((len(rows), trie.order), -1, np.int64)
        path[:, :n] = trie.matrix(n)[rows]
        paths.append(path)
    by_word = np.lexsort(np.concatenate(paths).T[::-1])
    return "".join(lines[line] for line in by_word.tolist())
