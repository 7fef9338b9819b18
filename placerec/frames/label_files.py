"""Where the labels of a sequence lie, and what their file says with other labels: for who labels by hand.

A line that says still what is so stays as it is, to the byte: its spaces, its place in the file, its number's digits.
What is new is written as `image place` or `start end place`, by the grammars of `frames.places` and `frames.intervals`.
"""

from collections.abc import Iterator, Sequence as Ordered
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from placerec.errors import SourceError
from placerec.files import split_lines
from placerec.frames.folder import FileFrames
from placerec.frames.intervals import SUFFIX, Intervals, intervals_beside, parse_intervals, read_intervals
from placerec.frames.layouts import COLD_CAMERA, COLD_LIST, COLD_LIST_FOLDER, find_places_list, room_in
from placerec.frames.places import check_place, check_twins, parse_places
from placerec.frames.sequence import EPOCH, Sequence, SourceOptions

# Seconds to the end of a frame where there are no two to tell it by.
_STEP = 1.0


@dataclass(frozen=True)
class LabelFile:
    """The file that labels one sequence; it need not be there yet.

    `images`: file names of the frames, where each has a line of its own (places.lst); None: intervals (NAME.labels).
    `times`: seconds of all frames, counted as the file does.
    """

    path: Path
    images: tuple[str, ...] | None
    times: tuple[float, ...] = ()

    def places(self, text: str) -> list[str]:
        """The place of each frame by a text of the file, "" without a label; SourceError for what is no such text."""
        if self.images is not None:
            found = parse_places(split_lines(text), self.path, frozenset(self.images)).places
            places = [found.get(image, "") for image in self.images]
        else:
            places = parse_intervals(split_lines(text), self.path).places_at(self.times, 0.0)
        check_twins((place, str(self.path)) for place in dict.fromkeys(places))
        return places

    def text(self, places: Ordered[str], base: str = "") -> str:
        """The file's text for the place of each frame, "" without a label; `base`: its text up to now.

        Raises SourceError for a name that cannot be a place's, twins that differ in case alone, and for labels that
        intervals cannot tell: of two frames at one time.
        """
        for place in {*places} - {""}:
            if reason := check_place(place):
                raise SourceError(f"{self.path}: the place {place!r} {reason}; name it otherwise")
        check_twins((place, str(self.path)) for place in dict.fromkeys(places) if place)
        if self.images is not None:
            return _listed(base, self.images, places)
        made = _intervals(base, self, places)
        if self.places(made) != list(places):
            raise SourceError(f"{self.path}: frames at one time cannot be in two places; move the border by a frame")
        return made


def label_file(sequence: Sequence, options: SourceOptions = SourceOptions()) -> LabelFile:
    """The file that the labels of a sequence are read from, or would be; `options`: it was found with these.

    Raises SourceError for sequences that no file can label: a camera, a list on standard input, part of a run, and a
    folder that is labelled by its own name.
    """
    if options.every != 1 or options.begin or options.end is not None:
        raise SourceError(f"{sequence.source}: is read in part, and labels are of the whole; leave that out")
    frames, recording = sequence.frames, sequence.recording
    if recording is not None and not recording.endless:
        return _interval_file(sequence, options)
    if not isinstance(frames, FileFrames):
        raise SourceError(f"{sequence.source}: cannot be labelled in a file; name a folder of images, a video or a bag")
    images, folder = tuple(frames.table.names), frames.folder
    if found := find_places_list(sequence.source, folder):
        return LabelFile(found, images)
    timed = not np.isnan(frames.table.times).any()
    own = options.labels if options.labels is not None else intervals_beside(sequence.source)
    if timed and own.exists():
        return _interval_file(sequence, options)
    if {*frames.table.places} == {sequence.source.name} and not any(map(room_in, images[:1])):
        raise SourceError(f"{sequence.source}: is a folder of one place; for a drive say --format sequences")
    beside = sequence.source / COLD_LIST_FOLDER if folder.name == COLD_CAMERA else folder
    return LabelFile(beside / COLD_LIST, images)


def _interval_file(sequence: Sequence, options: SourceOptions) -> LabelFile:
    times = np.array([frame.time for frame in sequence.frames], np.float64)
    path = options.labels or intervals_beside(sequence.source)
    if path.is_dir():
        path = path / f"{sequence.name}{SUFFIX}"
    found = read_intervals(path) if path.exists() else None
    zero = times[0] if _counts_from_start(found, float(times[0]), options.label_clock) else 0.0
    return LabelFile(path, None, tuple(np.round(times - zero, 6).tolist()))


