"""Descriptors that were computed elsewhere: a matrix in a .npy or .npz file, one row a frame.

The rows of a .npy are the frames of all sequences as `find_sequences` lists them, images that cannot be read among
them. An .npz holds the matrix as `descriptors`; with the names `frames` and `sequences` (as `placerec describe` writes
them) beside it each frame takes its own row, in whatever order they are.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.vision.chunks import first_unusable
from placerec.vision.exact import TERMS
from placerec.vision.storage import reading

Name = tuple[str, str]  # of the sequence, of the frame


def read_rows(path: Path, frames: Sequence[Name]) -> tuple[Singles, list[int]]:
    """The rows of the matrix in `path` that belong to `frames`, float32 (m, d), and the indices of these frames.

    A frame that an .npz with names leaves out of a sequence that it has is left out here, too. A float32 .npy stays on
    disk. Raises VisionError naming the file: for rows that are not as many as the frames or hold NaN or infinite
    values, for sequences without rows, for anything that is not a matrix of numbers.
    """
    try:
        matrix, names = _load(path)
        if matrix.ndim != 2 or matrix.dtype.kind not in "uif" or not matrix.size:
            raise VisionError(f"holds {matrix.dtype} {matrix.shape}; a matrix of numbers is wanted, one row a frame")
        if matrix.shape[1] > TERMS:
            raise VisionError(f"has rows of {matrix.shape[1]} values; reduce them to {TERMS} or fewer")
        if names is not None:
            rows, kept = _rows_named(names, frames)
            matrix = matrix[rows]
        elif len(matrix) == len(frames):
            rows = kept = list(range(len(frames)))
        else:
            raise VisionError(f"has {len(matrix)} rows, and the sources have {len(frames)} frames; give each frame one")
        # What overflows becomes infinite, and is named.
        with np.errstate(over="ignore"):
            values = matrix.astype(np.float32, copy=False)
        bad = first_unusable(values)
        if bad is not None:
            frame = "/".join(frames[kept[bad]])
            raise VisionError(f"row {rows[bad]} (from 0), of {frame}, holds NaN or infinite values; compute it again")
    except VisionError as error:
        raise VisionError(f"{path}: {error}") from error
    return values, kept


def _load(path: Path) -> tuple[NDArray[Any], list[Name] | None]:
    with reading(), path.open("rb") as file:
        start = file.read(6)
        if start == b"\x93NUMPY":
            return np.load(path, mmap_mode="r", allow_pickle=False), None
        if not start.startswith(b"PK"):
            raise VisionError("it is not a .npy or .npz file")
        file.seek(0)
        # Nothing in the file is executed. It is opened here because numpy leaves what it cannot read open.
        with np.load(file, allow_pickle=False) as archive:
            if "descriptors" not in archive.files:
                raise VisionError("the array descriptors is missing")
            matrix = archive["descriptors"]
            there = [name for name in ("sequences", "frames") if name in archive.files]
            if not there:
                return matrix, None
            if len(there) == 1:
                raise VisionError(f"names rows by {there[0]} alone; give both sequences and frames, or neither")
            sequences, frames = archive["sequences"], archive["frames"]
    for array in (sequences, frames):
        if array.dtype.kind != "U" or array.shape != matrix.shape[:1]:
            raise VisionError(f"its names are {array.dtype} {array.shape}, and {matrix.shape[:1]} texts are wanted")
    return matrix, list(zip(sequences.tolist(), frames.tolist(), strict=True))


def _rows_named(names: Sequence[Name], frames: Sequence[Name]) -> tuple[list[int], list[int]]:
    """The row of each frame that has one, and the indices of these frames."""
    where = {name: row for row, name in enumerate(names)}
    if len(where) < len(names):
        twice = next(name for row, name in enumerate(names) if where[name] != row)
        raise VisionError(f"has two rows for {'/'.join(twice)}")
    known = {sequence for sequence, _ in names}
    for sequence, _ in frames:
        if sequence not in known:
            raise VisionError(f"has no rows for the sequence {sequence!r}; it names {', '.join(sorted(known)[:5])}")
    kept = [k for k, name in enumerate(frames) if name in where]
    return [where[frames[k]] for k in kept], kept
