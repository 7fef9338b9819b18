"""Words of a text to numbers, a block at a time: cut, packed and looked up as arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints
from placerec.srilm.vocabulary import WordList

Bytes = NDArray[np.uint8]
Keys = NDArray[np.uint64]

_EIGHT = 8
# Words up to 64 bytes are compared as eight numbers of eight bytes; longer ones are left to a dictionary.
LONGEST = 64
_SLOTS = 1 << 20
_WORD, _BLANK, _LINE_END = 0, 1, 2
_KIND = np.zeros(256, np.uint8)
_KIND[[ord(" "), ord("\t"), ord("\r")]] = _BLANK
_KIND[ord("\n")] = _LINE_END
# The low bytes of a number that a word of so many bytes fills.
_FILLED = np.array([(1 << (8 * size)) - 1 for size in range(_EIGHT)] + [2**64 - 1], np.uint64)
_SPREAD = np.array([0x9E3779B97F4A7C15 * (2 * i + 1) % 2**64 for i in range(_EIGHT)], np.uint64)


@dataclass(frozen=True)
class Cut:
    """A text cut into words: where they start and how long they are, and how many each line holds.

    `keys` and `slot`: the words packed, and their places in a table; none if a word is longer than LONGEST.
    """

    data: bytes
    starts: Ints
    sizes: Ints
    per_line: Ints
    keys: list[Keys] | None
    slot: Ints


def cut_words(data: bytes) -> Cut:
    """Cut a text that ends with a line end; what does not depend on the words before is done here."""
    text = np.frombuffer(data + bytes(LONGEST), np.uint8)
    is_word = np.zeros(len(data) + 2, bool)
    np.equal(_KIND[text[: len(data)]], _WORD, out=is_word[1:-1])
    edges = np.flatnonzero(is_word[1:] != is_word[:-1])
    starts, sizes = edges[::2], edges[1::2] - edges[::2]
    line_ends = np.flatnonzero(text[: len(data)] == ord("\n"))
    per_line = np.diff(np.searchsorted(starts, line_ends), prepend=0)
    if len(starts) == 0 or int(sizes.max()) > LONGEST:
        return Cut(data, starts, sizes, per_line, None, np.zeros(0, np.int64))
    keys = _packed(text, starts, sizes)
    return Cut(data, starts, sizes, per_line, keys, _slots(keys))


class Numbering:
    """Numbers the words of texts by a word list, which is asked once for each word, in order of occurrence.

    A table of slots finds words again: `keys` their bytes, packed; `numbers` int64, -1 where a slot is free. A word
    whose slot another one has taken is looked up in `others`.
    """

    def __init__(self, words: WordList) -> None:
        self.words = words
        self.keys: list[Keys] = [np.zeros(_SLOTS, np.uint64)]
        self.numbers = np.full(_SLOTS, -1, np.int64)
        self.others: dict[bytes, int] = {}

    def numbers_of(self, cut: "Cut") -> Ints:
        """The numbers of the words of a cut text, int64 (T,)."""
        if cut.keys is None:
            ends = cut.starts + cut.sizes
            pairs = zip(cut.starts.tolist(), ends.tolist(), strict=True)
            return np.array([self._number(cut.data[start:end]) for start, end in pairs], np.int64)
        while len(self.keys) < len(cut.keys):
            self.keys.append(np.zeros(_SLOTS, np.uint64))
        numbers = self._known(cut.keys, cut.slot)
        strange = np.flatnonzero(numbers < 0)
        if len(strange):
            self._learn(cut.data, strange, cut.starts, cut.starts + cut.sizes, cut.keys, cut.slot, numbers)
        return numbers

    def _known(self, keys: list[Keys], slot: Ints) -> Ints:
        """The numbers of the words that their slots hold, -1 for the others."""
        same = self.keys[0][slot] == keys[0]
        for i in range(1, len(self.keys)):
            same &= self.keys[i][slot] == (keys[i] if i < len(keys) else 0)
        return np.where(same, self.numbers[slot], -1)

    def _learn(
        self, data: bytes, strange: Ints, starts: Ints, ends: Ints, keys: list[Keys], slot: Ints, numbers: Ints
    ) -> None:
        """Number the `strange` words of a block, new ones in order of occurrence, and give them what slots are free."""
        free = strange[self.numbers[slot[strange]] < 0]
        first = np.full(_SLOTS, -1, np.int64)
        # Of several values for one slot the last is kept: reversed, the first.
        first[slot[free[::-1]]] = free[::-1]
        winner = first[slot[free]]
        same = np.all([key[free] == key[winner] for key in keys], axis=0)
        owners = first[first >= 0]
        homeless = np.setdiff1d(strange, free[same], assume_unique=True)
        found = {}
        for i in np.sort(np.concatenate([owners, homeless])).tolist():
            found[i] = self._number(data[starts[i] : ends[i]])
        self.numbers[slot[owners]] = [found[i] for i in owners.tolist()]
        for column, key in zip(self.keys, keys, strict=False):
            column[slot[owners]] = key[owners]
        numbers[free[same]] = self.numbers[slot[free[same]]]
        numbers[homeless] = [found[i] for i in homeless.tolist()]

    def _number(self, word: bytes) -> int:
        number = self.others.get(word)
        if number is None:
            number = self.words.number(word.decode("latin-1"))
            self.others[word] = number
        return number


def _packed(text: Bytes, starts: Ints, sizes: Ints) -> list[Keys]:
    """The bytes of words in numbers of eight, uint64 (T,) each."""
    # Eight bytes from every place on: overlapping, and not aligned.
    windows = np.ndarray((len(text) - _EIGHT + 1,), np.uint64, text, strides=(1,))
    keys = []
    for offset in range(0, int(sizes.max()), _EIGHT):
        key = windows[starts + offset if offset else starts]
        key &= _FILLED[np.clip(sizes - offset, 0, _EIGHT)]
        keys.append(key)
    return keys


def _slots(keys: list[Keys]) -> Ints:
    mixed = keys[0] * _SPREAD[0]
    for key, spread in zip(keys[1:], _SPREAD[1:], strict=False):
        mixed ^= key * spread
    slots: Ints = (mixed >> np.uint64(44)).astype(np.int64)
    return slots
