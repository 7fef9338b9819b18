"""The fields of many lines at once, and the numbers of the words among them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints
from placerec.lm.row_index import RowIndex

Packed = NDArray[np.uint64]
SHORT_NAME, LONGEST_NAME = 8, 16
_PADDING = bytes(24)
_ODD_BYTES = (b"\0", b"\v", b"\f")
_TAB, _LINE_END, _RETURN, _BLANK = b"\t\n\r "
_COMMENT = np.uint64(int.from_bytes(b"##", "little"))
# What no name's bytes are: none of these is 0.
_HOLE = np.uint64(0)
_TWO_BYTES = np.uint64(0xFFFF)
# The bytes of a number that a field of so many bytes fills.
_FILLED = np.array([(1 << 8 * size) - 1 for size in range(SHORT_NAME + 1)], np.uint64)


def with_odd_bytes(data: bytes) -> bool:
    """Whether lines hold bytes that have a meaning of their own: NUL, VT, FF."""
    return any(odd in data for odd in _ODD_BYTES)


def unusual(data: bytes) -> bool:
    """Whether lines hold such bytes, or comments: they go line by line."""
    # One byte is found much faster than several.
    return with_odd_bytes(data) or (b"#" in data and (data.startswith(b"##") or b"\n##" in data))


def usual_blocks(
    blocks: Iterable[bytes], is_unusual: Callable[[bytes], bool], unusual_one: list[bytes]
) -> Iterator[bytes]:
    """The blocks before the first unusual one, which is handed back, each with a line end."""
    for block in blocks:
        if is_unusual(block):
            unusual_one.append(block)
            return
        yield block if block.endswith(b"\n") else block + b"\n"


class Fields:
    """The fields of whole lines, `data`: where they start and how long they are, (f,)."""

    def __init__(self, data: bytes, starts: Ints, lengths: Ints) -> None:
        self.data, self.starts, self.lengths = data, starts, lengths

    def text(self, at: int) -> bytes:
        """Field number `at`."""
        start = int(self.starts[at])
        return self.data[start : start + int(self.lengths[at])]

    @cached_property
    def eights(self) -> Packed:
        """Eight bytes from every place on as one number, uint64; behind the end are zeros."""
        inside = max(0, len(self.data) - 7)
        end = self.data[inside:] + _PADDING
        # Copied, as it is aligned then: that pays where most places are asked for.
        return np.concatenate([_eights(self.data, inside), _eights(end, len(end) - 7)])

    def packed(self, at: Ints) -> tuple[Packed, Packed]:
        """The first 16 bytes of the fields `at` as two numbers each."""
        start, length = self.starts[at], self.lengths[at]
        low = self.eights[start] & _FILLED[np.minimum(length, SHORT_NAME)]
        high = self.eights[start + SHORT_NAME] & _FILLED[np.clip(length - SHORT_NAME, 0, SHORT_NAME)]
        return low, high


def _eights(data: bytes, places: int) -> Packed:
    return np.ndarray((places,), "<u8", data, strides=(1,))


def split_lines(data: bytes) -> tuple[Fields, Ints]:
    """The fields of whole lines, separated by blanks, tabs and line ends, and how many there are in each line."""
    if data and data[-1] != _LINE_END:
        data += b"\n"
    buffer = np.frombuffer(data, np.uint8)
    at = np.flatnonzero(buffer <= _BLANK)
    return _single_blanks(data, at, buffer[at]) or _any_blanks(data, buffer)


def _single_blanks(data: bytes, at: Ints, kind: NDArray[np.uint8]) -> tuple[Fields, Ints] | None:
    """The same where one separator stands behind every field, as programs write lines; `kind` (f,) `at` places (f,)."""
    starts = np.empty_like(at)
    starts[:1] = 0
    np.add(at[:-1], 1, out=starts[1:])
    lengths = np.subtract(at, starts, out=at)
    line_end = kind == _LINE_END
    if not lengths.min(initial=1) or not (line_end | (kind == _BLANK) | (kind == _TAB)).all():
        return None
    return Fields(data, starts, lengths), np.diff(np.flatnonzero(line_end), prepend=-1)


def _any_blanks(data: bytes, buffer: NDArray[np.uint8]) -> tuple[Fields, Ints]:
    line_end = buffer == _LINE_END
    blank = np.ones(len(buffer) + 1, bool)
    blank[1:] = line_end | (buffer == _BLANK) | (buffer == _TAB) | (buffer == _RETURN)
    edges = np.flatnonzero(blank[1:] != blank[:-1])
    starts, stops = edges[::2], edges[1::2]
    through = np.searchsorted(starts, np.flatnonzero(line_end))
    return Fields(data, starts, stops - starts), np.diff(through, prepend=0)


def without_comments(fields: Fields, count: Ints) -> tuple[Fields, Ints]:
    """The same without the fields of lines that start with ##."""
    begin = (np.cumsum(count) - count)[count > 0]
    start = fields.starts[begin]
    comment = fields.eights[start] & _TWO_BYTES == _COMMENT
    if not comment.any():
        return fields, count
    buffer = np.frombuffer(fields.data, np.uint8)
    comment &= (start == 0) | (buffer[start - 1] == _LINE_END)
    commented = np.zeros(len(count), bool)
    commented[count > 0] = comment
    kept = ~np.repeat(commented, count)
    return Fields(fields.data, fields.starts[kept], fields.lengths[kept]), np.where(commented, 0, count)


