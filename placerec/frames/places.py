"""Names of places, and places.lst, which gives them to images.

Grammar of places.lst (COLD, readings 4.1): one line per image, `<file name> <label>`, split at the last white space.
UTF-8 with or without a byte order mark; LF or CRLF; lines in any order; blank lines mean nothing.
"""

import sys
import unicodedata
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from placerec.errors import PlacerecError, SourceError, at
from placerec.files import read_lines

# The columns of the token and belief files, which stand beside the places there.
COLUMNS = frozenset({"frame", "time", "place", "word", "distance", "selected", "best", "unknown"})


@dataclass(frozen=True)
class PlaceList:
    """The labels of images: image name -> place, and image name -> the line (from 1) that says so."""

    path: Path
    places: dict[str, str]
    lines: dict[str, int]

    def positions(self) -> Iterator[tuple[str, str]]:
        """Every place, and the file and line that name it."""
        return ((place, f"{self.path}:{self.lines[image]}") for image, place in self.places.items())


def check_place(name: str) -> str | None:
    """Why `name` cannot be a place's name (a place is a file name and a column header), or None if it can."""
    if not name:
        return "is empty"
    if name.startswith("."):
        return "starts with a dot"
    if name in COLUMNS:
        return "is the name of a column in placerec's files"
    for character in name:
        if character in "/\\":
            return f"holds a {character}"
        if character.isspace():
            return "holds white space"
        if not character.isprintable():
            return f"holds the control character U+{ord(character):04X}"
    return None


def checked_place(path: Path | str, line: int, name: str, error: type[PlacerecError] = SourceError) -> str:
    """`name` if it can be a place's name, else an `error` with its position."""
    if reason := check_place(name):
        raise error(at(path, line, f"place {name!r} {reason}; rename it"))
    return name


def check_twins(places: Iterable[tuple[str, str]]) -> None:
    """Raise SourceError if two places differ in case alone; `places` are pairs of a name and where it stands.

    Their files (PLACE.arpa) would be one file where the file system ignores case.
    """
    seen: dict[str, tuple[str, str]] = {}
    for name, where in places:
        twin, position = seen.setdefault(unicodedata.normalize("NFC", name).casefold(), (name, where))
        if twin != name:
            raise SourceError(f"{where}: place {name!r} differs only in case from {twin!r} ({position}); rename one")


def read_places(path: Path, images: Collection[str] = ()) -> PlaceList:
    """The labels in a places.lst; `images` are the sequence's file names, by which labels with spaces are caught.

    Raises SourceError naming file and line: no label, a name that cannot be a place's, two labels for one image.
    """
    return parse_places(read_lines(path, SourceError), path, images)


def parse_places(text: Iterable[str], path: Path, images: Collection[str] = ()) -> PlaceList:
    """The labels in the lines of a places.lst, which `path` names; raises what `read_places` raises."""
    places: dict[str, str] = {}
    lines: dict[str, int] = {}
    for number, line in enumerate(text, start=1):
        if not line.strip():
            continue
        image, place = _split(path, number, line.strip(), images)
        # One string for all frames of a place.
        place = checked_place(path, number, sys.intern(place))
        if places.setdefault(image, place) != place:
            message = (
                f"{image} is labelled {place}, but {places[image]} in line {lines[image]}; remove one of the lines"
            )
            raise SourceError(at(path, number, message))
        lines.setdefault(image, number)
    return PlaceList(path, places, lines)


def _split(path: Path, number: int, line: str, images: Collection[str]) -> tuple[str, str]:
    fields = line.rsplit(maxsplit=1)
    if len(fields) < 2 or line in images:
        raise SourceError(at(path, number, f"no label in {line!r}; a line is '<file name> <label>'"))
    image, place = fields
    if image not in images:
        first, rest = line.split(maxsplit=1)
        if first in images:
            raise SourceError(at(path, number, f"place {rest!r} holds white space; rename it"))
    return image, place
