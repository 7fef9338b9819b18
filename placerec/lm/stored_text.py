"""A text as word numbers, read once and gone through as often as needed, and the distinct windows in it.

The text may be larger than memory. A window is `order` words from a position on, packed into as few numbers as hold
them; what would lie behind the sentence's end is 0. Blocks of the text are reduced to sorted runs of windows, which are
merged whenever those that wait outgrow what is merged already: memory holds a few times the distinct windows, however
long the text is, and no window is merged often.
"""

import os
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial, reduce
from io import FileIO
from typing import Any, cast

import numpy as np

from placerec.ahead import work_ahead
from placerec.arrays import Ints, Numbers
from placerec.errors import OutputError
from placerec.lm.trie import changes

# Words in a block: sorting what fits in a cache is faster.
BLOCK = 1 << 18
# Bytes of a text that are held in memory; the text before them goes to a temporary file.
IN_MEMORY = 1 << 26
# Windows that may wait for being merged.
WAITING = 1 << 21
# Windows, packed, a column int64 (m,) per number, and how often each occurs (m,).
Run = tuple[list[Ints], Numbers]


@dataclass(frozen=True)
class Block:
    """Whole sentences: word numbers (T,), lengths (S,), none of them 0, and weights (S,), int64 or float64, or None.

    Integers may be of any type: the smallest that holds them.
    """

    ids: Numbers
    lengths: Numbers
    weights: Numbers | None = None

    @property
    def arrays(self) -> list[Numbers]:
        return [self.ids, self.lengths] + ([] if self.weights is None else [self.weights])


class StoredText:
    """Iterates over the sentences that were added, in blocks of BLOCK words or a little more.

    `tokens`: how many words they hold; `weighted`: whether they have weights. Beyond IN_MEMORY bytes they are moved to
    a temporary file in $TMPDIR that has no name: it goes when the text does, or when the process ends in any way.
    """

    def __init__(self) -> None:
        self.tokens = 0
        self.weighted = False
        self._open: list[Block] = []
        self._open_tokens = 0
        self._kept: list[Block] = []
        self._kept_bytes = 0
        self._layouts: list[list[tuple[np.dtype[Any], int]]] = []
        self._file: FileIO | None = None

    def add(self, ids: Ints, lengths: Ints, weights: Numbers | None = None) -> None:
        """Add sentences of word numbers (T,) >= 0, of lengths (S,) and, each time or never, with weights (S,).

        Raises OutputError if a temporary file is needed and cannot be written.
        """
        some = lengths > 0
        self.weighted = weights is not None
        self._open.append(Block(_small(ids), _small(lengths[some]), None if weights is None else weights[some]))
        self._open_tokens += len(ids)
        self.tokens += len(ids)
        if self._open_tokens >= BLOCK:
            block = _joined(self._open)
            self._open, self._open_tokens = [], 0
            self._kept.append(block)
            self._kept_bytes += sum(array.nbytes for array in block.arrays)
            if self._kept_bytes > IN_MEMORY:
                self._store()

    def __iter__(self) -> Iterator[Block]:
        offset = 0
        for layout in self._layouts:
            arrays = []
            with _temporary():
                cast(FileIO, self._file).seek(offset)
                for dtype, size in layout:
                    arrays.append(np.fromfile(cast(FileIO, self._file), dtype, size))
                    offset += arrays[-1].nbytes
            yield Block(*arrays)
        yield from self._kept
        if self._open:
            yield _joined(self._open)

    def _store(self) -> None:
        """Move the blocks that are kept in memory to the file."""
        with _temporary():
            if self._file is None:
                self._file = _nameless()
                weakref.finalize(self, self._file.close)
            self._file.seek(0, os.SEEK_END)
            for block in self._kept:
                for array in block.arrays:
                    left = memoryview(array.tobytes())
                    while left:
                        left = left[self._file.write(left) :]
                self._layouts.append([(array.dtype, len(array)) for array in block.arrays])
        self._kept, self._kept_bytes = [], 0


