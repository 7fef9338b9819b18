"""Sequences -> descriptors: every frame is read, described and forgotten."""

import logging
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.frames import Frame, Sequence
from placerec.frames.listed import Labels, Texts
from placerec.jobs import Map, Progress
from placerec.journal import Journal
from placerec.vision.external import read_rows
from placerec.vision.gist import Floats
from placerec.vision.spec import DescriptorSpec, check_describes_images
from placerec.vision.storage import Column, Pieces, text_column, write_npz
from placerec.vision.work import Answer, Tally, answers, describe_batch

log = logging.getLogger(__name__)


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
    work: Map | None = None,
    progress: Progress | None = None,
) -> Descriptors:
    """The descriptor of every frame; an image that cannot be read is skipped, counted and named in a warning.

    `spec`: None is the default one, or what `matrix` holds. `matrix`: a .npy or .npz file of descriptors that were
    computed elsewhere (`external.read_rows`); no image is read then. `work`: who does the work (`jobs.workers`), None
    for threads; the result is the same with any. `progress` is called with frames done and in all. Raises VisionError
    if no image can be read, or if the matrix cannot be used or holds other descriptors than `spec` wants.
    """
    sequences, listing = list(sequences), Listing()
    if matrix is not None:
        spec, values = _given(sequences, spec, Path(matrix), listing)
    else:
        spec = spec or DescriptorSpec()
        values = np.concatenate(list(described(sequences, spec, listing, work=work, progress=progress)))
    return Descriptors(spec, values, *listing.columns(), listing.tally.skipped, listing.tally.constant)


@dataclass
class Listing:
    """The frames that have a descriptor, as they are found, in little memory."""

    frames: Texts = field(default_factory=Texts)
    sequences: Labels = field(default_factory=Labels)
    times: "array[float]" = field(default_factory=lambda: array("d"))
    places: Labels = field(default_factory=Labels)
    tally: Tally = field(default_factory=Tally)

    def add(self, sequence: str, frame: Frame) -> None:
        """One frame more."""
        self.frames.append(frame.name)
        self.sequences.append(sequence)
        self.times.append(frame.time)
        self.places.append(frame.place)

    def columns(self) -> tuple[tuple[str, ...], tuple[str, ...], NDArray[np.float64], tuple[str, ...]]:
        """Frames, sequences, times and places, as `Descriptors` has them."""
        return tuple(self.frames), tuple(self.sequences), np.array(self.times, np.float64), tuple(self.places)


def described(
    sequences: list[Sequence],
    spec: DescriptorSpec,
    listing: Listing,
    *,
    work: Map | None = None,
    journal: Journal | None = None,
    progress: Progress | None = None,
) -> Iterator[Floats]:
    """The descriptors (m, spec.length) of a batch of frames after the other, which are listed; else as `describe`."""
    check_describes_images(spec)
    function, tally = partial(describe_batch, spec), listing.tally
    for batch, answer in answers(
        function, sequences, spec, tally, key="describe", work=work, journal=journal, progress=progress
    ):
        for k in answer.kept.tolist():
            listing.add(batch.sequence, batch.frames[k])
        yield answer.arrays["values"]
    tally.close()


def list_described(
    sequences: list[Sequence],
    spec: DescriptorSpec,
    journal: Journal,
    work: Map | None = None,
    progress: Progress | None = None,
) -> Listing:
    """The frames that have a descriptor; the descriptors are left in the journal, for `kept_rows`."""
    listing = Listing()
    for _ in described(sequences, spec, listing, work=work, journal=journal, progress=progress):
        pass
    return listing


def kept_rows(journal: Journal) -> Iterator[Floats]:
    """The descriptors that `described` left in a journal, batch by batch."""
    for content in journal.contents():
        yield Answer.unpack(content).arrays["values"]


def _given(
    sequences: list[Sequence], spec: DescriptorSpec | None, matrix: Path, listing: Listing
) -> tuple[DescriptorSpec, Floats]:
    """The specification and the rows of a matrix; the frames that have one are listed."""
    named = [(sequence.name, frame) for sequence in sequences for frame in sequence.frames]
    if spec is not None and spec.kind != "npy":
        raise VisionError(f"{matrix}: is not wanted, for the dictionary is of {spec.kind} descriptors; leave it out")
    values, kept = read_rows(matrix, [(sequence, frame.name) for sequence, frame in named])
    if not kept:
        raise VisionError(f"{matrix}: has a row for none of the {len(named)} frames; name the matrix of these sources")
    if spec is not None and values.shape[1] != spec.columns:
        raise VisionError(f"{matrix}: has rows of {values.shape[1]} values, and the dictionary's have {spec.columns}")
    for k in sorted(set(range(len(named))) - set(kept)):
        log.warning("%s: has no row for %s; the frame is skipped", matrix, named[k][1].path)
    for k in kept:
        listing.add(*named[k])
    listing.tally = Tally(len(named), len(named) - len(kept))
    log.info("%d frames described, %d skipped; rows of %s", len(kept), listing.tally.skipped, matrix)
    return spec or DescriptorSpec(kind="npy", columns=values.shape[1]), values


def save_descriptors(descriptors: Descriptors, path: Path | str) -> None:
    """Write descriptors.npz: `descriptors` (n, d) float32, `frames`, `sequences`, `times`, `places` and JSON `meta`."""
    given = descriptors
    columns = given.frames, given.sequences, given.times, given.places
    _save(path, given.spec, given.values, columns, given.skipped, given.constant)


def save_kept(journal: Journal, listing: Listing, spec: DescriptorSpec, path: Path | str) -> None:
    """`save_descriptors` of what `described` left in a journal; only the listing is in memory."""
    values = Pieces((len(listing.frames), spec.length), lambda: kept_rows(journal))
    columns = listing.frames, listing.sequences, np.array(listing.times), listing.places
    _save(path, spec, values, columns, listing.tally.skipped, listing.tally.constant)


def _save(
    path: Path | str,
    spec: DescriptorSpec,
    values: Floats | Pieces,
    columns: tuple[Column, Column, NDArray[np.float64], Column],
    skipped: int,
    constant: int,
) -> None:
    frames, sequences, times, places = columns
    arrays: dict[str, Any] = {
        "descriptors": values,
        "frames": text_column(frames),
        "sequences": text_column(sequences),
        "times": times,
        "places": text_column(places),
    }
    meta = {"format": "placerec-descriptors", "version": 1, "descriptor": spec.as_dict()}
    write_npz(Path(path), arrays, meta | {"skipped": skipped, "constant": constant})
