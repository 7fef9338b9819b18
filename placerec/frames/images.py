"""The images of frames, wherever they are stored: of some, of all, and in batches.

A batch is the unit of work that is handed out, kept, and done again if it was lost.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence as Ordered
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.files import content_digest
from placerec.frames.image import read_colours, read_image
from placerec.frames.sequence import Frame, Gray, Image, Sequence

BATCH = 64  # half a second of work


def images_at(sequence: Sequence, indices: Ordered[int], *, colours: bool = False) -> Iterator[Image | str]:
    """The grey levels of the frames at `indices`, which ascend, or the reason why there are none.

    `colours`: a `ColourImage` of each. A recording is read in one pass, from the first to the last of them.
    """
    if sequence.recording is None:
        yield from (_read(sequence.frames[index], colours) for index in indices)
    elif indices:
        rest = sequence.recording.frames(indices[0], colours=colours)
        here = indices[0]
        for index in indices:
            _, image = next(islice(rest, index - here, None))
            here = index + 1
            yield image


def picture_at(sequence: Sequence, index: int, height: int) -> Gray | str:
    """The frame at `index` for people to look at, or the reason why there is none; made smaller if it is higher.

    (h, w, 3) blue, green, red, or (h, w) where the source has grey levels alone, uint8, h at most `height`.
    """
    try:
        if sequence.recording is None:
            found: Gray | str = read_colours(sequence.frames[index].path, height)
        else:
            found = sequence.recording.picture(index)
    except SourceError as error:
        return str(error)
    return found if isinstance(found, str) else shrunk(found, height)


def shrunk(pixels: NDArray[Any], height: int) -> Gray:
    """Pixels (h, w) or (h, w, 3) as uint8, made smaller if they are more than `height` high."""
    import cv2

    high, wide = pixels.shape[:2]
    if high > height:
        pixels = cv2.resize(pixels, (max(1, round(wide * height / high)), height), interpolation=cv2.INTER_AREA)
    return pixels.clip(0, 255).astype(np.uint8)


def all_images(sequence: Sequence, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
    """Every frame of a sequence with its grey levels, with `colours` a `ColourImage`, or the reason why it has none."""
    if sequence.recording is None:
        return ((frame, _read(frame, colours)) for frame in sequence.frames)
    return sequence.recording.frames(colours=colours)


def files_of(sequence: Sequence) -> list[Path]:
    """The files that a sequence's images are read from: if none of them changed, neither did an image."""
    if sequence.recording is None:
        return [frame.path for frame in sequence.frames]
    return sequence.recording.files()


@dataclass(frozen=True, eq=False)
class Batch:
    """Some consecutive frames of a sequence. `first`: the index of the first of them there.

    `images`: what is left of their images once they were made smaller, or why there are none; None if each is still in
    a file of its own. `known`: what was found of the frames before, for which their images are not needed; None if
    nothing was.
    """

    sequence: str
    first: int
    frames: tuple[Frame, ...]
    images: tuple[Any, ...] | None = None
    known: bytes | None = None


def batches(sequences: Iterable[Sequence], *, colours: bool = False) -> Iterator[tuple[Sequence, Batch]]:
    """All frames, in order, in batches of one sequence each; of recordings, without the images.

    Only the frames of an endless recording come with their images, for they are not known before; `colours`: a
    `ColourImage` of each.
    """
    for sequence in sequences:
        recording = sequence.recording
        if recording is not None and recording.endless:
            rest = recording.frames(colours=colours)
            first = 0
            while some := tuple(islice(rest, BATCH)):
                frames, images = zip(*some, strict=True)
                yield sequence, Batch(sequence.name, first, frames, images)
                first += len(some)
            continue
        for first in range(0, len(sequence.frames), BATCH):
            yield sequence, Batch(sequence.name, first, tuple(sequence.frames[first : first + BATCH]))


def with_images(
    listed: Iterable[tuple[Sequence, Batch]], shrink: Callable[[Image | str], Any], *, colours: bool = False
) -> Iterator[Batch]:
    """The batches, those of recordings with their images, which are read in one pass where nothing is known between.

    `shrink` makes them smaller, so that little is kept and sent. `colours`: a `ColourImage` of each.
    """
    rest: Iterator[tuple[Frame, Image | str]] = iter(())
    current = ("", 0)
    for sequence, batch in listed:
        images = batch.images
        if sequence.recording is not None and images is None and batch.known is None:
            if current != (sequence.name, batch.first):
                rest = sequence.recording.frames(batch.first, colours=colours)
            current = (sequence.name, batch.first + len(batch.frames))
            found = {frame.name: shrink(image) for frame, image in islice(rest, len(batch.frames))}
            images = tuple(found.get(frame.name, f"{frame.path}: frame {frame.name} is gone") for frame in batch.frames)
        elif images is not None:
            images = tuple(map(shrink, images))
        yield replace(batch, images=images)


def content_key(sequence: Sequence, batch: Batch) -> str:
    """A digest of what the batch's images are read from: full names, sizes and times of change of the files."""
    recording = sequence.recording
    files = [frame.path for frame in batch.frames] if recording is None else recording.files()
    whole = None if recording is None else [repr(recording), batch.frames[0].name, len(batch.frames)]
    return content_digest(whole, [(os.path.abspath(path), _state(path)) for path in files])


def _read(frame: Frame, colours: bool) -> Image | str:
    try:
        return read_image(frame.path, colours=colours)
    except SourceError as error:
        return str(error)


def _state(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    # The last one changes where another file took the place with times of its own.
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns
