"""A list of image files on standard input (`-`): a line each, the path, perhaps TAB seconds, and perhaps TAB place."""

import math
import os
import sys
from dataclasses import replace
from pathlib import Path

from placerec.errors import SourceError, at
from placerec.frames.folder import is_text
from placerec.frames.intervals import checked_seconds
from placerec.frames.places import checked_place
from placerec.frames.sequence import Frame

LIST_NAME, STDIN = "stdin", "<stdin>"


def read_list(rate: float | None = None) -> tuple[tuple[Frame, ...], list[tuple[str, str]]]:
    """The frames of a list, called as it calls them, and every place with the line that names it.

    Frames are in the order of their seconds, without any in that of the lines, `rate` a second if it is given. Raises
    SourceError naming the line: no number, seconds in some lines alone, a name that cannot be a place's or is no text,
    a file named twice; and for an empty list.
    """
    if sys.stdin is None:
        raise SourceError("`-`: reads standard input, and that is closed")
    lines: dict[str, int] = {}
    frames: list[Frame] = []
    # As bytes: a file's name need not be UTF-8.
    for number, line in enumerate(sys.stdin.buffer, start=1):
        text = os.fsdecode(line).rstrip("\r\n")
        if text.strip():
            frame = _listed_frame(number, text)
            first = lines.setdefault(frame.name, number)
            if first != number:
                raise SourceError(at(STDIN, number, f"{frame.name} is named in line {first} already; remove one"))
            if frames and math.isnan(frame.time) != math.isnan(frames[0].time):
                raise SourceError(at(STDIN, number, "some lines have seconds and others do not; give all or none"))
            frames.append(frame)
    if not frames:
        raise SourceError(f"{STDIN}: names no image; give the path of an image a line")
    positions = [(frame.place, f"{STDIN}:{lines[frame.name]}") for frame in frames if frame.place]
    if not math.isnan(frames[0].time):
        frames.sort(key=lambda frame: frame.time)
    elif rate is not None:
        frames = [replace(frame, time=number / rate) for number, frame in enumerate(frames)]
    return tuple(frames), positions


def _listed_frame(number: int, text: str) -> Frame:
    path, *more = text.split("\t")
    if not is_text(path):
        raise SourceError(at(STDIN, number, f"the name {os.fsencode(path)!r} is not UTF-8; rename the file"))
    if len(more) > 2 or not path or "\0" in path:
        raise SourceError(at(STDIN, number, f"{text!r} is not 'path [TAB seconds [TAB place]]'"))
    seconds, place = (*more, "", "")[:2]
    time = checked_seconds(STDIN, number, seconds) if seconds else math.nan
    return Frame(path, time, place and checked_place(STDIN, number, place), Path(path))
