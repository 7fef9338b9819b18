"""Layouts of data sets: where images lie, and what their names and the label files beside them say.

COLD (readings 4.1): SEQUENCE/std_cam/ holds the images, SEQUENCE/localization/places.lst the labels.
KTH-IDOL2 (readings 4.3): SEQUENCE/png/ holds the images, whose names say when and in which room.
VPC (readings 4.4): HOME/label.txt labels ranges of numbers of the images HOME/FLOOR/%08d.jpg. Grammar of label.txt,
line by line: `FLOOR/` begins a floor; a number alone is how many images it has; `first last category` labels a range,
both ends included; `-1 -1 end` ends the floor, and a second one the labels: notes follow.
"""

import logging
import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path

from placerec.errors import SourceError, at
from placerec.files import read_lines
from placerec.frames.places import PlaceList, checked_place, read_places

COLD_CAMERA, IDOL_CAMERA = "std_cam", "png"
COLD_LIST, COLD_LIST_FOLDER = "places.lst", "localization"
VPC_LIST = "label.txt"
# In label.txt, on the way from one room to the next: no place of its own.
UNLABELLED = "transition"

_FLOAT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_POSE = rf"_x{_FLOAT}_y{_FLOAT}_a{_FLOAT}\.[^.]+"
# All three laboratories of COLD: Ljubljana writes %g, integers and exponents.
_COLD = re.compile(rf"t({_FLOAT}){_POSE}")
# Its images whose pose was not known. The point is asked for: a frame counter (t1.jpeg, t2.jpeg) is no clock.
_COLD_POSELESS = re.compile(r"t(\d+\.\d+)\.[^.]+")
_IDOL = re.compile(rf"t({_FLOAT})_r([A-Z]+){_POSE}")
_FLOOR = re.compile(r"([^\s/]+)/")
_NUMBERED = re.compile(r"(\d+)\.[^.]+")
log = logging.getLogger(__name__)


def seconds_in(name: str) -> float | None:
    """The seconds in an image's name, if it is one of COLD (`t%.6f_x%f_y%f_a%f.jpeg`, `t%.6f.jpeg`) or KTH-IDOL2."""
    match = _COLD.fullmatch(name) or _COLD_POSELESS.fullmatch(name) or _IDOL.fullmatch(name)
    return float(match[1]) if match else None


def room_in(name: str) -> str | None:
    """The room's code (BO, CR, EO, KT, PA) in an image's name of KTH-IDOL2 (`t%.6f_rBO_x%g_y%g_a%g.png`)."""
    match = _IDOL.fullmatch(name)
    return match[2] if match else None


def find_places_list(*folders: Path) -> Path | None:
    """The first places.lst in one of `folders` or in its localization/; None if there is none."""
    for folder in folders:
        for path in (folder / COLD_LIST, folder / COLD_LIST_FOLDER / COLD_LIST):
            if path.is_file():
                return path
    return None


def find_vpc_list(floor: Path) -> Path | None:
    """The label.txt that labels the images in the folder of a floor; None if there is none."""
    floor = floor if floor.name not in ("", "..") else Path(os.path.abspath(floor))
    path = floor.parent / VPC_LIST
    return path if path.is_file() and floor.name in _floors(path) else None


def read_labels(path: Path, folder: str, images: Collection[str]) -> PlaceList:
    """The labels in a places.lst or a label.txt of the images (file names) in the folder with this name.

    Raises SourceError naming file and line for what is not by the grammar: see `read_places`; of label.txt for what is
    no range, ranges that overlap, a name that cannot be a place's.
    """
    return _read_vpc(path, folder, images) if path.name == VPC_LIST else read_places(path, frozenset(images))


def _read_vpc(path: Path, floor: str, images: Collection[str]) -> PlaceList:
    """The labels of the images of one floor; frames of a transition have none."""
    numbers = {int(match[1]): name for name in images if (match := _NUMBERED.fullmatch(name))}
    places: dict[str, str] = {}
    lines: dict[str, int] = {}
    before: dict[int, int] = {}
    for line, fields in _section(path, floor):
        if len(fields) == 1 and fields[0].isdecimal():
            if int(fields[0]) != len(numbers):
                log.warning("%s: %s images are promised, %d are there", f"{path}:{line}", fields[0], len(numbers))
            continue
        first, last, place = _range(path, line, fields)
        for number in range(max(first, min(numbers, default=1)), min(last, max(numbers, default=0)) + 1):
            if number in before:
                raise SourceError(at(path, line, f"image {number} is labelled in line {before[number]}; change one"))
            before[number] = line
            if number in numbers and place != UNLABELLED:
                places[numbers[number]], lines[numbers[number]] = place, line
    return PlaceList(path, places, lines)


def _floors(path: Path) -> set[str]:
    """The floors in what may be any file, none if it does not begin with one."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            lines = [line.strip() for line in file if line.strip()]
    except OSError:
        return set()
    return {line[:-1] for line in lines if _FLOOR.fullmatch(line)} if lines and _FLOOR.fullmatch(lines[0]) else set()


def _section(path: Path, floor: str) -> Iterator[tuple[int, list[str]]]:
    """The lines of a floor with their numbers, split at white space."""
    inside: str | None = None
    for number, line in enumerate(read_lines(path, SourceError), start=1):
        fields = line.split()
        if not fields:
            continue
        if match := _FLOOR.fullmatch(line.strip()):
            inside = match[1]
        elif fields[-1] == "end":
            if inside is None:
                return
            inside = None
        elif inside == floor:
            yield number, fields


def _range(path: Path, line: int, fields: list[str]) -> tuple[int, int, str]:
    try:
        first, last, place = fields
        ends = int(first), int(last)
    except ValueError as error:
        raise SourceError(at(path, line, f"{' '.join(fields)!r} is not 'first last category'; mend it")) from error
    if ends[0] > ends[1]:
        raise SourceError(at(path, line, f"the range {first} to {last} ends before it starts; mend it"))
    return *ends, checked_place(path, line, place)
