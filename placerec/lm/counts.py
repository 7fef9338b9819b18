"""Counting n-grams: one sort of packed windows gives the counts of all orders (any order, any vocabulary)."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from placerec.lm.trie import Ints, Trie, Vocabulary

SENTENCE_START, SENTENCE_END, UNKNOWN = "<s>", "</s>", "<unk>"


@dataclass(frozen=True)
class NgramCounts:
    """How often each n-gram occurs: `counts[n-1]` int64 (m_n,), beside the rows of `trie`.

    Order 1 lists the whole vocabulary; `seen` bool (V,) tells which of its words the text holds.
    """

    trie: Trie
    counts: tuple[Ints, ...] = field(repr=False)
    seen: NDArray[np.bool_] = field(repr=False)

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
    return count_ids(
        ordered.ids(list(numbers))[np.array(tokens, np.int64)], np.array(lengths, np.int64), order, ordered
    )


def _marked(sentence: Sequence[str]) -> list[str]:
    start = [] if sentence and sentence[0] == SENTENCE_START else [SENTENCE_START]
    end = [] if sentence and sentence[-1] == SENTENCE_END else [SENTENCE_END]
    return [*start, *sentence, *end] if sentence else []


def count_ids(ids: Ints, lengths: Ints, order: int, vocabulary: Vocabulary) -> NgramCounts:
    """Count the n-grams of word numbers `ids` (T,), cut into sentences of `lengths`."""
    columns = _packed_windows(ids, lengths, order, len(vocabulary) + 1)
    if len(columns) == 1:
        columns = [(np.sort(columns[0][0]), columns[0][1])]
    else:
        by_window = np.lexsort([column for column, _ in reversed(columns)])
        columns = [(column[by_window], words) for column, words in columns]
    tally = np.bincount(ids, minlength=len(vocabulary))
    keys, counts = [np.arange(len(vocabulary))], [tally]
    row = np.zeros(len(ids), np.int64)
    new = np.zeros(len(ids), bool)
    for n, (digit, changed) in enumerate(_digits(columns, len(vocabulary) + 1), start=1):
        new = new | changed
        starts = np.flatnonzero(new)
        # Digit 0 is the padding behind a sentence's end: such a window holds no n-gram of this order.
        inside = digit[starts] > 0
        if n > 1:
            keys.append(row[starts[inside]] * len(vocabulary) + digit[starts[inside]] - 1)
            counts.append(np.diff(starts, append=len(ids))[inside])
            row = np.cumsum(new & (digit > 0)) - 1
        else:
            row = digit - 1
    return NgramCounts(Trie(vocabulary, tuple(keys)), tuple(counts), tally > 0)


def _packed_windows(ids: Ints, lengths: Ints, order: int, base: int) -> list[tuple[Ints, int]]:
    """The `order` words from each position on, as few numbers as hold them: (packed (T,), words in it) per column."""
    per_column = max(1, min(order, int(63 / np.log2(base))))
    sentence_end = np.repeat(np.cumsum(lengths), lengths)
    position = np.arange(len(ids))
    columns = []
    for start in range(0, order, per_column):
        width = min(per_column, order - start)
        packed = np.zeros(len(ids), np.int64)
        for offset in range(start, start + width):
            shifted = np.zeros(len(ids), np.int64)
            shifted[: max(0, len(ids) - offset)] = ids[offset:] + 1
            packed = packed * base + np.where(position + offset < sentence_end, shifted, 0)
        columns.append((packed, width))
    return columns


def _digits(columns: Sequence[tuple[Ints, int]], base: int) -> Iterator[tuple[Ints, NDArray[np.bool_]]]:
    """Per word of the sorted windows: the word (T,), and where it differs from the window before (bool (T,))."""
    for packed, width in columns:
        for left in range(width - 1, -1, -1):
            digit = packed // base**left % base
            changed = np.ones(len(digit), bool)
            changed[1:] = digit[1:] != digit[:-1]
            yield digit, changed


def format_counts(counts: NgramCounts) -> str:
    """SRILM's counts file, sorted: each n-gram is followed by its extensions (`ngram-count -sort -write`)."""
    trie = counts.trie
    columns: list[Ints] = []
    lines: list[str] = []
    for n in range(1, trie.order + 1):
        rows = np.flatnonzero(counts.seen) if n == 1 else np.arange(len(trie.keys[n - 1]))
        texts = trie.texts(n)
        lines += [f"{texts[row]}\t{count}\n" for row, count in zip(rows, counts.counts[n - 1][rows], strict=True)]
        path = np.full((len(rows), trie.order), -1, np.int64)
        for level in range(n, 0, -1):
            path[:, level - 1] = trie.word(level)[rows]
            rows = trie.prefix(level)[rows] if level > 1 else rows
        columns.append(path)
    paths = np.concatenate(columns)
    return "".join(lines[line] for line in np.lexsort(paths.T[::-1]).tolist())
