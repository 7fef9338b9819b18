"""The fields of many lines at once, and the numbers of the words among them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask
from placerec.lm.row_index import RowIndex

Packed = NDArray[np.uint64]
_EIGHT = 8
# Names of so many bytes are compared as numbers; longer ones are left to a dictionary.
LONGEST_NAME = 64
_PADDING = bytes(LONGEST_NAME + _EIGHT)
_ODD_BYTES = (b"\0", b"\v", b"\f")
_TAB, _LINE_END, _RETURN, _BLANK = b"\t\n\r "
_COMMENT = np.uint64(int.from_bytes(b"##", "little"))
# What no name's bytes are: none of these is 0.
_HOLE = np.uint64(0)
_TWO_BYTES = np.uint64(0xFFFF)
# The bytes of a number that a field of so many bytes fills.
FILLED = np.array([(1 << 8 * size) - 1 for size in range(_EIGHT + 1)], np.uint64)
_SPREAD = np.array([0x9E3779B97F4A7C15 * (2 * i + 1) % 2**64 for i in range(LONGEST_NAME // _EIGHT)], np.uint64)


def with_odd_bytes(data: bytes) -> bool:
    """Whether lines hold bytes that have a meaning of their own: NUL, VT, FF."""
    return any(odd in data for odd in _ODD_BYTES)


def usual_blocks(blocks: Iterable[bytes], odd_one: list[bytes]) -> Iterator[bytes]:
    """The blocks before the first one with odd bytes, which is handed back."""
    for block in blocks:
        if with_odd_bytes(block):
            odd_one.append(block)
            return
        yield block


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

    def packed(self, at: Ints, numbers: int) -> list[Packed]:
        """The first bytes of the fields `at` as so many numbers each, eight bytes in a number."""
        start, length = self.starts[at], self.lengths[at]
        return [
            self.eights[start + place] & FILLED[np.clip(length - place, 0, _EIGHT)]
            for place in range(0, _EIGHT * numbers, _EIGHT)
        ]


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
    """The fields of lines, and how many in each, if one separator stands behind every field, as programs write them.

    `at`, `kind` (f,): the places of all separators, and which bytes they are. None if some field is empty.
    """
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


def comments(fields: Fields, count: Ints) -> Mask:
    """Which of the lines, with `count` fields each, start with ##: bool (l,)."""
    commented = np.zeros(len(count), bool)
    begin = (np.cumsum(count) - count)[count > 0]
    start = fields.starts[begin]
    comment = fields.eights[start] & _TWO_BYTES == _COMMENT
    if comment.any():
        comment &= (start == 0) | (np.frombuffer(fields.data, np.uint8)[start - 1] == _LINE_END)
        commented[count > 0] = comment
    return commented


def without_lines(fields: Fields, count: Ints, left_out: Mask) -> tuple[Fields, Ints]:
    """The fields of the lines that are not left out, and how many there are in each line, 0 where it is left out."""
    if not left_out.any():
        return fields, count
    kept = ~np.repeat(left_out, count)
    return Fields(fields.data, fields.starts[kept], fields.lengths[kept]), np.where(left_out, 0, count)


class NameTable:
    """Word numbers by name, for many names at once: those of up to LONGEST_NAME bytes as numbers of eight bytes."""

    def __init__(self, index: Mapping[str, int]) -> None:
        self.index = index
        self.size = len(index)
        names = [name.encode("latin-1") for name in index]
        length = np.fromiter(map(len, names), np.int64, self.size)
        numbers = np.fromiter(index.values(), np.int64, self.size)
        first = np.array(names, f"S{_EIGHT}").view("<u8")
        # Longer names leave a hole, so that in most lists a name's place is its number.
        self.short = RowIndex(np.where(length <= _EIGHT, first, _HOLE).view(np.int64))
        self.short_numbers = None if (numbers == np.arange(self.size)).all() else np.append(numbers, -1)
        long = np.flatnonzero((length > _EIGHT) & (length <= LONGEST_NAME))
        self.width = max(1, -(-int(length[long].max(initial=0)) // _EIGHT))
        # At the end, what is found for a name that is not listed.
        packed = np.array([*(names[i] for i in long.tolist()), b""], f"S{_EIGHT * self.width}")
        self.long_names = list(packed.view("<u8").reshape(-1, self.width).T.copy())
        self.long_numbers = np.append(numbers[long], -1)
        self.long = RowIndex(_mixed(self.long_names))

    def find(self, fields: Fields, at: Ints | slice) -> Ints:
        """The numbers of the fields `at` (m,), -1 for a name that is not listed."""
        start, length = fields.starts[at], fields.lengths[at]
        # Of a longer name this is the start.
        name = fields.eights.take(start)
        name &= FILLED.take(length, mode="clip")
        number = self.short.find(name.view(np.int64))
        if self.short_numbers is not None:
            number = self.short_numbers.take(number, mode="wrap")
        if length.max(initial=0) > _EIGHT:
            long = np.flatnonzero(length > _EIGHT)
            number[long] = self._find_long(fields, np.arange(len(fields.starts))[at][long])
        return number

    def _find_long(self, fields: Fields, at: Ints) -> Ints:
        length = fields.lengths[at]
        wanted = fields.packed(at, self.width)
        place = self.long.find(_mixed(wanted))
        place[length > _EIGHT * self.width] = -1
        same = place >= 0
        for names, name in zip(self.long_names, wanted, strict=True):
            same &= names[place] == name
        number = np.where(same, self.long_numbers[place], -1)
        # What differs from the name found may be another one with the same mixture.
        for i in np.flatnonzero((same != (place >= 0)) | (length > LONGEST_NAME)).tolist():
            number[i] = self.index.get(fields.text(int(at[i])).decode("latin-1"), -1)
        return number


def _mixed(columns: Sequence[Packed]) -> Ints:
    """One number for the numbers of each name: rarely that of another name."""
    mixed = columns[0] * _SPREAD[0]
    for column, spread in zip(columns[1:], _SPREAD[1:], strict=False):
        mixed += column * spread
    numbers: Ints = mixed.view(np.int64)
    return numbers


def _every_byte(value: int) -> np.uint64:
    return np.uint64(value * 0x0101010101010101)


_ZEROS = _every_byte(ord("0"))
_BEHIND_NINE, _HIGH_BITS = _every_byte(0x80 - 10), _every_byte(0x80)
_EVERY_FOURTH = np.uint64(0x000000FF000000FF)
_HUNDREDS, _MILLIONS = np.uint64((1000000 << 32) + 100), np.uint64((10000 << 32) + 1)


def eight_digits(text: Packed, filled: Packed) -> tuple[Packed, Mask]:
    """The numbers that eight bytes spell, zeros behind what is `filled`; and whether these are digits."""
    digit = text ^ _ZEROS
    digit &= filled
    plain = (digit | digit + _BEHIND_NINE) & _HIGH_BITS == 0
    # Pairs of digits, then fours, then all eight at once.
    pairs = digit * np.uint64(10) + (digit >> np.uint64(8))
    number = (pairs & _EVERY_FOURTH) * _HUNDREDS + (pairs >> np.uint64(16) & _EVERY_FOURTH) * _MILLIONS
    number >>= np.uint64(32)
    return number, plain
