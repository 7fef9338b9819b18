"""COLD's layout (readings 4.1): SEQUENCE/std_cam/ holds the images, SEQUENCE/localization/places.lst the labels."""

import re
from pathlib import Path
from typing import NamedTuple

CAMERA = "std_cam"
LIST = "places.lst"
LIST_FOLDER = "localization"

FLOAT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_POSED = re.compile(rf"t({FLOAT})_x({FLOAT})_y({FLOAT})_a({FLOAT})\.[^.]+")
# The point is asked for: a frame counter (t1.jpeg, t2.jpeg) is no clock.
_POSELESS = re.compile(r"t(\d+\.\d+)\.[^.]+")


class Pose(NamedTuple):
    """Where the robot was: x and y in metres, the angle in radians."""

    x: float
    y: float
    angle: float


def parse_name(name: str) -> tuple[float, Pose | None] | None:
    """Time in seconds and pose of an image named as in COLD; None for any other name.

    All three laboratories are read (`t%.6f_x..._y..._a....jpeg`, where Ljubljana writes %g: integers and exponents),
    and the images whose pose was not known (`t%.6f.jpeg`: the pose is None).
    """
    if match := _POSED.fullmatch(name):
        time, x, y, angle = map(float, match.groups())
        return time, Pose(x, y, angle)
    if match := _POSELESS.fullmatch(name):
        return float(match[1]), None
    return None


def find_list(*folders: Path) -> Path | None:
    """The first places.lst in one of `folders` or in its localization/; None if there is none."""
    for folder in folders:
        for path in (folder / LIST, folder / LIST_FOLDER / LIST):
            if path.is_file():
                return path
    return None
