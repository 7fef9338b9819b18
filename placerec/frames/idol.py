"""KTH-IDOL2's layout (readings 4.3): SEQUENCE/png/ holds the images, whose names say when, in which room and where."""

import re
from typing import NamedTuple

from placerec.frames.cold import FLOAT, Pose

CAMERA = "png"

_NAME = re.compile(rf"t({FLOAT})_r([A-Z]+)_x({FLOAT})_y({FLOAT})_a({FLOAT})\.[^.]+")


class Named(NamedTuple):
    """What an image's name says: seconds, the room's code (BO, CR, EO, KT, PA), and where the robot was."""

    time: float
    place: str
    pose: Pose


def parse_name(name: str) -> Named | None:
    """Time, room and pose of an image named as in KTH-IDOL2 (`t%.6f_rBO_x%g_y%g_a%g.png`); None for any other name."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    time, place, *pose = match.groups()
    return Named(float(time), place, Pose(*map(float, pose)))
