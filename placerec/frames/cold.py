"""COLD's layout (readings 4.1): SEQUENCE/std_cam/ holds the images, SEQUENCE/localization/places.lst the labels."""

import re
from pathlib import Path

CAMERA = "std_cam"
LIST = "places.lst"
LIST_FOLDER = "localization"

FLOAT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_POSED = re.compile(rf"t({FLOAT})_x{FLOAT}_y{FLOAT}_a{FLOAT}\.[^.]+")
# The point is asked for: a frame counter (t1.jpeg, t2.jpeg) is no clock.
_POSELESS = re.compile(r"t(\d+\.\d+)\.[^.]+")


def parse_time(name: str) -> float | None:
    """The seconds in the name of an image of COLD; None for any other name.

    All three laboratories are read (`t%.6f_x..._y..._a....jpeg`, where Ljubljana writes %g: integers and exponents),
    and the images whose pose was not known (`t%.6f.jpeg`).
    """
    match = _POSED.fullmatch(name) or _POSELESS.fullmatch(name)
    return float(match[1]) if match else None


def find_list(*folders: Path) -> Path | None:
    """The first places.lst in one of `folders` or in its localization/; None if there is none."""
    for folder in folders:
        for path in (folder / LIST, folder / LIST_FOLDER / LIST):
            if path.is_file():
                return path
    return None
