"""KTH-IDOL2's layout (readings 4.3): SEQUENCE/png/ holds the images, whose names say when, in which room and where."""

import re
from typing import NamedTuple

from placerec.frames.cold import FLOAT

CAMERA = "png"

_NAME = re.compile(rf"t({FLOAT})_r([A-Z]+)_x{FLOAT}_y{FLOAT}_a{FLOAT}\.[^.]+")


class Named(NamedTuple):
    """What an image's name says: seconds, and the room's code (BO, CR, EO, KT, PA)."""

    time: float
    place: str


def parse_name(name: str) -> Named | None:
    """Time and room of an image named as in KTH-IDOL2 (`t%.6f_rBO_x%g_y%g_a%g.png`); None for any other name."""
    match = _NAME.fullmatch(name)
    return Named(float(match[1]), match[2]) if match else None
