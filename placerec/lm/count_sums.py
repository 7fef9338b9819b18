"""Counts files read back, and counts taken away from counts: what learning and forgetting a few sentences needs."""

from pathlib import Path

import numpy as np

from placerec.errors import LanguageModelError, at
from placerec.files import read_text
from placerec.lm.counts import NgramCounts, tabulate
from placerec.lm.trie import Vocabulary


def read_counts(path: Path, vocabulary: Vocabulary, order: int) -> NgramCounts:
    """The counts in a file of `format_counts`, in which every prefix and every ending of an n-gram is listed too.

    Raises LanguageModelError, naming the line, for what is no n-gram of `vocabulary` up to `order` with its count.
    """
    numbers: list[list[int]] = [[] for _ in range(order)]
    counts: list[list[int]] = [[] for _ in range(order)]
    for i, line in enumerate(read_text(path, LanguageModelError).split("\n"), start=1):
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
