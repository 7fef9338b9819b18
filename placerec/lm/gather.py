"""The trie of n-grams in any order, with what a model needs: all their prefixes and endings."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints
from placerec.lm.row_index import RowIndex
from placerec.lm.trie import Trie, Vocabulary, build_trie, endings, runs


def trie_of(vocabulary: Vocabulary, order: int, ngrams: Sequence[Ints]) -> tuple[Trie, list[list[Ints]]]:
    """The trie of n-grams, each group a matrix of word numbers int64 (m, n), of their prefixes and of their endings.

    Also the rows int64 (m,) of every group's n-grams' prefixes: of length 1, 2, ..., n.
    """
    trie, rows = _complete_trie(vocabulary, order, ngrams) or build_trie(vocabulary, order, ngrams)
    if not trie.closed:
        trie, rows = build_trie(vocabulary, order, [*ngrams, *(end for group in ngrams for end in endings(group))])
    return trie, rows[: len(ngrams)]


def _complete_trie(vocabulary: Vocabulary, order: int, ngrams: Sequence[Ints]) -> tuple[Trie, list[list[Ints]]] | None:
    """The same, without endings, if every prefix is an n-gram of its own; else None."""
    keys = [np.arange(len(vocabulary))]
    rows = [[matrix[:, 0]] for matrix in ngrams]
    for n in range(2, order + 1):
        wide = [i for i, matrix in enumerate(ngrams) if matrix.shape[1] >= n]
        wanted = [rows[i][-1] * len(vocabulary) + ngrams[i][:, n - 1] for i in wide]
        own = [key for i, key in zip(wide, wanted, strict=True) if ngrams[i].shape[1] == n]
        listed = runs(np.sort(np.concatenate(own)))[0] if own else np.zeros(0, np.int64)
        index = RowIndex(listed)
        keys.append(listed)
        for i, key in zip(wide, wanted, strict=True):
            rows[i].append(index.find(key))
            if (rows[i][-1] < 0).any():
                return None
    return Trie(vocabulary, tuple(keys)), rows
