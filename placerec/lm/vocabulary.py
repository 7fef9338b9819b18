"""Words by number in the order of their code points, and the words that are not words: the markers."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Ints, Mask

# Where sentences begin and end, and whatever is not in the vocabulary.
SENTENCE_START, SENTENCE_END, UNKNOWN = "<s>", "</s>", "<unk>"


@dataclass(frozen=True)
class Vocabulary:
    """Words in code-point order; a word's number is its place in the order."""

    words: tuple[str, ...]
    index: dict[str, int] = field(repr=False)

    @staticmethod
    def of(words: Iterable[str]) -> "Vocabulary":
        """The vocabulary of the distinct `words`."""
        ordered = tuple(sorted(set(words)))
        return Vocabulary(ordered, {word: number for number, word in enumerate(ordered)})

    def __repr__(self) -> str:
        return f"Vocabulary({len(self)} words)"

    def __len__(self) -> int:
        return len(self.words)

    def ids(self, words: Sequence[str]) -> Ints:
        """Word numbers int64 (T,) of T words, -1 for a word that is not listed."""
        return np.fromiter((self.index.get(word, -1) for word in words), np.int64, len(words))

    def mask(self, words: Iterable[str]) -> Mask:
        """bool (V,), true at those of `words` that are listed."""
        mask = np.zeros(len(self), bool)
        mask[[self.index[word] for word in words if word in self.index]] = True
        return mask


def find_markers(numbers: Ints, lengths: Ints, start: int, end: int) -> tuple[Mask, Mask]:
    """Which sentences of word numbers (T,) and lengths (S,) begin with `start`, and which end with `end`: bool (S,)."""
    stops = np.cumsum(lengths)
    some = lengths > 0
    opened, ended = np.zeros(len(lengths), bool), np.zeros(len(lengths), bool)
    opened[some] = numbers[(stops - lengths)[some]] == start
    ended[some] = numbers[(stops - 1)[some]] == end
    return opened, ended


def add_markers(numbers: Ints, lengths: Ints, start: int, end: int, before: Mask, after: Mask) -> tuple[Ints, Ints]:
    """Word numbers and lengths of sentences with `start` put before some, and `end` behind some.

    `before`, `after`: which sentences, bool (S,).
    """
    if not (before | after).any():
        return numbers, lengths
    whole = lengths + before + after
    stops = np.cumsum(whole)
    marked = np.empty(int(whole.sum()), np.int64)
    first, last = (stops - whole)[before], (stops - 1)[after]
    given = np.ones(len(marked), bool)
    given[first] = given[last] = False
    marked[given] = numbers
    marked[first], marked[last] = start, end
    return marked, whole
