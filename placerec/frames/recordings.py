"""Videos and bags as sequences: their frames are listed, and labelled by their times."""

from collections.abc import Sequence
from pathlib import Path

from placerec.frames import bag, video
from placerec.frames.intervals import Intervals
from placerec.frames.sequence import Frame, Recording, SourceOptions

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
        frames = _frames(path, stamps, labels, options)
        return frames, bag.Bag(path, topic, options.every, ranks, frames)
    times = video.list_times(path)
    frames = _frames(path, times, labels, options)
    return frames, video.Video(path, options.every, times, frames)


def _frames(path: Path, times: Sequence[float], labels: Intervals | None, options: SourceOptions) -> tuple[Frame, ...]:
    chosen = [(number, times[number]) for number in range(0, len(times), options.every)]
    seconds = [time for _, time in chosen]
    places = labels.places(seconds, options.label_clock) if labels else [""] * len(chosen)
    # Six digits: as many frames as ten hours have, so that names sort as frames do.
    return tuple(
        Frame(f"{number:06d}", time, place, path) for (number, time), place in zip(chosen, places, strict=True)
    )
