"""SRILM's vocabulary: words by number in order of first occurrence; section 3 of our SRILM specification."""

import re
from collections import Counter
from typing import TYPE_CHECKING

from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.srilm.text.numbers import bounded_int
from placerec.srilm.text.streams import SrilmError, Streams, tokens

if TYPE_CHECKING:
    from placerec.arrays import Ints
    from placerec.lm.vocabulary import Vocabulary

PAUSE = "-pau-"


class WordList:
    """Names and their numbers; several names may have one number (aliases), a number may have lost its name.

    `closed`: words that are not listed become the unknown word. `open_unknown`: the unknown word is a regular word
    (-unk). `meta_tag`: words with this start are counts of counts. `missed`: how often the unknown word stood in for a
    word that is not listed. `nameless`: there is a name of a word that lost its own.
    """

    def __init__(self, *, lower: bool = False, open_unknown: bool = False, meta_tag: str | None = None) -> None:
        self.lower, self.closed, self.open_unknown, self.meta_tag = lower, False, open_unknown, meta_tag
        self.unknown = UNKNOWN
        self.missed, self.nameless = 0, False
        self.index: dict[str, int] = {}
        self.words: list[str | None] = []
        for word in (UNKNOWN, SENTENCE_START, SENTENCE_END, PAUSE):
            self.add(word)
        self.silent = {SENTENCE_START, PAUSE}

    @property
    def start(self) -> int:
        """The number of <s>; -1 where an alias has taken that name."""
        return self._marker(SENTENCE_START)

    @property
    def end(self) -> int:
        """The number of </s>; -1 where an alias has taken that name."""
        return self._marker(SENTENCE_END)

    def _marker(self, name: str) -> int:
        number = self.index.get(name, -1)
        return number if number >= 0 and self.words[number] == name else -1

    def normal(self, word: str) -> str:
        """`word` in lower case (A to Z only) if that was asked for."""
        return word.translate(_LOWER) if self.lower else word

    def add(self, word: str) -> int:
        """The number of a word, a new one if it is not listed."""
        word = self.normal(word)
        number = self.index.get(word)
        if number is None:
            number = len(self.words)
            self.index[word] = number
            self.words.append(word)
        return number

    def number(self, word: str) -> int:
        """The number of a word of a text or counts file: added if the vocabulary is open, else the unknown word's."""
        closed = self.closed and (self.meta_tag is None or self.occurrences(self.normal(word)) < 0)
        return self.known(word) if closed else self._named(self.add(word), word)

    def known(self, word: str) -> int:
        """The number of a word, the unknown word's if it is not listed."""
        number = self.index.get(self.normal(word))
        if number is None:
            self.missed += 1
            return self.index[self.unknown]
        return self._named(number, word)

    def _named(self, number: int, name: str) -> int:
        if self.words[number] is None:
            raise SrilmError(
                f"{name} is another name of a word that lost its own to an alias: mend the file of aliases"
            )
        return number

    def occurrences(self, word: str) -> int:
        """k for the meta word TAGk, 0 for the tag alone, -1 for an ordinary word."""
        if self.meta_tag is None or not word.startswith(self.meta_tag):
            return -1
        digits = re.match(r"[0-9]*", word[len(self.meta_tag) :])
        return bounded_int(digits[0]) if digits and (digits[0] or word == self.meta_tag) else -1

    @property
    def non_events(self) -> set[str]:
        """The words that never get a probability."""
        return self.silent | (set() if self.open_unknown else {self.unknown})

    def map_unknown(self, word: str) -> None:
        """`word` takes the place of <unk> (-map-unk)."""
        word = self.normal(word)
        old = self.index.pop(self.unknown)
        self.words[old] = None
        self.unknown = word
        self.add(word)

    def alias(self, name: str, word: str) -> None:
        """`name` is another name of `word`; a former word of that name is lost."""
        name = self.normal(name)
        number = self.add(word)
        former = self.index.get(name)
        if former is not None and former != number and self.words[former] == name:
            self.words[former] = None
        self.index[name] = number
        self.nameless = any(self.words[named] is None for named in self.index.values())

    def names(self, vocabulary: "Vocabulary") -> list[int]:
        """How many names each word of the sorted vocabulary has."""
        count = Counter(self.index.values())
        return [count[self.index[word]] for word in vocabulary.words]

    def numbers(self, vocabulary: "Vocabulary") -> "Ints":
        """SRILM's number of each word of the sorted vocabulary, int64 (V,)."""
        import numpy as np

        numbered = {word: number for number, word in enumerate(self.words)}
        return np.array([numbered[word] for word in vocabulary.words], np.int64)

    def sorted(self) -> "tuple[Vocabulary, Ints]":
        """The words in code-point order, and by number here each word's number there, int64 (N,), -1 if lost."""
        from placerec.lm.vocabulary import Vocabulary

        vocabulary = Vocabulary.of(word for word in self.words if word is not None)
        return vocabulary, vocabulary.ids([word or "" for word in self.words])


_LOWER = str.maketrans("ABCDEFGHIJKLMNOPQRSTUVWXYZ", "abcdefghijklmnopqrstuvwxyz")


def read_words(words: WordList, name: str, streams: Streams, *, silent: bool = False) -> None:
    """Add the first word of every line of a file (-vocab); as words without probability if `silent` (-nonevents)."""
    for line in streams.lines(name):
        found = tokens(line)
        if found:
            words.add(found[0])
            if silent:
                words.silent.add(words.normal(found[0]))


def read_aliases(words: WordList, name: str, streams: Streams) -> None:
    """Read lines `alias word` (-vocab-aliases)."""
    lines = streams.lines(name)
    for line in lines:
        match tokens(line):
            case [alias, word, *_]:
                if words.normal(alias) == words.unknown:
                    raise SrilmError(f"{lines.position}{alias} must stay the unknown word; take the line out")
                words.alias(alias, word)
            case [_]:
                streams.say(f"{lines.position}warning: line contains only one token")


def format_words(words: WordList) -> str:
    """All names, one a line, sorted by bytes (-write-vocab)."""
    return "".join(f"{name}\n" for name in sorted(words.index))


def format_indices(words: WordList) -> str:
    """Lines `NUMBER WORD` in number order, and a full stop (-write-vocab-index)."""
    listed = (f"{number} {word}\n" for number, word in enumerate(words.words) if word is not None)
    return "".join(listed) + ".\n"
