"""A list of image files on standard input: a path a line, optionally followed by TAB seconds, and TAB place."""

import math
import os
import sys
from contextlib import suppress
from pathlib import Path

from placerec.errors import SourceError, at
from placerec.frames.places import check_place
from placerec.frames.sequence import Frame

NAME = "stdin"
_WHERE = "<stdin>"


def read_list() -> tuple[tuple[Frame, ...], list[tuple[str, str]]]:
    """The frames of a list, called as it calls them, and every place with the line that names it.

    Frames are in the order of their seconds, without any in that of the lines. Raises SourceError naming the line: no
    number, seconds in some lines alone, a name that cannot be a place's, a file named twice; and for an empty list.
    """
    if sys.stdin is None:
        raise SourceError("`-`: reads standard input, and that is closed")
    lines: dict[str, int] = {}
    frames: list[Frame] = []
    # As bytes: a file's name need not be UTF-8.
    for number, line in enumerate(sys.stdin.buffer, start=1):
        text = os.fsdecode(line).rstrip("\r\n")
        if text.strip():
            frame = _frame(number, text)
            first = lines.setdefault(frame.name, number)
            if first != number:
                raise SourceError(at(_WHERE, number, f"{frame.name} is named in line {first} already; remove one"))
            if frames and math.isnan(frame.time) != math.isnan(frames[0].time):
                raise SourceError(at(_WHERE, number, "some lines have seconds and others do not; give all or none"))
            frames.append(frame)
    if not frames:
        raise SourceError(f"{_WHERE}: names no image; give the path of an image a line")
    positions = [(frame.place, f"{_WHERE}:{lines[frame.name]}") for frame in frames if frame.place]
    if not math.isnan(frames[0].time):
        frames.sort(key=lambda frame: frame.time)
    return tuple(frames), positions


def _frame(number: int, text: str) -> Frame:
    path, *more = text.split("\t")
    if len(more) > 2 or not path or "\0" in path:
        raise SourceError(at(_WHERE, number, f"{text!r} is not 'path [TAB seconds [TAB place]]'"))
    seconds, place = (*more, "", "")[:2]
    time = math.nan
    if seconds:
        with suppress(ValueError):
            time = float(seconds)
        if not math.isfinite(time):
            raise SourceError(at(_WHERE, number, f"{seconds!r} is not a number of seconds; mend it"))
    if place and (reason := check_place(place)):
        raise SourceError(at(_WHERE, number, f"place {place!r} {reason}; rename it"))
    return Frame(path, time, place, Path(path))
