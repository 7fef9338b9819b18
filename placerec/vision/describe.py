"""Sequences -> descriptors: every frame is read, described and forgotten."""

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError, VisionError
from placerec.frames import Sequence, read_gray
from placerec.vision.gist import Floats
from placerec.vision.spec import DescriptorSpec, descriptor
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
    workers: int | None = None,
    progress: Progress | None = None,
) -> Descriptors:
    """The descriptor of every frame; an image that cannot be read is skipped, counted and named in a warning.

    `spec`: None is the default one. `workers`: threads that read and describe, None for one a processor; the result
    is the same for any number. Raises VisionError if no image can be read.
    """
    spec = spec or DescriptorSpec()
    named = [(sequence.name, frame) for sequence in sequences for frame in sequence.frames]
    results = []
    for done, result in enumerate(_described([frame.path for _, frame in named], spec, workers), start=1):
        results.append(result)
        if progress is not None:
            progress(done, len(named))
    kept = []
    for (sequence, frame), result in zip(named, results, strict=True):
        if isinstance(result, str):
            log.warning("%s; the frame is skipped", result)
        else:
            kept.append((sequence, frame, result))
    if not kept:
        raise VisionError(f"none of the {len(named)} images can be read; name a folder with images")
    constant = [str(frame.path) for _, frame, values in kept if not values.any()]
    if constant:
        log.warning("%s: of one grey level throughout; its descriptor is zero", constant[0])
    counts = len(kept), len(named) - len(kept), len(constant)
    log.info("%d frames described, %d skipped, %d of one grey level throughout", *counts)
    return Descriptors(
        spec,
        np.stack([values for _, _, values in kept]),
        tuple(frame.name for _, frame, _ in kept),
        tuple(sequence for sequence, _, _ in kept),
        np.array([frame.time for _, frame, _ in kept], np.float64),
        tuple(frame.place for _, frame, _ in kept),
        len(named) - len(kept),
        len(constant),
    )


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
    meta = {"format": "placerec-descriptors", "version": 1, "descriptor": asdict(descriptors.spec)}
    counts = {"skipped": descriptors.skipped, "constant": descriptors.constant}
    write_npz(Path(path), arrays, meta | counts)
