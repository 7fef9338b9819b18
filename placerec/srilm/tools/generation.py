"""`ngram -gen`: sentences drawn from a model, SRILM's for the same -seed (section 11.7 of our SRILM specification)."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.lm.logs import p_of, shown
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import Scorer, event_mask
from placerec.srilm.order.hashing import name_order
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList

# Words of a sentence, if its end is not drawn before.
LONGEST = 50000
# Of the distributions that were used last, so many probabilities are kept.
_NUMBERS = 1 << 21


def drand48(seed: int) -> Iterator[float]:
    """The C library's random numbers in 0..1 (srand48, drand48)."""
    state = ((seed & 0xFFFFFFFF) << 16) + 0x330E
    while True:
        state = (0x5DEECE66D * state + 0xB) % 2**48
        yield state / 2**48


class Generator:
    """Draws sentences from a scorer; `numbers` gives a random number in 0..1 for each word.

    The word drawn is the first, in the order of SRILM's vocabulary, at which the sum of probabilities exceeds the
    number; the last one where none does. `order`: that of the longest n-gram used. With `debug` 2, words that are
    never predicted are reported where they have a probability.
    """

    def __init__(
        self, scorer: Scorer, words: WordList, numbers: Iterator[float], streams: Streams, *, order: int, debug: int
    ) -> None:
        self.scorer, self.words, self.numbers, self.order = scorer, words, numbers, order
        self.streams, self.debug = streams, debug
        names = [*words.index]
        self.enumerated: Ints = np.array([words.index[names[i]] for i in name_order(names).tolist()], np.int64)
        self.events = event_mask(words)[self.enumerated]
        self._kept = lru_cache(max(1, _NUMBERS // len(names)))(self._distribution)

    def sentence(self, prefix: Sequence[int], *, longest: int = LONGEST) -> list[int]:
        """The words, by number, drawn behind a prefix until </s> is (left out), or none can be."""
        drawn: list[int] = []
        while len(drawn) < longest:
            word = self.word([*prefix, *drawn])
            if word in (self.words.end, -1):
                break
            drawn.append(word)
        return drawn

    def _distribution(self, history: tuple[int, ...]) -> tuple[Floats, Floats]:
        """p of names (N,) in the order of SRILM's vocabulary, and sums (N,) of those of words that are predicted."""
        ids = np.array([*history, self.enumerated[0]], np.int64)
        place = np.arange(len(ids))
        view = self.scorer(TokenSequence(ids, place == 0, place == len(ids) - 1))
        p = p_of(view.distribution(len(ids) - 1)[self.enumerated])
        return p, np.cumsum(np.where(self.events, p, 0))

    def word(self, history: Sequence[int]) -> int:
        """A word drawn after a history; -1 where every word has probability 0."""
        p, cumulative = self._kept(tuple(history[max(0, len(history) - self.order + 1) :]))
        if not cumulative[-1] > 0:
            return -1
        chosen = int(np.searchsorted(cumulative, next(self.numbers), side="right"))
        if chosen == len(p):
            chosen = int(np.flatnonzero(self.events & (p > 0))[-1])
        if self.debug >= 2:
            for at in np.flatnonzero(~self.events[:chosen] & (p[:chosen] > 0)).tolist():
                name = self.words.words[int(self.enumerated[at])]
                self.streams.say(f"nonword {name} has nonzero probability {shown(float(p[at]))}")
        return int(self.enumerated[chosen])


def print_sentences(generator: Generator, count: int, prefixes: Sequence[Sequence[str]], start: int | None) -> None:
    """`count` sentences behind each prefix; `start`: the number of <s>, which opens sentences; None: nothing does."""
    for prefix in prefixes:
        known = [generator.words.known(word) for word in prefix]
        opening = [] if start is None or known[:1] == [start] else [start]
        for _ in range(count):
            drawn = [str(generator.words.words[number]) for number in generator.sentence([*opening, *known])]
            generator.streams.print(" ".join([*prefix, *drawn]) + "\n")
