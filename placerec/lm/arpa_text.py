"""Lines of an ARPA file as arrays of bytes: numbers by their digits, words from a table, a block at a time.

A line is a row of eight-byte cells, filled up with NUL bytes that are dropped in the end. Each field begins with what
separates it from the one before it; so lines begin, and do not end, with a line end.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask, Numbers, Singles
from placerec.lm.logs import LOG_ZERO, shown

Cells = NDArray[np.uint64]
# Words with their blank that are longer than this would make most of a line NUL bytes.
_WIDEST = 32
# Lines made at once: their arrays stay in the processor's cache.
_BLOCK = 1 << 14
_CELL = np.dtype("<u8")
_STARTS = np.array([1e-3, 1e-2, 1e-1, 1, 10])
# By the place of a value among the starts: what makes seven digits an integer, and such integers units of 1e-10.
_SEVEN = np.array([1e10, 1e9, 1e8, 1e7, 1e6, 1e5])
_TO_UNITS = np.array([1e0, 1e1, 1e2, 1e3, 1e4, 1e5])


@dataclass(frozen=True)
class PlainLines:
    """The lines of one order, put together one by one, for whatever words: `contexts` end with a blank."""

    words: Sequence[bytes]
    contexts: Sequence[bytes]

    def blocks(
        self, log10_p: Singles, backoff: Singles, weighted: Mask, before: Ints, word: Numbers
    ) -> Iterator[bytes]:
        """Lines, each after a line end: log10 p (m,), weights (m,) where `weighted` (m,), contexts (m,), words (m,)."""
        for start in range(0, len(word), _BLOCK):
            block = slice(start, start + _BLOCK)
            fields = zip(
                _printed(log10_p[block], "\n"),
                map(self.contexts.__getitem__, before[block].tolist()),
                map(self.words.__getitem__, word[block].tolist()),
                [
                    text * has
                    for text, has in zip(_printed(backoff[block], "\t"), weighted[block].tolist(), strict=True)
                ],
                strict=True,
            )
            yield b"".join(b"%b\t%b%b%b" % line for line in fields)

    def longer(self, before: Ints, word: Numbers) -> "PlainLines":
        """The lines of the next order, whose contexts (c,) are contexts of this one with a word added."""
        texts = zip(before.tolist(), word.tolist(), strict=True)
        return PlainLines(self.words, [b"%b%b " % (self.contexts[row], self.words[number]) for row, number in texts])


@dataclass(frozen=True)
class PackedLines:
    """The lines of one order as rows of cells: `words` (V, k) and `contexts` (c, (n-1) k), a blank before each word."""

    words: Cells
    contexts: Cells

    def blocks(
        self, log10_p: Singles, backoff: Singles, weighted: Mask, before: Ints, word: Numbers
    ) -> Iterator[bytes]:
        """Lines, each after a line end: log10 p (m,), weights (m,) where `weighted` (m,), contexts (m,), words (m,)."""
        split, some_weighted = 2 + self.contexts.shape[1], bool(weighted.any())
        end = split + self.words.shape[1]
        rows = np.empty((min(len(word), _BLOCK), end + 2 * some_weighted), _CELL)
        for start in range(0, len(word), _BLOCK):
            block = slice(start, start + _BLOCK)
            row = rows[: len(word[block])]
            number_cells(log10_p[block], "\n", row[:, :2])
            row[:, 2:split] = self.contexts.take(before[block], axis=0)
            row[:, split:end] = self.words.take(word[block], axis=0)
            # In front of the first word.
            row.view(np.uint8)[:, 16] = ord("\t")
            if some_weighted:
                at = np.flatnonzero(weighted[block])
                cells = np.empty((len(at), 2), _CELL)
                number_cells(backoff[block][at], "\t", cells)
                row[:, end:] = 0
                row[at, end:] = cells
            yield _without_nul(row)

    def longer(self, before: Ints, word: Numbers) -> "PackedLines":
        """The lines of the next order, whose contexts (c,) are contexts of this one with a word added."""
        contexts = np.empty((len(word), self.contexts.shape[1] + self.words.shape[1]), _CELL)
        for start in range(0, len(word), _BLOCK):
            block = slice(start, start + _BLOCK)
            contexts[block, : self.contexts.shape[1]] = self.contexts.take(before[block], axis=0)
            contexts[block, self.contexts.shape[1] :] = self.words.take(word[block], axis=0)
        return PackedLines(self.words, contexts)


def first_lines(words: Sequence[str], encoding: str) -> PlainLines | PackedLines:
    """What makes the lines of order 1, and of the longer ones in turn; plain if a word is very long, or has a NUL."""
    encoded = [word.encode(encoding) for word in words]
    widest = max(map(len, encoded), default=_WIDEST) + 1
    if widest > _WIDEST or b"\0" in b"".join(encoded):
        return PlainLines(encoded, [b""])
    padded = np.array([b" " + word for word in encoded], f"S{-(-widest // _CELL.itemsize) * _CELL.itemsize}")
    return PackedLines(padded.view(_CELL).reshape(len(encoded), -1), np.zeros((1, 0), _CELL))


def _without_nul(cells: Cells) -> bytes:
    """The bytes of rows of cells, without those that fill up."""
    text: NDArray[np.uint8] = cells.reshape(-1).view(np.uint8)
    # Sooner than bytes.translate, where the processor guesses at every end of a word whether it is one.
    return bytes(text.take((text != 0).nonzero()[0], mode="wrap"))


def _printed(values: Singles, lead: str) -> list[bytes]:
    numbers = np.where(np.isneginf(values), LOG_ZERO, values.astype(np.float64)).tolist()
    return [f"{lead}{shown(number, 7)}".encode() for number in numbers]


def number_cells(values: Singles, lead: str, cells: Cells) -> None:
    """Write `lead` and '%.7g' of float32 values (m,) to `cells` (m, 2): LOG_ZERO for -inf.

    Seven digits of a float32 between 1e-4 and 100 times a power of ten are a product that float64 holds exactly, so
    that `rint` rounds as printf does; other values are printed one by one.
    """
    first, rest = _tables(lead)
    exact = values.astype(np.float64)
    exact[exact == -np.inf] = LOG_ZERO
    size = np.abs(exact)
    usual = (size >= 1e-4) & (size < 99.5) | (size == 0)
    unusual = np.flatnonzero(~usual)
    size[unusual] = 0
    above = np.zeros(len(size), np.uint8)
    for start in _STARTS:
        above += size >= start
    place = above.astype(np.intp)
    units = (np.rint(size * _SEVEN[place]) * _TO_UNITS[place]).astype(np.int64)
    high = units // 10**8
    low = (units - high * 10**8).astype(np.int32)
    middle = low // 10**4
    last = low - middle * 10**4
    high += 10**4 * (low == 0)
    high += 2 * 10**4 * np.signbit(exact)
    middle += 10**4 * (last == 0)
    cells[:, 0] = first.take(high)
    cells[:, 1] = rest[0].take(middle) | rest[1].take(last)
    for i, text in zip(unusual.tolist(), _printed(values[unusual], lead), strict=True):
        cells[i] = np.frombuffer(text.ljust(16, b"\0"), _CELL)


@cache
def _tables(lead: str) -> tuple[Cells, tuple[Cells, Cells]]:
    """Cells of four digits each: `lead`, sign, two digits, point, two digits; and four more; and the last four.

    The first two have a second half without the zeros at the end, where nothing follows.
    """
    digits = (np.arange(10**4)[:, None] // [1000, 100, 10, 1] % 10 + ord("0")).astype(np.uint8)
    nothing = np.logical_and.accumulate(digits[:, ::-1] == ord("0"), axis=1)[:, ::-1]
    stripped = np.where(nothing, 0, digits)
    first = np.zeros((2, 2, 10**4, 8), np.uint8)
    first[..., 0], first[1, ..., 1] = ord(lead), ord("-")
    first[..., 2], first[..., 3], first[..., 4] = (
        np.where(digits[:, 0] == ord("0"), 0, digits[:, 0]),
        digits[:, 1],
        ord("."),
    )
    first[:, 0, :, 5:7], first[:, 1, :, 5:7] = digits[:, 2:], stripped[:, 2:]
    first[:, 1, nothing[:, 2], 4] = 0
    rest = np.zeros((3, 10**4, 8), np.uint8)
    rest[0, :, :4], rest[1, :, :4], rest[2, :, 4:] = digits, stripped, stripped
    cells = rest.view(_CELL).ravel()
    return first.view(_CELL).ravel(), (cells[: 2 * 10**4], cells[2 * 10**4 :])
