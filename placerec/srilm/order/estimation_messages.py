"""The order in which `ngram-count` comes by n-grams and contexts: that of its messages (section 15)."""

from functools import cached_property
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.counts import NgramCounts
from placerec.lm.trie import build_trie, runs
from placerec.srilm.order.first_seen import FirstSeen
from placerec.srilm.order.hashing import walk_order
from placerec.srilm.order.messages import Messages

_NEVER = np.iinfo(np.int64).max
_LONG = 1 << 40
_NO_ROWS = np.zeros(0, np.int64)


class EstimationMessages(Messages):
    """Messages in the order of SRILM's hash tables: the n-grams' in the count trie, the contexts' in the model."""

    def __init__(self, counts: NgramCounts, first: FirstSeen, *args: Any, **options: Any) -> None:
        super().__init__(counts.trie, *args, visited=self._visited, weighed=self._weighed, **options)
        self.counts = counts
        self.first = first
        # N-grams of order n as they were stored, for n = 2, 3, ...: they make their contexts.
        self._stored: dict[int, list[Ints]] = {}

    def probabilities(self, n: int, attempt: int, rows: Ints, *details: Any) -> None:
        if n > 1:
            self._stored.setdefault(n, []).append(rows)
        super().probabilities(n, attempt, rows, *details)

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        # The golden runs show 0 for the empty context while estimating, and log10 of its mass when pruning.
        super().weights(n, contexts, num, den, weight if n > 1 else np.zeros_like(weight))

    @cached_property
    def _walk(self) -> list[Ints]:
        """Per order, the place of each n-gram in a walk over the counts, int64 (m_n,)."""
        orders, rows = self.first.walk(self.counts)
        places = [np.zeros(len(keys), np.int64) for keys in self.trie.keys]
        for n, place in enumerate(places, start=1):
            its = rows[orders == n]
            place[its] = np.arange(len(its))
        return places

    def _visited(self, n: int, rows: Ints) -> Ints:
        return self._walk[n - 1][rows]

    def _weighed(self, n: int, contexts: Ints) -> Ints:
        """Places of contexts in the model, whose tables are nested from the most recent word to the oldest."""
        if n == 1:
            return contexts
        born = self._born(n)
        known = [np.flatnonzero(stamp < _NEVER) for stamp in born]
        backwards = [self.trie.matrix(k)[rows][:, ::-1] for k, rows in enumerate(known, start=1)]
        vocabulary = self.trie.vocabulary
        reverse, rows_of = build_trie(vocabulary, n - 1, backwards)
        first = [np.full(len(keys), _NEVER) for keys in reverse.keys]
        seen = [np.zeros(len(keys), bool) for keys in reverse.keys]
        for k, rows in enumerate(known):
            first[k][rows_of[k][-1]] = born[k][rows]
            seen[k][rows_of[k][-1]] = True
        names = len(self.first.words.index)
        orders, walked = walk_order(reverse, seen, first, self.first.numbers(vocabulary), root_size=names)
        its = walked[orders == n - 1]
        place = np.zeros(len(reverse.keys[n - 2]), np.int64)
        place[its] = np.arange(len(its))
        of_row = np.zeros(len(self.trie.keys[n - 2]), np.int64)
        of_row[known[n - 2]] = place[rows_of[n - 2][-1]]
        return of_row[contexts]

    def _born(self, n: int) -> list[Ints]:
        """Per order below n, when each row became a context of the model, int64 (m_k,)."""
        born = [np.full(len(keys), _NEVER) for keys in self.trie.keys[: n - 1]]
        for k in range(2, n + 1):
            rows = np.concatenate([runs(self.trie.prefix(k)[its])[0] for its in self._stored.get(k, [_NO_ROWS])])
            stamp = k * _LONG + self._walk[k - 2][rows]
            for j in range(k - 1, 0, -1):
                np.minimum.at(born[j - 1], rows, stamp)
                rows = self.trie.suffixes[j - 1][rows]
        return born
