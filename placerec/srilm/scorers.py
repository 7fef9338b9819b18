"""Whatever gives words a probability in `ngram`: a model, several, a cache, and the exceptions around them.

Words are SRILM's numbers here. What is printed about each word (`[2gram]` and the like) is section 10.3 of our SRILM
specification.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.lm.lookup import Lookup
from placerec.lm.markers import SENTENCE_END, SENTENCE_START
from placerec.lm.passage import Passage, answers, joint, look_up, look_up_others, read_passage, spread
from placerec.srilm.vocabulary import WordList

if TYPE_CHECKING:
    from placerec.lm.draft import Draft

Tag = Callable[[int], str]


class Scored(NamedTuple):
    """log10 p float32 (T,) of words in their places, and what is printed before the probability of word t."""

    log10_p: Singles
    tag: Tag


class View(Protocol):
    """A passage, read by a scorer."""

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the passage's words, or of `words` (T,) in their places."""

    def spread(self, t: int) -> Singles:
        """log10 p float32 of every word, by SRILM's number, in the place of word `t`."""


class Scorer(Protocol):
    """Something that gives words a probability."""

    def view(self, passage: Passage) -> View:
        """Read a passage."""


def event_mask(words: WordList) -> Mask:
    """bool by SRILM's number: the words that can be predicted."""
    silent = words.non_events
    return np.array([word is not None and word not in silent for word in words.words], bool)


def event_numbers(words: WordList) -> Ints:
    """The numbers of the words that can be predicted, one for each of their names."""
    events = event_mask(words)
    return np.array([number for number in words.index.values() if events[number]], np.int64)


class Null(NamedTuple):
    """Probability 1 for every word (-null)."""

    words: WordList

    def view(self, passage: Passage) -> "NullView":
        """Read a passage."""
        return NullView(len(passage.ids), len(self.words.words))


class NullView(NamedTuple):
    """A passage of T words, of a vocabulary of V."""

    T: int
    V: int

    def score(self, words: Ints | None = None) -> Scored:
        """Always log 1."""
        return Scored(np.zeros(self.T, np.float32), lambda t: "")

    def spread(self, t: int) -> Singles:
        """Always log 1."""
        return np.zeros(self.V, np.float32)


class LookupModel:
    """A back-off model that was read for scoring only; its word numbers are those of `words`."""

    def __init__(self, lookup: Lookup, words: WordList) -> None:
        self.lookup, self.words = lookup, words

    def view(self, passage: Passage) -> "LookupView":
        """Read a passage."""
        return LookupView(self, passage)


class LookupView:
    """A passage, read by a LookupModel."""

    def __init__(self, model: LookupModel, passage: Passage) -> None:
        self.model, self.lookup = model, model.lookup
        self.digits = self.lookup.digits(passage.ids)
        self.contexts = self.lookup.contexts(self.digits, np.flatnonzero(passage.first))

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the passage's words, or of others in their places."""
        digits = self.digits if words is None else self.lookup.digits(words)
        log10_p, answered = self.lookup.find(self.contexts, digits)
        tags = ["[OOV]", *(f"[{n}gram]" for n in range(1, len(self.lookup.tables) + 1))]
        return Scored(log10_p, lambda t: tags[answered[t]])

    def spread(self, t: int) -> Singles:
        """log10 p of every word."""
        every = np.arange(len(self.model.words.words))
        contexts = [np.full(len(every), codes[t]) for codes in self.contexts]
        return self.lookup.find(contexts, self.lookup.digits(every))[0]


class Model:
    """A back-off model. `skipping`: probability 0 for unknown words and the two words behind them (-skipoovs)."""

    def __init__(self, draft: "Draft", words: WordList, *, skipping: bool = False) -> None:
        self.draft, self.words, self.skipping = draft, words, skipping
        self._own = np.zeros(0, np.int64)

    def view(self, passage: Passage) -> "ModelView":
        """Read a passage."""
        return ModelView(self, passage)

    @property
    def own(self) -> Ints:
        """The model's number of each of SRILM's numbers, -1 for what it does not list."""
        if len(self._own) != len(self.words.words):
            index = self.draft.trie.vocabulary.index
            own = [-1 if word is None else index.get(word, -1) for word in self.words.words]
            self._own = np.array(own, np.int64)
        return self._own


class ModelView:
    """A passage, read by a Model."""

    def __init__(self, model: Model, passage: Passage) -> None:
        self.model = model
        self.own = model.own
        self.given = passage.ids
        self.passage = passage._replace(ids=self.own[passage.ids])
        self.reading = read_passage(model.draft, self.passage)
        self.unknown = model.words.index[model.words.unknown]
        self.near = np.zeros(len(passage.ids), bool)
        if model.skipping:
            place, unknown = passage.place, passage.ids == self.unknown
            for back in (1, 2):
                self.near[back:] |= unknown[:-back] & (place[back:] >= back)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the passage's words, or of others in their places."""
        own = None if words is None else self.own[words]
        log10_p = look_up(self.reading) if own is None else look_up_others(self.reading, own)
        skipped = np.zeros(len(log10_p), bool)
        if self.model.skipping:
            skipped = self.near | ((self.passage.ids if own is None else own) == self.own[self.unknown])
            log10_p = np.where(skipped, np.float32(-np.inf), log10_p)
        lengths: list[Ints] = []

        def tag(t: int) -> str:
            if not lengths:
                lengths.append(answers(self.reading, own))
            return "" if skipped[t] else f"[{lengths[0][t]}gram]" if lengths[0][t] else "[OOV]"

        return Scored(log10_p, tag)

    def spread(self, t: int) -> Singles:
        """log10 p of every word."""
        every = spread(self.reading, t)
        log10_p = np.where(self.own >= 0, every[self.own], np.float32(-np.inf))
        if self.model.skipping:
            log10_p[self.unknown] = -np.inf
            log10_p[:] = np.where(self.near[t], np.float32(-np.inf), log10_p)
        return log10_p

    def joint(self, length: int) -> Singles:
        """log10 of the joint probability of the last `length` words before each word, float32 (T,)."""
        index = self.model.draft.trie.vocabulary.index
        start, end = index.get(SENTENCE_START, -2), index.get(SENTENCE_END, -1)
        silent = ~event_mask(self.model.words)[self.given]
        return joint(self.reading, self.passage, length, silent, start=start, end=end)
