"""Counting n-grams: one sort of packed windows gives the counts of all orders (any order, any vocabulary).

Counts are added: of pieces that were counted elsewhere, and of counts files, which are added to and taken from.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Numbers
from placerec.errors import LanguageModelError, at, refuse_string
from placerec.files import all_lines
from placerec.lm.row_index import RowIndex
from placerec.lm.stored_text import BLOCK, Block, StoredText, distinct_windows
from placerec.lm.trie import Trie, changes, closed_trie, per_context
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN, Vocabulary, add_markers, find_markers

if TYPE_CHECKING:
    from placerec.jobs import Executor

# A piece of a text, by the text's number: word numbers (T,) and lengths of sentences (S,).
Piece = tuple[int, Numbers, Ints]
# Its counts, by the text's number: per order the n-grams (m, n) and how often each occurs (m,).
Counted = tuple[int, list[Ints], list[Numbers]]
# The largest float64 that is an int64.
_LARGEST = np.nextafter(2.0**63, 0)


@dataclass(frozen=True)
class NgramCounts:
    """How often each n-gram occurs: `counts[n-1]` int64 or float64 (m_n,), beside the rows of `trie`.

    `seen[n-1]` bool (m_n,): whether the row is an n-gram of the counts (perhaps with count 0). The others are there
    because order 1 lists the whole vocabulary, and because every n-gram's ending has a row.
    """

    trie: Trie
    counts: tuple[Numbers, ...] = field(repr=False)
    seen: tuple[Mask, ...] = field(repr=False)

    def __repr__(self) -> str:
        return f"NgramCounts({self.trie.sizes})"

    @property
    def order(self) -> int:
        return self.trie.order


def count_ngrams(
    sentences: Iterable[Sequence[str]], order: int, *, vocabulary: Iterable[str] | None = None, markers: bool = True
) -> NgramCounts:
    """Count the n-grams of orders 1..`order` in sentences of words.

    With `markers`, every sentence is counted between `<s>` and `</s>`. With `vocabulary` it is closed: other
    words are counted as `<unk>`. No n-gram spans two sentences. The semantics are those of ngram-count
    (sections 3 and 4 of our SRILM specification). The sentences may be more than memory holds; OutputError if they
    are, and a temporary file cannot be written. LanguageModelError for an order below 1.
    """
    refuse_string(vocabulary, LanguageModelError)
    if order < 1:
        raise LanguageModelError(f"order {order} cannot be used; give 1 or more")
    numbers: defaultdict[str, int] = defaultdict(lambda: len(numbers))
    for word in (UNKNOWN, SENTENCE_START, SENTENCE_END, *(vocabulary or ())):
        numbers[word]
    number = partial(_listed, numbers) if vocabulary is not None else numbers.__getitem__
    text = StoredText()
    for tokens, lengths in numbered(sentences, number, markers):
        text.add(tokens, lengths)
    ordered = Vocabulary.of(numbers)
    return count_text(text, order, ordered, renumbered=ordered.ids(list(numbers)))


def numbered(
    sentences: Iterable[Sequence[str]], number: Callable[[str], int], markers: bool
) -> Iterator[tuple[Ints, Ints]]:
    """Sentences as word numbers (T,) and lengths (S,), in pieces of BLOCK words or a little more; one at least.

    With `markers`, sentences that are not empty get `<s>` and `</s>` where they lack them.
    """
    refuse_string(sentences, LanguageModelError)
    start, end = number(SENTENCE_START), number(SENTENCE_END)

    def piece() -> tuple[Ints, Ints]:
        ids, sizes = np.array(tokens, np.int64), np.array(lengths, np.int64)
        opened, ended = find_markers(ids, sizes, start, end)
        marked = (sizes > 0) & markers
        return add_markers(ids, sizes, start, end, marked & ~opened, marked & ~ended)

    tokens: list[int] = []
    lengths: list[int] = []
    for sentence in sentences:
        refuse_string(sentence, LanguageModelError)
        tokens.extend(map(number, sentence))
        lengths.append(len(sentence))
        if len(tokens) >= BLOCK:
            yield piece()
            tokens, lengths = [], []
    yield piece()


def _listed(numbers: Mapping[str, int], word: str) -> int:
    return numbers.get(word, 0)


def count_text(
    text: StoredText, order: int, vocabulary: Vocabulary, *, renumbered: Ints | None = None, fractional: bool = False
) -> NgramCounts:
    """Count the n-grams of a text, each as often as the sentence around it weighs (once, if sentences have no weights).

    `renumbered`: the vocabulary's number of each word number of the text, if that has others. `fractional`: counts
    are float64; otherwise weights must be integers. Beside the text, memory holds a few times the n-grams.
    """
    bits = max(1, len(vocabulary).bit_length())
    width = max(1, 63 // bits)
    spans = [range(start, min(start + width, order)) for start in range(0, order, width)]
    columns, counts = distinct_windows(text, spans, bits, renumbered=renumbered, weighted=not fractional)
    table = _table([(column, len(span)) for column, span in zip(columns, spans, strict=True)], counts, bits, vocabulary)
    if fractional and text.weighted:
        return replace(table, counts=_real_sums(text, table.trie, renumbered))
    return replace(table, counts=tuple(count.astype(np.float64) for count in table.counts)) if fractional else table


def _real_sums(text: StoredText, trie: Trie, renumbered: Ints | None) -> tuple[Floats, ...]:
    """The counts with real weights, added up in the order of the text: SRILM's sums, to the last digit."""
    sums = [np.zeros(len(keys)) for keys in trie.keys]
    for block, found in occurrences(text, trie, renumbered):
        weights = np.repeat(cast(Floats, block.weights), block.lengths)
        for order_sums, (position, row) in zip(sums, found, strict=True):
            np.add.at(order_sums, row, weights[position])
    return tuple(sums)


