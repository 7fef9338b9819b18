"""Videos and bags as sequences: their frames are listed, and labelled by their times."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from placerec.frames import bag, video
from placerec.frames.intervals import Intervals
from placerec.frames.sequence import Frame, Recording, SourceOptions
from placerec.frames.times import part_of

WANTED = "videos (" + " ".join(f"*{suffix}" for suffix in video.SUFFIXES) + ") and bags (*.bag *.mcap *.db3)"


def is_recording(path: Path) -> bool:
    """Whether a path is named as a video is, or named or laid out as a bag."""
    return bag.is_bag(path) or (path.is_file() and path.suffix.lower() in video.SUFFIXES)


def read_recording(path: Path, labels: Intervals | None, options: SourceOptions) -> tuple[tuple[Frame, ...], Recording]:
    """The frames of a video or a bag in order of time, called after their numbers, and what their images come from.

    Raises SourceError for what cannot be read as one, MissingExtraError for a bag without rosbags.
    """
    if bag.is_bag(path):
        topic, ranks, stamps = bag.list_bag(path, options.topic)
        frames, first = _frames(path, stamps, labels, options)
        return frames, bag.Bag(path, topic, options.every, first, ranks, frames)
    times = video.list_times(path)
    frames, first = _frames(path, times, labels, options)
    return frames, video.Video(path, options.every, first, times, frames)


def _frames(
    path: Path, times: Sequence[float], labels: Intervals | None, options: SourceOptions
) -> tuple[tuple[Frame, ...], int]:
    """The frames that are read, and the number of the first of them; `times`: of all."""
    part = part_of(np.array(times), options.begin, options.end, str(path))
    numbers = range(len(times))[part][:: options.every]
    places = labels.places(times, options.label_clock) if labels else [""] * len(times)
    # Six digits: as many frames as ten hours have, so that names sort as frames do.
    frames = tuple(Frame(f"{number:06d}", times[number], places[number], path) for number in numbers)
    return frames, numbers.start
