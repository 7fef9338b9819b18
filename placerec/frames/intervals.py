"""Labels of stretches of time: NAME.labels, which gives frames their places by their times.

Grammar of NAME.labels: lines `start end place` in seconds, in any order; UTF-8; `#` begins a comment, blank lines mean
nothing. An interval holds its start and not its end.
"""

import logging
import math
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from placerec.errors import SourceError, at, counted
from placerec.files import number_in, read_lines
from placerec.frames.places import checked_place
from placerec.frames.sequence import EPOCH

SUFFIX = ".labels"
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Interval:
    """A stretch of a recording in one place: `start` <= seconds < `end`, as said in a line (from 1) of the file."""

    start: float
    end: float
    place: str
    line: int


@dataclass(frozen=True)
class Intervals:
    """A labels file: its intervals, which do not overlap, in order of time."""

    path: Path
    intervals: tuple[Interval, ...]

    def positions(self) -> Iterator[tuple[str, str]]:
        """Every place, and the file and line that name it."""
        return ((one.place, f"{self.path}:{one.line}") for one in self.intervals)

    def places(self, times: Sequence[float], clock: str = "auto") -> list[str]:
        """The place at each of these times (in order), "" where there is none.

        `clock`: see `SourceOptions.label_clock`. "auto" counts from the first frame if no interval reaches it: nobody
        writes down the seconds since 1970 that a bag's stamps count. Of the reading that was taken it tells unless
        times are since 1970, and warns where the other one gives other places.
        """
        if not times or not self.intervals:
            return [""] * len(times)
        from_start = clock == "start" or (clock == "auto" and self.intervals[-1].end <= times[0])
        found = self.places_at(times, times[0] if from_start else 0.0)
        if clock == "auto" and times[0] and (from_start or times[0] < EPOCH):
            other = self.places_at(times, 0.0 if from_start else times[0])
            if times[0] >= EPOCH or found == other:
                level, remedy = logging.INFO, ""
            else:
                level, remedy = logging.WARNING, f"; if not, say --label-clock {'stamps' if from_start else 'start'}"
            what = "counted from the first frame" if from_start else f"the frames', of which the first is {times[0]:g}"
            log.log(level, "%s: its seconds are %s%s", self.path, what, remedy)
        if not any(found):
            log.warning("%s: labels none of the %s", self.path, counted(len(times), "frame"))
        return found

    def places_at(self, times: Sequence[float], zero: float) -> list[str]:
        """The place at each of these times, "" where there is none; the file's seconds count from `zero`."""
        starts = [one.start for one in self.intervals]
        found = []
        for time in times:
            # The seconds since 1970 have no more digits than this.
            seconds = round(time - zero, 6)
            k = bisect_right(starts, seconds) - 1
            found.append(self.intervals[k].place if k >= 0 and seconds < self.intervals[k].end else "")
        return found


def read_intervals(path: Path) -> Intervals:
    """Read a labels file.

    Raises SourceError naming file and line: what is no interval, one that ends before it starts, two that overlap, a
    name that cannot be a place's.
    """
    return parse_intervals(read_lines(path, SourceError), path)


def parse_intervals(lines: Iterable[str], path: Path) -> Intervals:
    """The intervals in the lines of a labels file, which `path` names; raises what `read_intervals` raises."""
    found = []
    for number, line in enumerate(lines, start=1):
        fields = line.partition("#")[0].split()
        if fields:
            found.append(_interval(path, number, fields))
    found.sort(key=lambda one: (one.start, one.line))
    for before, one in pairwise(found):
        if one.start < before.end:
            what = f"{one.start:g} to {one.end:g} overlaps {before.start:g} to {before.end:g} of line {before.line}"
            raise SourceError(at(path, one.line, f"{what}; change one of them"))
    return Intervals(path, tuple(found))


def find_intervals(
    source: Path, name: str, labels: Path | None, *, alone: bool, images: bool = False
) -> Intervals | None:
    """The labels of the recording, or the folder of `images`, that is called `name`; None where there are none.

    `labels`: the file of the only recording, or a folder that holds NAME.labels for each; None: STEM.labels beside the
    source. Raises SourceError for one file and several recordings, and for what cannot be read.
    """
    if labels is not None and not labels.is_dir():
        if not alone:
            raise SourceError(f"{labels}: is one file for several recordings; name a folder that holds {name}{SUFFIX}")
        return read_intervals(labels)
    path = intervals_beside(source) if labels is None else labels / f"{name}{SUFFIX}"
    if path.exists():
        return read_intervals(path)
    missing = "places.lst" if labels is None and images else path
    log.log(logging.INFO if labels is None else logging.WARNING, "%s: no %s; its frames have no label", source, missing)
    return None


def intervals_beside(source: Path) -> Path:
    """Where the labels of a recording or a folder of images are looked for: NAME.labels beside it."""
    here = source if source.name not in ("", "..") else Path(os.path.abspath(source))
    return here.parent / f"{here.name if here.is_dir() else here.stem}{SUFFIX}"


def _interval(path: Path, number: int, fields: list[str]) -> Interval:
    if len(fields) != 3:
        line = " ".join(fields)
        raise SourceError(at(path, number, f"{line!r} is not 'start end place'; a place's name holds no white space"))
    start, end = (checked_seconds(path, number, field) for field in fields[:2])
    if end <= start:
        raise SourceError(at(path, number, f"the interval {fields[0]} to {fields[1]} ends before it starts; mend it"))
    return Interval(start, end, checked_place(path, number, fields[2]), number)


def checked_seconds(path: Path | str, number: int, field: str) -> float:
    """The seconds that a field says, else a SourceError with its position."""
    seconds = number_in(field)
    if not math.isfinite(seconds):
        raise SourceError(at(path, number, f"{field!r} is not a number of seconds; mend it"))
    return seconds
