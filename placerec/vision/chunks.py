"""Matrices that come in pieces: what is computed from them does not depend on how they were cut."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision.exact import TERMS

Rows = NDArray[np.float32]
Stream = Callable[[], Iterator[Rows]]  # called once for every pass: gives all rows from the start, in pieces
Source = Rows | Stream  # (n, d) in memory or memory-mapped, or streamed

CHUNK = TERMS  # no more, or the sums of the PCA would round
IN_MEMORY = 1 << 26  # bytes


def chunks(source: Source) -> Iterator[Rows]:
    """All rows in order, in pieces of 4096 (the last may be shorter), so that the order of every sum is fixed."""
    if not callable(source):
        for first in range(0, len(source), CHUNK):
            yield source[first : first + CHUNK]
        return
    waiting: list[Rows] = []
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


@contextmanager
def stored(source: Source) -> Iterator[Stream]:
    """The rows of a source, kept for any number of passes: in memory up to IN_MEMORY, beyond in a nameless file."""
    width = 0
    with tempfile.SpooledTemporaryFile(IN_MEMORY) as file:
        for rows in chunks(source):
            file.write(rows.astype(np.float32, copy=False).tobytes())
            width = rows.shape[1]

        def pieces() -> Iterator[Rows]:
            file.seek(0)
            while data := file.read(4 * width * CHUNK):
                yield np.frombuffer(data, np.float32).reshape(-1, width)

        yield pieces


def again(source: Source, n: int) -> Iterator[Rows]:
    """The chunks of a source that gave n rows before; VisionError if it does not do so again."""
    count = 0
    for rows in chunks(source):
        yield rows
        count += len(rows)
    if count != n:
        raise VisionError(f"the descriptors are {count} rows now and were {n} before; give the same at every call")
