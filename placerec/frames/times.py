"""When images were taken: time stamps in their names, lists of times beside them, a frame rate; and parts of a run.

Grammar of a list: a line an image, the time, and perhaps behind a comma or white space the image's name, with or
without folders; `#` begins a comment, which may name the unit of time as `[ns]`. Lists of TUM RGB-D (rgb.txt) and EuRoC
(data.csv) have names; those of KITTI (times.txt, timestamps.txt) have none, and lines in the order of the images.
"""

import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import SourceError, at, counted
from placerec.files import read_lines
from placerec.frames.intervals import checked_seconds
from placerec.frames.layouts import find_camera_root, seconds_in

# TUM RGB-D; and digits as many as milli-, micro- (RobotCar, NCLT) or nanoseconds (EuRoC) since 1970 have.
_DECIMAL = re.compile(r"(\d{10}\.\d+)\.[^.]+")
_INTEGER = re.compile(r"([1-9]\d{12}|[1-9]\d{15}|[1-9]\d{18})\.[^.]+")
_PER_SECOND = {13: 10**3, 16: 10**6, 19: 10**9}
_UNITS = {"ns": 10**9, "us": 10**6, "ms": 10**3, "s": 1}
_UNIT = re.compile(rf"[\[(]({'|'.join(_UNITS)})[\])]")
_DATE = re.compile(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d:\d\d)(\.\d+)?")
_NAME = re.compile(r".+\.[A-Za-z]\w+")
_NUMBER = re.compile(r"(.*?)(\d+)(?:\.[a-z]+)?\.[^.]+")
_LISTS = ("times.txt", "timestamps.txt")


def stamp_in(name: str) -> float | None:
    """The seconds since 1970 that are an image's name: `1305031102.175304.png`, or milli-, micro- or nanoseconds."""
    if match := _DECIMAL.fullmatch(name):
        return float(match[1])
    match = _INTEGER.fullmatch(name)
    return int(match[1]) / _PER_SECOND[len(match[1])] if match else None


def is_stamped(name: str) -> bool:
    """Whether an image's name is a robot's time stamp; milliseconds alone may as well be a telephone's."""
    return seconds_in(name) is not None or (stamp_in(name) is not None and len(name.partition(".")[0]) != 13)


def find_times_list(images: Path) -> Path | None:
    """The list of times of the images in a folder: within it, or, of a camera's, beside it or in the run."""
    images = Path(images.absolute())
    root = find_camera_root(images)
    found = [images / name for name in _LISTS]
    if root is not None:
        found += [images.with_name(f"{images.name}.txt")]
        # Between cam0/data/ and the run that cam0/ is a camera of; a data.csv elsewhere may hold anything.
        between = [folder for folder in images.parents if folder.is_relative_to(root)]
        found += [folder / name for folder in between for name in _LISTS]
        found += [folder / "data.csv" for folder in between if folder != root]
    return next((path for path in found if path.is_file()), None)


def read_times(path: Path, images: Sequence[str]) -> Floats:
    """The seconds float64 (n,) of images (file names in natural order) in a list of times.

    Raises SourceError naming file and line: no time, none for an image, not as many as there are images.
    """
    named: dict[str, float] = {}
    listed: list[float] = []
    unit = None
    for number, line in enumerate(read_lines(path, SourceError), start=1):
        text = line.strip()
        if not listed and text and text[0] not in "+-.0123456789":
            unit = unit or _UNIT.search(text)
        elif text and not text.startswith("#"):
            first, *more = re.split(r"[,\s]+", text)
            listed.append(_time(path, number, text, first, _UNITS[unit[1]] if unit else 0))
            named |= {Path(field).name: listed[-1] for field in more if _NAME.fullmatch(field)}
    if named:
        missing = [image for image in images if image not in named]
        if missing:
            raise SourceError(f"{path}: gives {counted(len(missing), 'image')} no time (first: {missing[0]}); add them")
        return np.array([named[image] for image in images], np.float64)
    numbers = list(range(len(images)))
    if len(listed) != len(images):
        # Some were taken out: their numbers count from 0.
        numbers = [int(match[2]) if (match := _NUMBER.fullmatch(image)) else len(listed) for image in images]
        if max(numbers, default=0) >= len(listed):
            raise SourceError(
                f"{path}: has {counted(len(listed), 'time')} for {counted(len(images), 'image')}; mend it, or remove it"
            )
    return np.array(listed, np.float64)[numbers]


def _time(path: Path, number: int, text: str, first: str, per_second: int) -> float:
    if match := _DATE.match(text):
        try:
            whole = datetime.fromisoformat(f"{match[1]}T{match[2]}+00:00").timestamp()
        except ValueError as error:
            raise SourceError(at(path, number, f"{match[0]!r} is no date; mend it")) from error
        return whole + float(match[3] or 0)
    if not per_second:
        per_second = _PER_SECOND.get(len(first), 1) if first.isdecimal() else 1
    return (int(first) if first.isdecimal() else checked_seconds(path, number, first)) / per_second


def times_at_rate(images: Sequence[str], rate: float) -> Floats:
    """Seconds float64 (n,) from the first of n images, `rate` a second; numbers that are left out in names count."""
    found = [_NUMBER.fullmatch(image) for image in images]
    numbers = [int(match[2]) for match in found if match]
    if len(numbers) < len(images) or len({match[1] for match in found if match}) > 1 or numbers != sorted(set(numbers)):
        numbers = list(range(len(images)))
    return (np.array(numbers, np.float64) - (numbers or [0])[0]) / rate


def part_of(times: Floats, begin: float, end: float | None, name: str) -> slice:
    """Which frames of these ascending times (n,) are from second `begin` to `end`, counted from the first frame.

    Raises SourceError that begins with `name` if a frame has no time.
    """
    if not begin and end is None:
        return slice(None)
    if np.isnan(times).any():
        raise SourceError(f"{name}: its frames have no times, by which --from and --to go; give --rate HZ")
    seconds = np.round(times - times[:1], 6)
    first, last = np.searchsorted(seconds, [begin, np.inf if end is None else end])
    return slice(int(first), int(last))
