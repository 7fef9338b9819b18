"""VPC's layout (readings 4.4): HOME/label.txt labels ranges of numbers of the images HOME/FLOOR/%08d.jpg.

Grammar of label.txt, line by line: `FLOOR/` begins a floor; a number alone is how many images it has; `first last
category` labels a range, both ends included; `-1 -1 end` ends the floor, and a second one the labels: notes follow.
"""

import logging
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from placerec.errors import SourceError, at
from placerec.files import read_text
from placerec.frames.places import PlaceList, check_place

LIST = "label.txt"
# On the way from one room to the next: no place of its own.
UNLABELLED = "transition"

_FLOOR = re.compile(r"([^\s/]+)/")
_NUMBERED = re.compile(r"(\d+)\.[^.]+")
log = logging.getLogger(__name__)


def find_list(floor: Path) -> Path | None:
    """The label.txt that labels the images in the folder of a floor; None if there is none."""
    floor = floor if floor.name not in ("", "..") else Path(os.path.abspath(floor))
    path = floor.parent / LIST
    return path if path.is_file() and floor.name in _floors(path) else None


def read_places(path: Path, floor: str, images: Iterable[str]) -> PlaceList:
    """The labels of the images (file names) of one floor; frames of a transition have none.

    Raises SourceError naming file and line: what is no range, ranges that overlap, a name that cannot be a place's.
    """
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
    for number, line in enumerate(read_text(path, SourceError).removeprefix("\ufeff").split("\n"), start=1):
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
    if reason := check_place(place):
        raise SourceError(at(path, line, f"place {place!r} {reason}; rename it"))
    return *ends, place