class NameTable:
    """Word numbers by name, for many names at once: those of up to 8 or 16 bytes as one or two numbers."""

    def __init__(self, index: Mapping[str, int]) -> None:
        self.index = index
        self.size = len(index)
        packed = np.array([name.encode("latin-1") for name in index], f"S{LONGEST_NAME}").view("<u8").reshape(-1, 2)
        length = np.fromiter(map(len, index), np.int64, self.size)
        numbers = np.fromiter(index.values(), np.int64, self.size)
        # Longer names leave a hole, so that in most lists a name's place is its number.
        self.short = RowIndex(np.where(length <= SHORT_NAME, packed[:, 0], _HOLE).view(np.int64))
        self.short_numbers = None if (numbers == np.arange(self.size)).all() else np.append(numbers, -1)
        long = (length > SHORT_NAME) & (length <= LONGEST_NAME)
        self.halves = RowIndex(packed[long].ravel().view(np.int64))
        self.long = RowIndex(self._pairs(packed[long, 0], packed[long, 1]))
        # At the end, what is found for a name that is not listed.
        self.long_numbers = np.append(numbers[long], -1)

    def find(self, fields: Fields, at: Ints | slice) -> Ints:
        """The numbers of the fields `at` (m,), -1 for a name that is not listed."""
        start, length = fields.starts[at], fields.lengths[at]
        # Of a longer name this is the start.
        name = fields.eights.take(start)
        name &= _FILLED.take(length, mode="clip")
        number = self.short.find(name.view(np.int64))
        if self.short_numbers is not None:
            number = self.short_numbers.take(number, mode="wrap")
        if length.max(initial=0) > SHORT_NAME:
            long = np.flatnonzero(length > SHORT_NAME)
            number[long] = self._find_long(fields, np.arange(len(fields.starts))[at][long])
        return number

    def _find_long(self, fields: Fields, at: Ints) -> Ints:
        number = self.long_numbers[self.long.find(self._pairs(*fields.packed(at)))]
        for i in np.flatnonzero(fields.lengths[at] > LONGEST_NAME).tolist():
            number[i] = self.index.get(fields.text(int(at[i])).decode("latin-1"), -1)
        return number

    def _pairs(self, low: Packed, high: Packed) -> Ints:
        """One number for two halves of names; one that is no name's if either is none's."""
        first, second = self.halves.find(low.view(np.int64)), self.halves.find(high.view(np.int64))
        return np.where(first < 0, -1, (first << np.int64(32)) + second + 1)
