"""The order in which `ngram` comes by the contexts of a model, that of its messages: section 15 of our specification.

SRILM keeps the contexts of a model in a trie of hash tables, the most recent word first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Ints
from placerec.lm.trie import Trie
from placerec.srilm.order.hashing import table_order
from placerec.srilm.order.messages import ContextOrder

NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True)
class ContextTimes:
    """When each context was put into the trie: `created` int64 (m_n,) per order beside the rows, NEVER if it was not.

    `numbers` int64 (V,): SRILM's number of each word. `expected`: the size of vocabulary that the model was made for.
    """

    trie: Trie
    created: Sequence[Ints] = field(repr=False)
    numbers: Ints = field(repr=False)
    expected: int = 0


def message_order(trie: Trie, times: ContextTimes) -> ContextOrder:
    """Places of contexts of a model over `trie` that was read as `times` tells; others come last, by their words."""
    ranks: list[Ints] = []

    def places(n: int, contexts: Ints) -> Ints:
        if n == 1:
            return contexts
        if not ranks:
            ranks.extend(_iteration(times))
        row = _same_rows(trie, times.trie, n - 1, contexts)
        known = ranks[n - 2][row] if n - 1 <= len(ranks) and len(ranks[n - 2]) else np.full(len(row), NEVER)
        known = np.where(row >= 0, known, NEVER)
        late = np.flatnonzero(known == NEVER)
        if len(late):
            *_, last = (rank for _, rank in zip(range(n - 1), trie.context_ranks(), strict=False))
            known[late] = NEVER // 2 + last[contexts[late]]
        return known

    return places


def _same_rows(trie: Trie, other: Trie, n: int, rows: Ints) -> Ints:
    """The rows of `other` with the same words, -1 where there are none."""
    numbers = np.empty((len(rows), n), np.int64)
    for k in range(n, 0, -1):
        numbers[:, k - 1] = trie.word(k)[rows]
        rows = trie.prefix(k)[rows] if k > 1 else rows
    own = other.vocabulary.ids(trie.vocabulary.words)[numbers]
    found = own[:, 0]
    for k in range(2, n + 1):
        found = other.find(k, found, own[:, k - 1])
    return found


def _iteration(times: ContextTimes) -> list[Ints]:
    """Per length of context, the place of each row in SRILM's walk, int64 (m_n,); NEVER for what is no context."""
    trie = times.trie
    ranks: list[Ints] = []
    oldest, above = trie.keys[0], np.zeros(len(trie.vocabulary), np.int64)
    for k in range(1, trie.order):
        if k > 1:
            oldest, above = oldest[trie.prefix(k)], ranks[-1][trie.suffixes[k - 1]]
        rows = np.flatnonzero(times.created[k - 1] < NEVER)
        rows = rows[np.lexsort((times.created[k - 1][rows], above[rows]))]
        table: Ints = np.cumsum(np.diff(above[rows], prepend=above[rows][:1]) > 0)
        keys = times.numbers[oldest[rows]].astype(np.uint64)
        walked = rows[table_order(table, keys, size_hint=times.expected if k == 1 else 0)]
        rank = np.full(len(trie.keys[k - 1]), NEVER)
        rank[walked] = np.arange(len(walked))
        ranks.append(rank)
    return ranks
