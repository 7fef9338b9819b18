"""The order in which `ngram-count` comes by n-grams and contexts: that of unsorted counts and messages (section 15)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from placerec.arrays import Ints
from placerec.lm.counts import NgramCounts, occurrences
from placerec.lm.stored_text import StoredText
from placerec.lm.trie import Trie, runs
from placerec.srilm.order.contexts import NEVER, ContextTimes, context_ranks
from placerec.srilm.order.hashing import walk_order
from placerec.srilm.order.messages import Messages
from placerec.srilm.text.counts_table import Table
from placerec.srilm.text.vocabulary import WordList

_LONG = 1 << 40
_NO_ROWS = np.zeros(0, np.int64)


@dataclass(frozen=True)
class FirstSeen:
    """Where all n-grams came from: counts files in the order of reading, then the text."""

    tables: Sequence[Table]
    text: StoredText | None
    words: WordList

    def positions(self, trie: Trie) -> list[Ints]:
        """Per order, when each row was first seen, int64 (m_n,)."""
        # Words may have been added since the n-grams were counted.
        sorted_number = trie.vocabulary.ids([word or "" for word in self.words.words])
        first = [np.full(len(keys), NEVER) for keys in trie.keys]
        now = 0
        for table in self.tables:
            for matrix, places in zip(table.ngrams, table.places, strict=True):
                row = np.zeros(len(matrix), np.int64)
                for n, numbers in enumerate(sorted_number[matrix].T, start=1):
                    row = trie.find(n, row, numbers)
                    np.minimum.at(first[n - 1], row, now + places)
            now += table.size
        if self.text is not None:
            for block, found in occurrences(self.text, trie, sorted_number):
                for its, (position, row) in zip(first, found, strict=True):
                    new = its[row] == NEVER
                    # Of several values for one row the last is kept: reversed, the earliest.
                    its[row[new][::-1]] = now + position[new][::-1]
                now += len(block.ids)
        return first

    def walk(self, counts: NgramCounts) -> tuple[Ints, Ints]:
        """The n-grams in SRILM's unsorted order: orders and rows, int64 (M,)."""
        trie = counts.trie
        return walk_order(trie, counts.seen, self.positions(trie), self.words.numbers(trie.vocabulary))

    def format(self, counts: NgramCounts, *, only: int | None = None, count: str = "%d") -> str:
        """A counts file in SRILM's unsorted order."""
        orders, rows = self.walk(counts)
        texts = {n: counts.trie.texts(n) for n in range(1, counts.order + 1) if only in (None, n)}
        lines = []
        for n, row in zip(orders.tolist(), rows.tolist(), strict=True):
            if n in texts:
                lines.append(f"{texts[n][row]}\t{count % counts.counts[n - 1][row]}\n")
        return "".join(lines)


class EstimationMessages(Messages):
    """Messages in the order of SRILM's hash tables: the n-grams' in the count trie, the contexts' in the model."""

    empty_weight = 0.0

    def __init__(self, counts: NgramCounts, first: FirstSeen, *args: Any, **options: Any) -> None:
        numbers = first.words.numbers(counts.trie.vocabulary)
        super().__init__(counts.trie, *args, numbers=numbers, visited=self._visited, weighed=self._weighed, **options)
        self.counts = counts
        self.first = first
        # N-grams of order n as they were stored, for n = 2, 3, ...: they make their contexts.
        self._stored: dict[int, list[Ints]] = {}

    def probabilities(self, n: int, attempt: int, rows: Ints, *details: Any) -> None:
        if n > 1:
            self._stored.setdefault(n, []).append(rows)
        super().probabilities(n, attempt, rows, *details)

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
        times = ContextTimes(self.trie, self._born(), self.numbers, len(self.first.words.index))
        return context_ranks(times)[n - 2][contexts]

    def _born(self) -> list[Ints]:
        """Per order, when each row became a context of the model, int64 (m_k,), NEVER if it has not by now."""
        born = [np.full(len(keys), NEVER) for keys in self.trie.keys]
        for k in range(2, self.trie.order + 1):
            rows = np.concatenate([runs(self.trie.prefix(k)[its])[0] for its in self._stored.get(k, [_NO_ROWS])])
            stamp = k * _LONG + self._walk[k - 2][rows]
            for j in range(k - 1, 0, -1):
                np.minimum.at(born[j - 1], rows, stamp)
                rows = self.trie.suffixes[j - 1][rows]
        return born
