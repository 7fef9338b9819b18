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
