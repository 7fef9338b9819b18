"""The contexts that a language model tells apart, as the states of a decoder."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.lm.score import TokenSequence
from placerec.srilm.model.class_scorers import SimpleClasses
from placerec.srilm.model.mixed_scorers import Mixture
from placerec.srilm.model.scorers import ModelView, Scorer, View

# Answers that are kept: positions of a stream ask for the same ones again and again.
_MOST_KEPT = 4096


class Histories:
    """Contexts by number: each is as many of the last words, oldest first, as the model can use, at most `order`-1.

    Number 0 is the empty context; those in `useless` are a word that the model cannot use. Without a model (`scorer` is
    None) every word has log10 p `otherwise`.
    """

    def __init__(self, scorer: Scorer | None, order: int, otherwise: float = 0.0) -> None:
        self.scorer, self.order, self.otherwise = scorer, order, otherwise
        self.contexts: list[tuple[int, ...]] = [()]
        self.numbers: dict[tuple[int, ...], int] = {(): 0}
        self.useless: set[int] = set()
        self._kept: dict[tuple[bytes, tuple[int, ...], bool], tuple[Singles, Ints]] = {}

    def number(self, context: tuple[int, ...]) -> int:
        """The number of a context."""
        number = self.numbers.setdefault(context, len(self.contexts))
        if number == len(self.contexts):
            self.contexts.append(context)
        return number

    def after(self, contexts: Ints, words: Sequence[int], *, remembered: bool = False) -> tuple[Singles, Ints]:
        """log10 p float32 (A, S) of A words after S contexts, and the numbers of the contexts behind them, (A, S).

        `remembered`: the context behind a word holds at least the word, even if the model cannot use it.
        """
        key = contexts.tobytes(), tuple(words), remembered
        if key not in self._kept:
            if len(self._kept) >= _MOST_KEPT:
                self._kept.clear()
            self._kept[key] = self._asked(contexts.tolist(), words, remembered)
        return self._kept[key]

    def _asked(self, contexts: Sequence[int], words: Sequence[int], remembered: bool) -> tuple[Singles, Ints]:
        rows = [(*self.contexts[context], word) for word in words for context in contexts]
        shape = len(words), len(contexts)
        least = 1 if remembered else 0
        if self.scorer is None or not rows:
            behind = [self.number(row[len(row) - least :]) for row in rows]
            return np.full(shape, self.otherwise, np.float32), np.array(behind, np.int64).reshape(shape)
        # A word more behind each: the context that it has is what the model can use.
        ids = np.array([number for row in rows for number in (*row, 0)], np.int64)
        ends = np.cumsum([len(row) + 1 for row in rows]) - 1
        first = np.zeros(len(ids), bool)
        first[np.append(0, ends[:-1] + 1)] = True
        scored = np.zeros(len(ids), bool)
        scored[ends - 1] = True
        view = self.scorer(TokenSequence(ids, first, scored))
        used = _used(view)[ends].tolist()
        behind = [self.number(row[len(row) - max(length, least) :]) for row, length in zip(rows, used, strict=True)]
        self.useless.update(context for context, length in zip(behind, used, strict=True) if not length)
        return view.score().log10_p[ends - 1].reshape(shape), np.array(behind, np.int64).reshape(shape)


def _used(view: View) -> Ints:
    """How many words before each word the model or any of its parts can use, int64 (T,)."""
    if isinstance(view, SimpleClasses):
        return _used(view.view)
    views = view.views if isinstance(view, Mixture) else [view]
    lengths = [part.contexts.lengths for part in views if isinstance(part, ModelView)]
    longest: Ints = np.max(lengths, axis=0)
    return longest
