"""Counts of pairs of words, and emissions that are computed from them."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.methods.training_set import TrainingSet


@dataclass(frozen=True)
class PairEmissions:
    """Emissions that depend on the word and on `longest` words before it.

    `score_ids`: from word numbers int64 (T,) and those 1, 2... words before them, int64 (longest, T), -1 before the
    sequence, to log10 p float64 (T, C).
    """

    vocabulary: tuple[str, ...] = field(repr=False)
    longest: int
    score_ids: Callable[[Ints, Ints], Floats] = field(repr=False)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {word: i for i, word in enumerate(self.vocabulary)}

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of T words, each after those before it."""
        ids = np.array([self._index[word] for word in words], np.int64)
        return self.score_ids(ids, before(ids, self.longest))

    def follow(self) -> Callable[[str], Sequence[float]]:
        """A function from each word of a sequence in turn to its log10 p (C) in each place, in constant memory."""
        recent = deque([-1] * self.longest, maxlen=self.longest)

        def score(word: str) -> list[float]:
            number = self._index[word]
            row: list[float] = self.score_ids(np.array([number]), np.array(recent)[:, None])[0].tolist()
            recent.appendleft(number)
            return row

        return score


def before(ids: Ints, longest: int) -> Ints:
    """The words 1, 2... `longest` places before each, int64 (longest, T); -1 before the first."""
    padded = np.concatenate([np.full(longest, -1), ids])
    return np.stack([padded[longest - lag : len(padded) - lag] for lag in range(1, longest + 1)])


@dataclass(frozen=True)
class PairCounts:
    """How often a word followed another one `lag` words later in the same visit.

    `keys` int64 (m,), ascending: V times the first word plus the second; `counts` float64 (m, C); `totals` float64
    (V, C): of all pairs with that first word.
    """

    words: int
    keys: Ints = field(repr=False)
    counts: Floats = field(repr=False)
    totals: Floats = field(repr=False)

    def look_up(self, first: Ints, second: Ints) -> tuple[Floats, Floats]:
        """Of pairs of words (T,): their counts and the totals of their first words, (T, C); 0 for a first word -1."""
        key = first * self.words + second
        at = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        known = (first >= 0)[:, None]
        # The last row is there for keys that are not listed.
        return np.where(known & (self.keys[at] == key)[:, None], self.counts[at], 0.0), np.where(
            known, self.totals[first], 0.0
        )


def count_pairs(training: TrainingSet, lag: int = 1) -> PairCounts:
    """Count the pairs in the sentences of all places."""
    V, C = len(training.vocabulary), len(training.places)
    keys = [
        np.concatenate([np.zeros(0, np.int64), *(visit[:-lag] * V + visit[lag:] for visit in visits)])
        for visits in training.sentences
    ]
    # Never empty, so that every look-up has a row to point at.
    listed = np.array(sorted({-1, *np.concatenate(keys).tolist()}), np.int64)
    counts = np.zeros((len(listed), C))
    totals = np.zeros((V, C))
    for c, place in enumerate(keys):
        counts[:, c] = np.bincount(np.searchsorted(listed, place), minlength=len(listed))
        totals[:, c] = np.bincount(place // V, minlength=V)
    return PairCounts(V, listed, counts, totals)