def occurrences(
    text: StoredText, trie: Trie, renumbered: Ints | None = None
) -> Iterator[tuple[Block, list[tuple[Ints, Ints]]]]:
    """Per block of a text and per order, where in the block n-grams start, ascending, and their rows: two int64 (m,).

    `renumbered`: the trie's number of each word number of the text, if that has others. `trie` must list all n-grams of
    the text.
    """
    indexes = [RowIndex(keys) for keys in trie.keys[1:]]
    for block in text:
        ids = block.ids.astype(np.int64) if renumbered is None else renumbered[block.ids]
        end = np.repeat(np.cumsum(block.lengths, dtype=np.int64), block.lengths)
        position, row = np.arange(len(ids)), ids
        found = [(position, row)]
        for n, index in enumerate(indexes, start=2):
            inside = position + n <= end[position]
            position = position[inside]
            row = index.find(row[inside] * len(trie.vocabulary) + ids[position + n - 1])
            found.append((position, row))
        yield block, found


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
            yield digit, changes(digit)


def tabulate(vocabulary: Vocabulary, order: int, ngrams: Sequence[Ints], values: Sequence[Numbers]) -> NgramCounts:
    """The counts in a table: groups of n-grams, matrices int64 (m, n), and their counts (m,), int64 or float64.

    Repeated n-grams add up. Prefixes that the table lacks are there with count 0.
    """
    trie, rows = closed_trie(vocabulary, order, ngrams)
    dtype = np.result_type(np.int64, *values)
    counts = [np.zeros(len(keys), dtype) for keys in trie.keys]
    seen = [np.zeros(len(keys), bool) for keys in trie.keys]
    for group, value in zip(rows, values, strict=False):
        np.add.at(counts[len(group) - 1], group[-1], value)
        for n, row in enumerate(group):
            seen[n][row] = True
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


