"""The frames that a page shows: some of them or all, small, as texts that stand where a picture's address would."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np

from placerec.errors import SourceError
from placerec.frames import Sequence as FrameSequence
from placerec.frames.images import picture_at
from placerec.jobs import Executor, Progress, workers
from placerec.page.drives import Drive

# The most pixels of height, and WebP's quality: 1 to 5 kB a frame.
_HEIGHT, _QUALITY = 160, 65
# How many frames a page holds, of all drives together.
MOST = 1500


def sequences_of(drives: Sequence[Drive], sequences: Iterable[FrameSequence]) -> dict[str, FrameSequence]:
    """The sequence of images of each drive by the drive's name: the one of that name, or the only one with its frames.

    Raises SourceError for a sequence that is none of the drives', and for one that lacks frames of its drive.
    """
    found: dict[str, FrameSequence] = {}
    for sequence in sequences:
        names = {frame.name for frame in sequence.frames}
        same = [drive.name for drive in drives if drive.name == sequence.name]
        fits = same or [drive.name for drive in drives if drive.frames and names.issuperset(drive.frames)]
        if len(fits) != 1:
            known = ", ".join(drive.name for drive in drives[:4]) + (", ..." if len(drives) > 4 else "")
            which = "several of the drives" if fits else "none of the drives"
            raise SourceError(f"{sequence.source}: has the frames of {which} ({known}); name the images of these alone")
        found[fits[0]] = sequence
    for drive in drives:
        if drive.name in found:
            names = {frame.name for frame in found[drive.name].frames}
            if lost := [name for name in drive.frames if name not in names]:
                source = found[drive.name].source
                raise SourceError(
                    f"{source}: has no frame {lost[0]}, of which {drive.name} has beliefs; name its images"
                )
    return found


def pictures_of(
    drives: Sequence[Drive],
    sequences: Mapping[str, FrameSequence],
    wanted: Mapping[str, Iterable[int]],
    progress: Progress | None = None,
) -> dict[str, tuple[list[int], list[str]]]:
    """Of each drive that has images the numbers of the frames that are shown, ascending, and their pictures.

    Of more than MOST frames those of `wanted` come first, and evenly spaced ones fill the rest. What cannot be read is
    left out.
    """
    shown = [drive for drive in drives if drive.name in sequences]
    total = sum(len(drive.frames) for drive in shown)
    done, made = 0, {}
    for drive in shown:
        most = len(drive.frames) if total <= MOST else max(1, MOST * len(drive.frames) // total)
        kept = chosen_frames(len(drive.frames), wanted.get(drive.name, ()), most)
        sequence = sequences[drive.name]
        number = {frame.name: index for index, frame in enumerate(sequence.frames)}
        indices = [number[drive.frames[frame]] for frame in kept]
        # A recording is one file, which is read by one.
        work: Executor = workers() if sequence.recording is None else map
        found: dict[int, str] = {}
        for frame, text in zip(kept, work(partial(_picture_text, sequence), indices), strict=True):
            if text:
                found[frame] = text
            done += 1
            if progress:
                progress(done, min(total, MOST))
        made[drive.name] = ([*found], [*found.values()])
    return made


def chosen_frames(frames: int, wanted: Iterable[int], most: int) -> list[int]:
    """At most `most` of the numbers below `frames`, ascending: at most three quarters of them `wanted` ones."""
    if frames <= most:
        return list(range(frames))
    first = sorted(set(wanted))
    first = _thinned(first, most * 3 // 4)
    rest = sorted(set(range(frames)) - set(first))
    return sorted({*first, *_thinned(rest, most - len(first))})


def _thinned(numbers: list[int], most: int) -> list[int]:
    """Evenly many of the numbers."""
    if len(numbers) <= most:
        return numbers
    return [numbers[k] for k in np.linspace(0, len(numbers) - 1, max(most, 0)).round().astype(int).tolist()]


def _picture_text(sequence: FrameSequence, index: int) -> str:
    """What stands in a page in place of the address of a frame's picture; "" for a frame that cannot be read."""
    import cv2

    image = picture_at(sequence, index, _HEIGHT)
    if isinstance(image, str):
        return ""
    done, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    if not done:
        raise SourceError("OpenCV cannot write WebP here; install the wheel opencv-python-headless")
    return f"data:image/webp;base64,{base64.b64encode(data.tobytes()).decode('ascii')}"
