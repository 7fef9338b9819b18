"""Matrices that come in pieces: what is computed from them does not depend on how they were cut."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO

import numpy as np

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.jobs import Executor, ScatteredMap, scatter
from placerec.vision.exact import TERMS

Stream = Callable[[], Iterator[Singles]]  # called once for every pass: gives all rows from the start, in pieces
Source = Singles | Stream  # (n, d) in memory or memory-mapped, or streamed

CHUNK = TERMS  # no more, or the sums of the PCA would round
IN_MEMORY = 1 << 26  # bytes


def chunks(source: Source) -> Iterator[Singles]:
    """All rows in order, in pieces of 4096 (the last may be shorter), so that the order of every sum is fixed."""
    if not callable(source):
        for first in range(0, len(source), CHUNK):
            yield source[first : first + CHUNK]
        return
    waiting: list[Singles] = []
    count = 0
    for piece in source():
        waiting.append(piece)
        count += len(piece)
        if count >= CHUNK:
            together = np.concatenate(waiting)
            whole = count - count % CHUNK
            yield from chunks(together[:whole])
            waiting, count = [together[whole:]], count - whole
    if count:
        yield np.concatenate(waiting)


def first_unusable(rows: Singles) -> int | None:
    """The first row that holds NaN or infinite values, None if there is none."""
    for number, part in enumerate(chunks(rows)):
        good = np.isfinite(part)
        if not good.all():
            return number * CHUNK + int(good.all(axis=1).argmin())
    return None


class SpooledRows:
    """The chunks of a source, kept for any number of passes; as a stream, too.

    `each` maps functions over them; workers on other machines have copies of their own. There are `rows` of `width`
    values.
    """

    def __init__(self, file: IO[bytes], source: Source, work: Executor | None) -> None:
        self._file = file
        self._count, self.width, self.rows = 0, 0, 0
        for rows in chunks(source):
            file.write(rows.astype(np.float32, copy=False).tobytes())
            self._count, self.width = self._count + 1, rows.shape[1]
            self.rows += len(rows)
        self.each: ScatteredMap[Singles] = scatter(self, work)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, at: int) -> Singles:
        size = 4 * self.width * CHUNK
        self._file.seek(at * size)
        return np.frombuffer(self._file.read(size), np.float32).reshape(-1, self.width)

    def __call__(self) -> Iterator[Singles]:
        return map(self.__getitem__, range(len(self)))


@contextmanager
def spooled(source: Source, work: Executor | None = None) -> Iterator[SpooledRows]:
    """The rows of a source for many passes: in memory up to IN_MEMORY, beyond in a nameless file."""
    with tempfile.SpooledTemporaryFile(IN_MEMORY) as file:
        yield SpooledRows(file, source, work)


def each_chunk(source: Source) -> ScatteredMap[Singles]:
    """Maps functions over the chunks of a source: one function for every pass."""
    return source.each if isinstance(source, SpooledRows) else lambda function: map(function, chunks(source))


def check_again(count: int, n: int) -> None:
    """VisionError if a source that gave n rows before gave `count` now."""
    if count != n:
        raise VisionError(f"the descriptors are {count} rows now and were {n} before; give the same at every call")
