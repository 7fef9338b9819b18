"""Whatever gives words a probability in `ngram`: a model, several, a cache, and the exceptions around them.

Words are SRILM's numbers here. What is printed about each word (`[2gram]` and the like) is section 10.3 of our SRILM
specification.
"""

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.lm.score import Contexts, ScoreTables, TokenSequence, joint_log10_p
from placerec.srilm.text.vocabulary import WordList

Tag = Callable[[int], str]


class Scored(NamedTuple):
    """log10 p float32 (T,) of words in their places, and what is printed before the probability of word t."""

    log10_p: Singles
    tag: Tag


class View(Protocol):
    """A token sequence, read by a scorer."""

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of `words` (T,) in their places."""

    def distribution(self, t: int) -> Singles:
        """log10 p float32 of every word, by SRILM's number, in the place of word `t`."""


class Sighted(View, Protocol):
    """A view of which it is known how far each word looks back."""

    @property
    def used(self) -> Ints:
        """How many words before each word count for it, int64 (T,)."""


# Something that gives words a probability: reads a token sequence.
Scorer = Callable[[TokenSequence], View]
SightedScorer = Callable[[TokenSequence], Sighted]


def event_mask(words: WordList) -> Mask:
    """bool by SRILM's number: the words that can be predicted."""
    silent = words.non_events
    return np.array([word is not None and word not in silent for word in words.words], bool)


def event_numbers(words: WordList) -> Ints:
    """The numbers of the words that can be predicted, one for each of their names."""
    events = event_mask(words)
    return np.array([number for number in words.index.values() if events[number]], np.int64)


class Null:
    """Probability 1 for every word (-null)."""

    def __init__(self, words: WordList, sequence: TokenSequence) -> None:
        self.words, self.sequence = words, sequence

    def score(self, words: Ints | None = None) -> Scored:
        """Always log 1."""
        return Scored(np.zeros(len(self.sequence.ids), np.float32), lambda t: "")

    def distribution(self, t: int) -> Singles:
        """Always log 1."""
        return np.zeros(len(self.words.words), np.float32)


class Model:
    """A back-off model, whose tables are made when they are first needed; its word numbers are those of `words`.

    `skipping`: probability 0 for unknown words and so many words behind them (-skipoovs); None: as the model says.
    """

    def __init__(self, make_tables: Callable[[], ScoreTables], words: WordList, skipping: int | None = None) -> None:
        self._make_tables, self.words, self.skipping = make_tables, words, skipping

    @cached_property
    def tables(self) -> ScoreTables:
        return self._make_tables()

    def __call__(self, sequence: TokenSequence) -> "ModelView":
        return ModelView(self, sequence)


class ModelView:
    """A token sequence, read by a Model."""

    def __init__(self, model: Model, sequence: TokenSequence) -> None:
        self.model, self.tables, self.sequence = model, model.tables, sequence
        self.digits = self.tables.digits(sequence.ids)
        self.contexts = Contexts(self.tables, self.digits, np.flatnonzero(sequence.first))
        self.unknown = model.words.index[model.words.unknown]
        self.tags = ["[OOV]", *(f"[{n}gram]" for n in range(1, len(self.tables.tables) + 1))]

    @property
    def used(self) -> Ints:
        """How many words before each word the model can use, int64 (T,)."""
        return self.contexts.lengths

    @cached_property
    def near(self) -> Mask:
        """The words that are skipped because of an unknown one before them, bool (T,)."""
        near = np.zeros(len(self.digits), bool)
        place, unknown = self.sequence.place, self.sequence.ids == self.unknown
        for back in range(1, (self.model.skipping or 0) + 1):
            near[back:] |= unknown[:-back] & (place[back:] >= back)
        return near

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        digits = self.digits if words is None else self.tables.digits(words)
        log10_p, answered = self.tables.find(self.contexts, digits)
        if self.model.skipping is None:
            return Scored(log10_p, lambda t: self.tags[answered[t]])
        skipped = self.near | ((self.sequence.ids if words is None else words) == self.unknown)
        log10_p[skipped] = -np.inf
        return Scored(log10_p, lambda t: "" if skipped[t] else self.tags[answered[t]])

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        log10_p, later = self.tables.distribution(self.contexts, t), len(self.model.words.words) - self.tables.V
        if later:
            log10_p = np.append(log10_p, np.full(later, -np.inf, np.float32))
        if self.model.skipping is not None:
            log10_p[slice(None) if self.near[t] else self.unknown] = -np.inf
        return log10_p

    def joint(self, length: int) -> Singles:
        """log10 of the joint probability of the last `length` words before each word, float32 (T,)."""
        words, silent = self.model.words, ~event_mask(self.model.words)[self.sequence.ids]
        return joint_log10_p(self.tables, self.sequence, length, silent, start=words.start, end=words.end)
