"""A text as word numbers, read once and gone through as often as needed; it may be larger than memory."""

import os
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import FileIO
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints
from placerec.errors import OutputError

Numbers = NDArray[Any]
# Words in a block: sorting what fits in a cache is faster.
BLOCK = 1 << 18
# Bytes of a text that are held in memory; the text before them goes to a temporary file.
IN_MEMORY = 1 << 26


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
