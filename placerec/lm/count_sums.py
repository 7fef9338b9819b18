"""Sums of counts: of pieces that were counted elsewhere, and of counts files, which are added to and taken from."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np

from placerec.arrays import Ints
from placerec.errors import LanguageModelError, at
from placerec.files import all_lines
from placerec.jobs import Executor
from placerec.lm.counts import NgramCounts, add_counts, count_text, numbered, tabulate
from placerec.lm.markers import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.lm.stored_text import Numbers, StoredText
from placerec.lm.trie import Vocabulary

# A piece of a text, by the text's number: word numbers (T,) and lengths of sentences (S,).
Piece = tuple[int, Numbers, Ints]
# Its counts, by the text's number: per order the n-grams (m, n) and how often each occurs (m,).
Counted = tuple[int, list[Ints], list[Numbers]]


def count_texts(
    texts: Iterable[Iterable[Sequence[str]]],
    order: int,
    *,
    vocabulary: Iterable[str],
    markers: bool = True,
    work: Executor = map,
) -> Iterator[NgramCounts]:
    """`count_ngrams` of every text, in order, with a closed vocabulary; `work` counts the pieces, which are added here.

    Beside the pieces that are under way, memory holds a few times the n-grams of one text.
    """
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
