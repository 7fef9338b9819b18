"""P(z_t | z_{t-n:t-1}, c) of eq. 1: how probable each word is in each place, for a whole sequence or word by word."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError
from placerec.lm import BackoffModel
from placerec.lm.external import Scorer

MARKERS = frozenset({"<s>", "</s>", "<unk>"})


class Emissions(Protocol):
    """What the filter asks of the models of C places; `lm.union.ModelUnion` is one."""

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of each of T words in each place, after the words before it."""

    def follow(self) -> Callable[[str], Sequence[float]]:
        """A function that gives the same for one word of a sequence after the other, in constant memory."""


class SeparateEmissions:
    """Emissions of one scorer per place, such as KenLM's; `order` is the highest of their models."""

    def __init__(self, scorers: Sequence[Scorer], order: int) -> None:
        self._scorers = scorers
        self._order = order

    def score(self, words: Sequence[str]) -> Floats:
        """As `Emissions` has it."""
        return np.stack([score(words) for score in self._scorers], axis=1)

    def follow(self) -> Callable[[str], Sequence[float]]:
        """As `Emissions` has it."""
        recent: deque[str] = deque(maxlen=self._order)

        def score(word: str) -> list[float]:
            recent.append(word)
            return [float(score([*recent])[-1]) for score in self._scorers]

        return score


def common_words(models: Mapping[str, BackoffModel]) -> frozenset[str]:
    """The words that the models of all places list, markers apart; ModelError if they do not list the same."""
    (first, model), *others = models.items()
    words = set(model.words) - MARKERS
    for place, other in others:
        differ = words ^ (set(other.words) - MARKERS)
        if differ:
            word = min(differ)
            have, lack = (first, place) if word in words else (place, first)
            raise ModelError(
                f"the model of {have!r} lists the word {word!r} and that of {lack!r} does not; "
                "a word that one place lacks would decide for another: train them on one vocabulary"
            )
    return frozenset(words)