def _small(numbers: Numbers) -> Numbers:
    return numbers.astype(np.min_scalar_type(int(numbers.max()))) if len(numbers) else numbers.astype(np.uint8)


def _joined(blocks: list[Block]) -> Block:
    return Block(*(np.concatenate(arrays) for arrays in zip(*(block.arrays for block in blocks), strict=True)))


def _nameless() -> FileIO:
    # Rarely needed, and not quick to import.
    from tempfile import TemporaryFile

    # Named, so that a folder that cannot be used is an error, as it is to sort(1), and not silently replaced.
    folder = os.environ.get("TMPDIR") or None
    return TemporaryFile(buffering=0, dir=folder)


@contextmanager
def _temporary() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        folder = os.environ.get("TMPDIR") or "the folder for temporary files"
        raise OutputError(
            f"{folder}: a text too large for memory cannot be kept there: {error.strerror or error}; "
            "set TMPDIR to a folder with room"
        ) from error


def distinct_windows(
    text: StoredText, spans: Sequence[range], bits: int, *, renumbered: Ints | None = None, weighted: bool = True
) -> Run:
    """The distinct windows, ascending: a column int64 (m,) of packed words per span, and their counts int64 (m,).

    `spans`: the words of a window that share a number, `bits` bits each. `renumbered`: the number to use for each
    word number of the text. `weighted`: whether a window counts as much as the sentence weighs (an integer), or once.
    """
    runs: list[Run] = []
    reduced = partial(_reduced, spans=spans, bits=bits, renumbered=renumbered, weighted=weighted)
    for run in work_ahead(reduced, text):
        runs.append(run)
        if sum(len(counts) for _, counts in runs[1:]) > max(WAITING, len(runs[0][1])):
            runs = [_merged(runs)]
    return _merged(runs) if runs else ([np.zeros(0, np.int64) for _ in spans], np.zeros(0, np.int64))


def _reduced(block: Block, *, spans: Sequence[range], bits: int, renumbered: Ints | None, weighted: bool) -> Run:
    symbols = (block.ids.astype(np.int64) if renumbered is None else renumbered[block.ids]) + 1
    lengths = block.lengths.astype(np.int64)
    columns = [_packed(symbols, lengths, span, bits) for span in spans]
    if block.weights is None or not weighted:
        return _summed(columns, None)
    return _summed(columns, np.repeat(block.weights, lengths))


def _merged(runs: Sequence[Run]) -> Run:
    if len(runs) == 1:
        return runs[0]
    columns = [np.concatenate(parts) for parts in zip(*(columns for columns, _ in runs), strict=True)]
    return _summed(columns, np.concatenate([counts for _, counts in runs]))


def _summed(columns: list[Ints], counts: Numbers | None) -> Run:
    """The distinct windows, ascending, and the sums of their counts (by default each counts 1)."""
    if counts is None and len(columns) == 1:
        windows = np.sort(columns[0])
        starts = np.flatnonzero(changes(windows))
        return [windows[starts]], np.diff(starts, append=len(windows))
    by_window = np.lexsort(columns[::-1])
    columns = [column[by_window] for column in columns]
    starts = np.flatnonzero(reduce(np.logical_or, map(changes, columns)))
    if counts is None:
        sums = np.diff(starts, append=len(by_window))
    else:
        sums = np.add.reduceat(counts[by_window], starts) if len(starts) else counts
    return [column[starts] for column in columns], sums


def _packed(symbols: Ints, lengths: Ints, span: range, bits: int) -> Ints:
    """The words at these distances from each position, packed (T,)."""
    packed = np.zeros(len(symbols), np.int64)
    ends = np.cumsum(lengths)
    for distance in span:
        packed <<= bits
        packed[: max(0, len(symbols) - distance)] |= symbols[distance:]
    # The last words of each sentence reached into the next one.
    for left in range(1, span.stop):
        at = (ends - left)[lengths >= left]
        shifts = [bits * (span.stop - 1 - distance) for distance in span if distance >= left]
        keep = ~sum(((1 << bits) - 1) << shift for shift in shifts)
        packed[at] &= keep
    return packed