def _counts_from_start(found: Intervals | None, first: float, clock: str) -> bool:
    if clock != "auto":
        return clock == "start"
    # Without intervals: nobody wants to read the seconds since 1970. Below these only stamps are read as what they are.
    return found.intervals[-1].end <= first if found and found.intervals else first >= EPOCH


def _listed(base: str, images: Ordered[str], places: Ordered[str]) -> str:
    """A places.lst: lines of images in another place are changed, new ones stand behind those of their neighbours."""
    mark, lines, end = _lines(base)
    wanted = dict(zip(images, places, strict=True))
    known = frozenset(images)
    kept: list[str] = []
    behind: dict[str, int] = {}
    for line in lines:
        image = _image_of(line, known)
        if image is None:
            kept.append(line)
        elif place := wanted[image]:
            behind[image] = len(kept)
            kept.append(line if line.split()[-1] == place else _with_place(line, place))
    added: dict[int, list[str]] = {}
    spot = min(behind.values(), default=len(kept)) - 1
    for image, place in wanted.items():
        spot = behind.get(image, spot)
        if place and image not in behind:
            added.setdefault(spot, []).append(f"{image} {place}{end}")
    woven = [*added.get(-1, []), *(one for i, line in enumerate(kept) for one in (line, *added.get(i, [])))]
    return mark + _joined(woven, end)


def _image_of(line: str, images: frozenset[str]) -> str | None:
    fields = line.strip().rsplit(maxsplit=1)
    return fields[0] if len(fields) == 2 and fields[0] in images else None


def _with_place(line: str, place: str) -> str:
    body = line.rstrip()
    return body[: len(body) - len(body.split()[-1])] + place + line[len(body) :]


def _intervals(base: str, file: LabelFile, places: Ordered[str]) -> str:
    """A NAME.labels: lines of intervals that are still whole stay, and lines for the rest stand among them by time."""
    mark, lines, end = _lines(base)
    found = parse_intervals(split_lines(base), file.path)
    before = found.places_at(file.times, 0.0)
    edges = [*file.times, file.times[-1] + _step(file.times)] if file.times else []
    kept: list[tuple[float, int]] = []
    told = [False] * len(places)
    gone = set()
    for one in found.intervals:
        first, last = np.searchsorted(file.times, [one.start, one.end]).tolist()
        around = range(max(first - 1, 0), min(last + 1, len(places)))
        if all((places[i] == one.place) == (before[i] == one.place) for i in around):
            kept.append((one.start, one.line))
            told[first:last] = [True] * (last - first)
        else:
            gone.add(one.line)
    new: list[tuple[float, str]] = []
    for first, last, place in runs(["" if told[i] else place for i, place in enumerate(places)]):
        later = min((start for start, _ in kept if start >= edges[first]), default=np.inf)
        if place and (stop := min(edges[last], later)) > edges[first]:
            new.append((edges[first], f"{_seconds(edges[first])} {_seconds(stop)} {place}{end}"))
    added: dict[int, list[str]] = {}
    for start, line in new:
        earlier = [number for other, number in kept if other < start]
        added.setdefault(max(earlier, default=0), []).append(line)
    woven = list(added.get(0, []))
    for number, line in enumerate(lines, start=1):
        woven += [*([] if number in gone else [line]), *added.get(number, [])]
    return mark + _joined(woven, end)


def runs(values: Ordered[str]) -> Iterator[tuple[int, int, str]]:
    """The runs of equal values: the first index, the one behind the last, the value."""
    first = 0
    for i in range(1, len(values) + 1):
        if i == len(values) or values[i] != values[first]:
            yield first, i, values[first]
            first = i


def _step(times: Ordered[float]) -> float:
    steps = np.diff(times)
    return max(round(float(np.median(steps)), 6), 1e-6) if len(steps) else _STEP


def _seconds(value: float) -> str:
    return f"{value:.6f}".rstrip("0").rstrip(".")


def _lines(base: str) -> tuple[str, list[str], str]:
    """A text's byte order mark if it has one, the lines with their ends, and how a new line is to end."""
    mark = "\ufeff" if base.startswith("\ufeff") else ""
    lines = [f"{line}\n" for line in base.removeprefix(mark).split("\n")]
    lines[-1] = lines[-1].removesuffix("\n")
    return mark, lines if lines[-1] else lines[:-1], "\r\n" if lines[0].endswith("\r\n") else "\n"


def _joined(lines: Ordered[str], end: str) -> str:
    """The lines one behind the other; one that was the last may have had no end."""
    ended = [line if line.endswith("\n") else line + end for line in lines[:-1]]
    return "".join([*ended, *lines[-1:]])
