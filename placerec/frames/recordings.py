"""Videos and bags as sequences: their frames are listed, and labelled by their times."""

import logging
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from placerec.errors import check_optional
from placerec.frames import av_video, bag, video
from placerec.frames.intervals import Intervals
from placerec.frames.sequence import Frame, Recording, SourceOptions
from placerec.frames.times import part_of

WANTED = "videos (" + " ".join(f"*{suffix}" for suffix in video.SUFFIXES) + ") and bags (*.bag *.mcap *.db3)"
log = logging.getLogger(__name__)


def is_recording(path: Path) -> bool:
    """Whether a path is a video by name or content, or named or laid out as a bag."""
    return bag.is_bag(path) or (path.is_file() and video.is_video(path))


def read_recording(path: Path, labels: Intervals | None, options: SourceOptions) -> tuple[tuple[Frame, ...], Recording]:
    """The frames of a video or a bag in order of time, called after their numbers, and what their images come from.

    Raises SourceError for what cannot be read as one, MissingExtraError for a bag without rosbags.
    """
    if bag.is_bag(path):
        topic, codec, ranks, stored, stamps = bag.list_bag(path, options.topic)
        frames, first = _frames(path, stamps, labels, options)
        return frames, bag.Bag(path, topic, options.every, first, codec, ranks, stored, frames)
    kind = video.Video
    try:
        times = video.list_times(path)
    except video.UndecodableError as error:
        if error.codec.upper() == "AV01":
            check_optional("av", f"{path}: a video of codec {error.codec}", "convert it to H.264")
        if not find_spec("av") or not av_video.can_decode(path):
            raise
        kind, times = av_video.AvVideo, error.times
    seconds: Sequence[float] = times
    if path.suffix.lower() in video.RAW_SUFFIXES:
        if options.rate is None:
            log.warning("%s: has no times; %g frames a second are taken; or say --rate HZ", path, video.RAW_RATE)
        seconds = [number / (options.rate or video.RAW_RATE) for number in range(len(times))]
    frames, first = _frames(path, seconds, labels, options)
    return frames, kind(path, options.every, first, times, frames)


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