def count_texts(
    texts: Iterable[Iterable[Sequence[str]]],
    order: int,
    *,
    vocabulary: Iterable[str],
    markers: bool = True,
    work: "Executor" = map,
) -> Iterator[NgramCounts]:
    """`count_ngrams` of every text, in order, with a closed vocabulary; `work` counts the pieces, which are added here.

    Beside the pieces that are under way, memory holds a few times the n-grams of one text.
    """
    refuse_string(vocabulary, LanguageModelError)
    ordered = Vocabulary.of((UNKNOWN, SENTENCE_START, SENTENCE_END, *vocabulary))
    unknown = ordered.index[UNKNOWN]
    narrow = np.min_scalar_type(len(ordered))  # so that little is sent
    pieces = (
        (text, tokens.astype(narrow), lengths)
        for text, sentences in enumerate(texts)
        for tokens, lengths in numbered(sentences, lambda word: ordered.index.get(word, unknown), markers)
    )
    counted = work(partial(_count_piece, ordered, order), pieces)
    for _, parts in groupby(counted, key=itemgetter(0)):
        yield _sum(tabulate(ordered, order, ngrams, counts) for _, ngrams, counts in parts)


def _count_piece(vocabulary: Vocabulary, order: int, piece: Piece) -> Counted:
    number, tokens, lengths = piece
    text = StoredText()
    text.add(tokens, lengths)
    table = count_text(text, order, vocabulary)
    orders = range(1, order + 1)
    ngrams = [table.trie.matrix(n)[table.seen[n - 1]] for n in orders]
    return number, ngrams, [table.counts[n - 1][table.seen[n - 1]] for n in orders]


def _sum(tables: Iterator[NgramCounts]) -> NgramCounts:
    """The sum of counts over one vocabulary; none is added to another often."""
    total = next(tables)
    waiting: list[NgramCounts] = []
    for table in tables:
        waiting.append(table)
        if sum(map(_rows, waiting)) > _rows(total):
            total, waiting = add_counts(total, *waiting), []
    return add_counts(total, *waiting) if waiting else total


def _rows(table: NgramCounts) -> int:
    return sum(map(len, table.counts))


def read_counts(path: Path, vocabulary: Vocabulary, order: int) -> NgramCounts:
    """The counts in a file of `format_counts`, in which every prefix and every ending of an n-gram is listed too.

    Raises LanguageModelError, naming the line, for what is no n-gram of `vocabulary` up to `order` with its count.
    """
    numbers: list[list[int]] = [[] for _ in range(order)]
    counts: list[list[int]] = [[] for _ in range(order)]
    for i, line in enumerate(all_lines(path, LanguageModelError), start=1):
        ngram, _, count = line.rpartition("\t")
        words = ngram.split(" ")
        if not line:
            continue
        try:
            numbers[len(words) - 1].extend([vocabulary.index[word] for word in words])
            counts[len(words) - 1].append(int(count))
        except (KeyError, ValueError, IndexError) as error:
            message = f"{line!r} is no n-gram of the vocabulary, of at most {order} words, with its count"
            raise LanguageModelError(at(path, i, f"{message}; train the model again")) from error
    ngrams = [np.array(group, np.int64).reshape(-1, n) for n, group in enumerate(numbers, start=1)]
    return tabulate(vocabulary, order, ngrams, [np.array(group, np.int64) for group in counts])


def subtract_counts(total: NgramCounts, part: NgramCounts) -> NgramCounts:
    """The counts of the sentences that are left when those of `part` are taken out of those of `total`.

    Both over one vocabulary. Raises LanguageModelError, naming the n-gram, for one that `part` counts more often.
    """
    orders, vocabulary = range(1, total.order + 1), total.trie.vocabulary
    ngrams = [table.trie.matrix(n) for table in (total, part) for n in orders]
    left = tabulate(vocabulary, total.order, ngrams, [*total.counts, *(-counts for counts in part.counts)])
    for n in orders:
        for row in np.flatnonzero(left.counts[n - 1] < 0)[:1].tolist():
            count = left.counts[n - 1][row]
            raise LanguageModelError(f"{left.trie.texts(n)[row]!r} would be left with the count {count}")
    kept = [counts > 0 for counts in left.counts]
    ngrams = [left.trie.matrix(n)[kept[n - 1]] for n in orders]
    return tabulate(vocabulary, total.order, ngrams, [c[k] for c, k in zip(left.counts, kept, strict=True)])


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
