"""Sequences -> descriptors: every frame is read, described and forgotten."""

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError, VisionError
from placerec.frames import Frame, Sequence, read_gray
from placerec.vision.external import read_rows
from placerec.vision.gist import Floats
from placerec.vision.spec import DescriptorSpec, check_describes_images, descriptor
from placerec.vision.storage import write_npz

log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]  # frames done, frames in all


@dataclass(frozen=True, eq=False)
class Descriptors:
    """Descriptors of n frames, in the order of the sequences and of time.

    values: float32 (n, d), a row of zeros for a constant image; frames, sequences, places: names (n,), place ""
    where unlabelled; times: float64 (n,) seconds, nan where unknown. skipped: frames that could not be read and are
    not among the n; constant: images without any structure, which are.
    """

    spec: DescriptorSpec
    values: NDArray[np.float32]
    frames: tuple[str, ...]
    sequences: tuple[str, ...]
    times: NDArray[np.float64]
    places: tuple[str, ...]
    skipped: int
    constant: int

    def rows_by_sequence(self) -> dict[str, NDArray[np.int64]]:
        """Sequence name -> the indices of its frames, both in order; a sequence without readable images is absent."""
        rows: dict[str, list[int]] = {}
        for row, name in enumerate(self.sequences):
            rows.setdefault(name, []).append(row)
        return {name: np.array(its, np.int64) for name, its in rows.items()}


def describe(
    sequences: Iterable[Sequence],
    spec: DescriptorSpec | None = None,
    *,
    matrix: Path | str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Descriptors:
    """The descriptor of every frame; an image that cannot be read is skipped, counted and named in a warning.

    `spec`: None is the default one, or what `matrix` holds. `matrix`: a .npy or .npz file of descriptors that were
    computed elsewhere (`external.read_rows`); no image is read then. `workers`: threads that read and describe, None
    for one a processor; the result is the same for any number. Raises VisionError if no image can be read, or if the
    matrix cannot be used or holds other descriptors than `spec` wants.
    """
    named = [(sequence.name, frame) for sequence in sequences for frame in sequence.frames]
    if matrix is not None:
        spec, values, kept = _given(named, spec, Path(matrix))
        constant = 0
    else:
        spec = spec or DescriptorSpec()
        check_describes_images(spec)
        values, kept, constant = _made(named, spec, workers, progress)
    skipped = len(named) - len(kept)
    pictures = f", {constant} of one grey level throughout" if matrix is None else f"; rows of {matrix}"
    log.info("%d frames described, %d skipped%s", len(kept), skipped, pictures)
    found = [named[k] for k in kept]
    return Descriptors(
        spec,
        values,
        tuple(frame.name for _, frame in found),
        tuple(sequence for sequence, _ in found),
        np.array([frame.time for _, frame in found], np.float64),
        tuple(frame.place for _, frame in found),
        skipped,
        constant,
    )


def _given(
    named: list[tuple[str, Frame]], spec: DescriptorSpec | None, matrix: Path
) -> tuple[DescriptorSpec, Floats, list[int]]:
    """The specification and the rows of a matrix, and the indices of the frames that these are of."""
    if spec is not None and spec.kind != "npy":
        raise VisionError(f"{matrix}: is not wanted, for the dictionary is of {spec.kind} descriptors; leave it out")
    values, kept = read_rows(matrix, [(sequence, frame.name) for sequence, frame in named])
    if not kept:
        raise VisionError(f"{matrix}: has a row for none of the {len(named)} frames; name the matrix of these sources")
    if spec is not None and values.shape[1] != spec.columns:
        raise VisionError(f"{matrix}: has rows of {values.shape[1]} values, and the dictionary's have {spec.columns}")
    for k in sorted(set(range(len(named))) - set(kept)):
        log.warning("%s: has no row for %s; the frame is skipped", matrix, named[k][1].path)
    return spec or DescriptorSpec(kind="npy", columns=values.shape[1]), values, kept


def _made(
    named: list[tuple[str, Frame]], spec: DescriptorSpec, workers: int | None, progress: Progress | None
) -> tuple[Floats, list[int], int]:
    """The descriptors of images, the indices of the frames that they are of, and how many images are constant."""
    results = []
    for done, result in enumerate(_described([frame.path for _, frame in named], spec, workers), start=1):
        results.append(result)
        if progress is not None:
            progress(done, len(named))
    rows, kept = [], []
    for k, result in enumerate(results):
        if isinstance(result, str):
            log.warning("%s; the frame is skipped", result)
        else:
            rows.append(result)
            kept.append(k)
    if not kept:
        raise VisionError(f"none of the {len(named)} images can be read; name a folder with images")
    constant = [k for k, row in zip(kept, rows, strict=True) if not row.any()]
    if constant:
        log.warning("%s: of one grey level throughout; its descriptor is zero", named[constant[0]][1].path)
    return np.stack(rows), kept, len(constant)


def _described(paths: Iterable[Path], spec: DescriptorSpec, workers: int | None) -> Iterator[Floats | str]:
    """`describe_image` of every path, in order; no more images are in memory than the workers can use."""
    workers = _processors() if workers is None else workers
    waiting: deque[Future[Floats | str]] = deque()
    # Threads are enough: decoding, the transforms and numpy's loops all run without the interpreter's lock.
    with ThreadPoolExecutor(workers) as pool:
        for path in paths:
            waiting.append(pool.submit(describe_image, path, spec))
            if len(waiting) > 4 * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _processors() -> int:
    # Of those that this process may run on, where the system can tell.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def describe_image(path: Path, spec: DescriptorSpec) -> Floats | str:
    """One image file's descriptor, or the reason why there is none: a function of its arguments alone.

    That it gives back what went wrong lets a pool of workers map it over the frames.
    """
    try:
        return descriptor(read_gray(path), spec)
    except SourceError as error:
        return str(error)
    except VisionError as error:
        return f"{path}: {error}"


def save_descriptors(descriptors: Descriptors, path: Path | str) -> None:
    """Write descriptors.npz: `descriptors` (n, d) float32, `frames`, `sequences`, `times`, `places` and JSON `meta`."""
    arrays = {
        "descriptors": descriptors.values,
        "frames": np.array(descriptors.frames, np.str_),
        "sequences": np.array(descriptors.sequences, np.str_),
        "times": descriptors.times,
        "places": np.array(descriptors.places, np.str_),
    }
    meta = {"format": "placerec-descriptors", "version": 1, "descriptor": descriptors.spec.as_dict()}
    counts = {"skipped": descriptors.skipped, "constant": descriptors.constant}
    write_npz(Path(path), arrays, meta | counts)
