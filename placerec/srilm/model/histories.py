"""The contexts that a language model tells apart, as the states of a decoder."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import SightedScorer

# Answers that are kept: positions of a stream ask for the same ones again and again.
_MOST_KEPT = 4096


class Histories:
    """Contexts by number: each is as many of the last words, oldest first, as the model can use, at most `order`-1.

    Number 0 is the empty context; those in `useless` are a word that the model cannot use. Without a model (`scorer` is
    None) every word has log10 p `otherwise`.
    """

    def __init__(self, scorer: SightedScorer | None, order: int, otherwise: float = 0.0) -> None:
        self.scorer, self.order, self.otherwise = scorer, order, otherwise
        self.contexts: list[tuple[int, ...]] = [()]
        self.numbers: dict[tuple[int, ...], int] = {(): 0}
        self.useless: set[int] = set()
        self._kept: dict[tuple[bytes, tuple[int, ...]], tuple[Singles, Ints]] = {}

    def number(self, context: tuple[int, ...]) -> int:
        """The number of a context."""
        number = self.numbers.setdefault(context, len(self.contexts))
        if number == len(self.contexts):
            self.contexts.append(context)
        return number

    def after(self, contexts: Ints, words: Sequence[int]) -> tuple[Singles, Ints]:
        """log10 p float32 (A, S) of A words after S contexts, and the numbers of the contexts behind them, (A, S).

        The context behind a word holds at least the word, even if the model cannot use it.
        """
        key = contexts.tobytes(), tuple(words)
        if key not in self._kept:
            if len(self._kept) >= _MOST_KEPT:
                self._kept.clear()
            self._kept[key] = self._asked(contexts.tolist(), words)
        return self._kept[key]

    def _asked(self, contexts: Sequence[int], words: Sequence[int]) -> tuple[Singles, Ints]:
        rows = [(*self.contexts[context], word) for word in words for context in contexts]
        shape = len(words), len(contexts)
        if self.scorer is None or not rows:
            behind = [self.number(row[-1:]) for row in rows]
            return np.full(shape, self.otherwise, np.float32), np.array(behind, np.int64).reshape(shape)
        # A word more behind each: the context that it has is what the model can use.
        ids = np.array([number for row in rows for number in (*row, 0)], np.int64)
        ends = np.cumsum([len(row) + 1 for row in rows]) - 1
        first = np.zeros(len(ids), bool)
        first[np.append(0, ends[:-1] + 1)] = True
        scored = np.zeros(len(ids), bool)
        scored[ends - 1] = True
        view = self.scorer(TokenSequence(ids, first, scored))
        used = view.used[ends].tolist()
        behind = [self.number(row[-max(length, 1) :]) for row, length in zip(rows, used, strict=True)]
        self.useless.update(context for context, length in zip(behind, used, strict=True) if not length)
        return view.score().log10_p[ends - 1].reshape(shape), np.array(behind, np.int64).reshape(shape)
