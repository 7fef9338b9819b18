"""Sequences -> descriptors: every frame is read, described and forgotten."""

import logging
from collections.abc import Iterable, Sequence as Ordered
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from placerec.arrays import Floats, Singles
from placerec.errors import VisionError, counted
from placerec.frames import Sequence
from placerec.frames.table import FrameTable, RowIndex
from placerec.jobs import Executor, Progress
from placerec.journal import Journal
from placerec.vision.external import read_rows
from placerec.vision.spec import DescriptorSpec
from placerec.vision.storage import StreamedArray, text_column, write_npz
from placerec.vision.work import BatchResult, FrameCounts, process_batches

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class Descriptors:
    """Descriptors of n frames, in the order of the sequences and of time.

    values: float32 (n, d), a row of zeros for a constant image; table: the frames. skipped: frames that could not be
    read and are not among the n; constant: images without any structure, which are.
    """

    spec: DescriptorSpec
    values: Singles
    table: FrameTable
    skipped: int = 0
    constant: int = 0

    def __repr__(self) -> str:
        n, d = self.values.shape
        sequences = counted(len({*self.table.sequences}), "sequence")
        return f"Descriptors({counted(n, 'frame')}, {counted(d, 'value')} of {self.spec.kind}, {sequences})"

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """The names of the frames."""
        return tuple(self.table.names)

    @cached_property
    def sequences(self) -> tuple[str, ...]:
        """The name of each frame's sequence."""
        return tuple(self.table.sequences)

    @property
    def times(self) -> Floats:
        """Seconds, float64 (n,), nan where unknown."""
        return self.table.times

    @cached_property
    def places(self) -> tuple[str, ...]:
        """The labels, "" where there is none."""
        return tuple(self.table.places)

    def take(self, rows: RowIndex) -> "Descriptors":
        """Those of some frames, given by numbers, bool (n,) or a slice; what was skipped or constant is not counted."""
        return Descriptors(self.spec, self.values[rows], self.table.take(rows))

    def part(self, spec: DescriptorSpec) -> "Descriptors":
        """Those of `spec`, of which these are joined; VisionError if they are not."""
        return (
            self if spec == self.spec else replace(self, spec=spec, values=self.values[:, self.spec.columns_of(spec)])
        )

    @staticmethod
    def concat(parts: Ordered["Descriptors"]) -> "Descriptors":
        """Those of all parts, one part behind the other; `parts` holds at least one, all of one kind."""
        return Descriptors(
            parts[0].spec,
            np.concatenate([part.values for part in parts]),
            FrameTable.concat(part.table for part in parts),
            sum(part.skipped for part in parts),
            sum(part.constant for part in parts),
        )


def describe(
    sequences: Iterable[Sequence],
    spec: DescriptorSpec | None = None,
    *,
    matrix: Path | str | None = None,
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> Descriptors:
    """The descriptor of every frame; an image that cannot be read is skipped, counted and named in a warning.

    `spec`: None is the default one, or what `matrix` holds. `matrix`: a .npy or .npz file of descriptors that were
    computed elsewhere (`external.read_rows`); no image is read then. `work`: who does the work (`jobs.workers`), None
    for threads; the result does not depend on it. `cache`: a folder where descriptors are kept for other runs, and
    taken from as long as the images' files do not change. `progress` is called with frames done and in all. Raises
    VisionError if no image can be read, or if the matrix cannot be used or holds other descriptors than `spec` wants.
    """
    sequences = list(sequences)
    if matrix is not None:
        return _given(sequences, spec, Path(matrix))
    spec, counts = spec or DescriptorSpec(), FrameCounts()
    found = process_batches(sequences, spec, counts, work=work, cache=cache, progress=progress)
    tables, arrays = zip(*found, strict=True)
    values = np.concatenate([some["values"] for some in arrays])
    return Descriptors(spec, values, FrameTable.concat(tables), counts.skipped, counts.constant)


@dataclass(frozen=True, eq=False)
class KeptDescriptors:
    """`Descriptors` that are in a file or a journal, and not in memory: `values` come piece by piece."""

    spec: DescriptorSpec
    values: StreamedArray
    table: FrameTable
    skipped: int
    constant: int


def keep_described(
    sequences: list[Sequence],
    spec: DescriptorSpec,
    journal: Journal,
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> KeptDescriptors:
    """Describe every frame; the descriptors are left in the journal, where `describe` holds them in memory."""
    counts = FrameCounts()
    found = process_batches(sequences, spec, counts, work=work, journal=journal, cache=cache, progress=progress)
    table = FrameTable.concat(table for table, _ in found)
    values = StreamedArray(
        (len(table), spec.length),
        lambda: (BatchResult.unpack(content).arrays["values"] for content in journal.contents()),
    )
    return KeptDescriptors(spec, values, table, counts.skipped, counts.constant)


def _given(sequences: list[Sequence], spec: DescriptorSpec | None, matrix: Path) -> Descriptors:
    """The rows of a matrix, and the frames that have one."""
    named = [(sequence.name, frame) for sequence in sequences for frame in sequence.frames]
    if spec is not None and spec.kind != "npy":
        raise VisionError(f"{matrix}: is not wanted, for the dictionary is of {spec.kind} descriptors; leave it out")
    values, kept = read_rows(matrix, [(sequence, frame.name) for sequence, frame in named])
    if not kept:
        raise VisionError(
            f"{matrix}: has a row for none of the {counted(len(named), 'frame')}; name the matrix of these sources"
        )
    if spec is not None and values.shape[1] != spec.columns:
        raise VisionError(f"{matrix}: has rows of {values.shape[1]} values, and the dictionary's have {spec.columns}")
    skipped = sorted(set(range(len(named))) - set(kept))
    for k in skipped:
        log.warning("%s: has no row for %s; the frame is skipped", matrix, named[k][1].path)
    table = FrameTable.concat(FrameTable.of_frames(sequence.name, sequence.frames) for sequence in sequences)
    missed = f", {len(skipped)} skipped" if len(skipped) else ""
    log.info("%s described%s; rows of %s", counted(len(kept), "frame"), missed, matrix)
    spec = spec or DescriptorSpec(kind="npy", columns=values.shape[1])
    return Descriptors(spec, values, table.take(kept), len(skipped))


def save_descriptors(descriptors: Descriptors | KeptDescriptors, path: Path | str) -> None:
    """Write descriptors.npz: `descriptors` (n, d) float32, `frames`, `sequences`, `times`, `places` and JSON `meta`."""
    table, spec = descriptors.table, descriptors.spec
    arrays: dict[str, Any] = {
        "descriptors": descriptors.values,
        "frames": text_column(table.names),
        "sequences": text_column(table.sequences),
        "times": table.times,
        "places": text_column(table.places),
    }
    meta = {"format": "placerec-descriptors", "version": 1, "descriptor": spec.as_dict()}
    write_npz(Path(path), arrays, meta | {"skipped": descriptors.skipped, "constant": descriptors.constant})
