"""The images of some frames of a sequence, wherever they are stored."""

from collections.abc import Iterator
from collections.abc import Sequence as Ordered
from itertools import islice
from pathlib import Path

from placerec.errors import SourceError
from placerec.frames.image import read_gray
from placerec.frames.sequence import Frame, Gray, Sequence


def images_at(sequence: Sequence, indices: Ordered[int]) -> Iterator[Gray | str]:
    """The grey levels of the frames at `indices`, which ascend, or the reason why there are none.

    A recording is read in one pass, from the first to the last of them.
    """
    if sequence.recording is None:
        yield from (_read(sequence.frames[index]) for index in indices)
    elif indices:
        rest = sequence.recording.frames(indices[0])
        here = indices[0]
        for index in indices:
            _, gray = next(islice(rest, index - here, None))
            here = index + 1
            yield gray


def all_images(sequence: Sequence) -> Iterator[tuple[Frame, Gray | str]]:
    """Every frame of a sequence with its grey levels, or the reason why it has none."""
    if sequence.recording is None:
        return ((frame, _read(frame)) for frame in sequence.frames)
    return sequence.recording.frames()


def files_of(sequence: Sequence) -> list[Path]:
    """The files that a sequence's images are read from: if none of them changed, neither did an image."""
    if sequence.recording is None:
        return [frame.path for frame in sequence.frames]
    return sequence.recording.files()


def _read(frame: Frame) -> Gray | str:
    try:
        return read_gray(frame.path)
    except SourceError as error:
        return str(error)
