"""The fields of many lines at once, and the numbers of the words among them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from placerec.lm.trie import Ints

Packed = NDArray[np.uint64]
LONGEST_NAME = 16
PADDING = b"\n" * 24
_UNUSUAL = (b"\0", b"\v", b"\f", b"\n##")
_BYTES = np.array([(1 << 8 * size) - 1 for size in range(9)], np.uint64)


def unusual(data: bytes) -> bool:
    """Whether lines hold bytes that have a meaning of their own (NUL, VT, FF) or comments: they go line by line."""
    return data.startswith(b"##") or any(text in data for text in _UNUSUAL)


@dataclass(frozen=True)
class Fields:
    """The fields of a block of lines: where they start and how long they are, (f,); `data` is padded."""

    data: bytes = field(repr=False)
    starts: Ints
    lengths: Ints

    def text(self, at: int) -> bytes:
        """Field number `at`."""
        start = int(self.starts[at])
        return self.data[start : start + int(self.lengths[at])]

    def packed(self, at: Ints) -> tuple[Packed, Packed]:
        """The first 16 bytes of the fields `at` as two numbers each."""
        every = np.ndarray((len(self.data) - 7,), "<u8", self.data, strides=(1,))
        start, length = self.starts[at], self.lengths[at]
        low = every[start] & _BYTES[np.minimum(length, 8)]
        high = every[start + 8] & _BYTES[np.clip(length - 8, 0, 8)]
        return low, high


def split_lines(data: bytes, size: int) -> tuple[Fields, Ints]:
    """The fields of whole lines, separated by blanks, tabs and line ends, and how many there are in each line.

    `data`: the lines, `size` bytes, and PADDING behind them.
    """
    buffer = np.frombuffer(data, np.uint8, size + 1)
    blank = (buffer == 32) | (buffer == 9) | (buffer == 10) | (buffer == 13)
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    if not blank[0]:
        edges = np.concatenate([[0], edges])
    starts, stops = edges[::2], edges[1::2]
    line_ends = np.flatnonzero(buffer == 10)
    through = np.searchsorted(starts, line_ends)
    return Fields(data, starts, stops - starts), np.diff(through, prepend=0)


class NameTable:
    """Word numbers by name, for many names at once: a table of hashed names of up to 16 bytes, the rest one by one."""

    def __init__(self, index: Mapping[str, int]) -> None:
        self.index = index
        self.size = len(index)
        short = [(name.encode("latin-1"), number) for name, number in index.items() if len(name) <= LONGEST_NAME]
        packed = np.array([name for name, _ in short], "S16").view(np.uint64).reshape(-1, 2)
        self.table = _HashedNames(
            packed[:, 0].copy(), packed[:, 1].copy(), np.array([number for _, number in short], np.int64)
        )

    def find(self, fields: Fields, at: Ints) -> Ints:
        """The numbers of the fields `at` (m,), -1 for a name that is not listed."""
        if not len(at):
            return np.zeros(0, np.int64)
        number = self.table.find(*fields.packed(at))
        for i in np.flatnonzero(fields.lengths[at] > LONGEST_NAME).tolist():
            number[i] = self.index.get(fields.text(int(at[i])).decode("latin-1"), -1)
        return number


class _HashedNames:
    """Numbers (m,) by names of 16 bytes, as two numbers each."""

    def __init__(self, low: Packed, high: Packed, numbers: Ints) -> None:
        self.low, self.high, self.numbers = low, high, numbers
        bits = max(8, int(8 * len(low)).bit_length())
        self.shift = np.uint64(64 - bits)
        self.slots = np.full(1 << bits, -1, np.int32)
        slot, entry = self._slot(low, high), np.arange(len(low))
        # Of several names for one slot the last is kept; those that lost it go to a table of their own.
        self.slots[slot] = entry
        lost = np.flatnonzero(self.slots[slot] != entry)
        self.contested = np.zeros(1 << bits, bool)
        self.contested[slot[lost]] = True
        self.rest = _HashedNames(low[lost], high[lost], numbers[lost]) if len(lost) else None

    def _slot(self, low: Packed, high: Packed) -> Packed:
        mixed = low * np.uint64(0x9E3779B97F4A7C15) ^ high * np.uint64(0xC2B2AE3D27D4EB4F)
        slot: Packed = (mixed ^ mixed >> np.uint64(29)) * np.uint64(0xBF58476D1CE4E5B9) >> self.shift
        return slot

    def find(self, low: Packed, high: Packed) -> Ints:
        """The number of each name, -1 where it is not listed."""
        slot = self._slot(low, high)
        entry = self.slots[slot]
        number = self.numbers[entry]
        missed = np.flatnonzero((self.low[entry] != low) | (self.high[entry] != high))
        number[missed] = -1
        if self.rest is not None:
            missed = missed[self.contested[slot[missed]]]
            number[missed] = self.rest.find(low[missed], high[missed])
        return number
