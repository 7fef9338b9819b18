"""The order in which n-grams were first seen: what the order of unsorted counts depends on (section 15)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Ints
from placerec.lm.counts import NgramCounts
from placerec.lm.stored_text import StoredText
from placerec.lm.trie import Trie
from placerec.lm.vocabulary import Vocabulary
from placerec.srilm.order.hashing import first_positions, walk_order
from placerec.srilm.text.counts_file import Table
from placerec.srilm.text.vocabulary import WordList


@dataclass(frozen=True)
class FirstSeen:
    """Where all n-grams came from: counts files in the order of reading, then the text."""

    tables: Sequence[Table]
    text: StoredText | None
    words: WordList

    def positions(self, trie: Trie) -> list[Ints]:
        """Per order, when each row was first seen, int64 (m_n,)."""
        _, renumbered = self.words.sorted()
        sorted_number = np.array(renumbered, np.int64)
        never = np.iinfo(np.int64).max
        first = [np.full(len(keys), never) for keys in trie.keys]
        now = 0
        for table in self.tables:
            for ngram in table.ngrams:
                row = np.zeros(1, np.int64)
                for n, number in enumerate(ngram, start=1):
                    row = trie.find(n, row, sorted_number[[number]])
                    first[n - 1][row] = np.minimum(first[n - 1][row], now)
                now += 1
        if self.text is not None:
            for n, its in enumerate(first_positions(self.text, trie, sorted_number)):
                first[n] = np.minimum(first[n], np.where(its < never - now, its + now, never))
        return first

    def numbers(self, vocabulary: Vocabulary) -> Ints:
        """SRILM's number of each word of the sorted vocabulary, int64 (V,)."""
        _, renumbered = self.words.sorted()
        numbers = np.full(len(vocabulary), -1, np.int64)
        for number, place in enumerate(renumbered):
            if place >= 0:
                numbers[place] = number
        return numbers

    def walk(self, counts: NgramCounts) -> tuple[Ints, Ints]:
        """The n-grams in SRILM's unsorted order: orders and rows, int64 (M,)."""
        trie = counts.trie
        return walk_order(trie, counts.seen, self.positions(trie), self.numbers(trie.vocabulary))

    def format(self, counts: NgramCounts, *, only: int | None = None, count: str = "%d") -> str:
        """A counts file in SRILM's unsorted order."""
        orders, rows = self.walk(counts)
        texts = {n: counts.trie.texts(n) for n in range(1, counts.order + 1) if only in (None, n)}
        lines = []
        for n, row in zip(orders.tolist(), rows.tolist(), strict=True):
            if n in texts:
                lines.append(f"{texts[n][row]}\t{count % counts.counts[n - 1][row]}\n")
        return "".join(lines)
