"""Layouts of data sets: where images lie, and what their names and the label files beside them say.

COLD (readings 4.1): SEQUENCE/std_cam/ holds the images, SEQUENCE/localization/places.lst the labels.
KTH-IDOL2 (readings 4.3): SEQUENCE/png/ holds the images, whose names say when and in which room.
VPC (readings 4.4): HOME/label.txt labels ranges of numbers of the images HOME/FLOOR/%08d.jpg. Grammar of label.txt,
line by line: `FLOOR/` begins a floor; a number alone is how many images it has; `first last category` labels a range,
both ends included; `-1 -1 end` ends the floor, and a second one the labels: notes follow.
Runs of several cameras, a folder each: rgb/ and depth/ (TUM RGB-D), image_0/ to image_3/ (KITTI), mav0/cam0/data/
(EuRoC), lb3/Cam0/ (NCLT), mono_left/ and stereo/left/ (RobotCar); or a suffix each: *.color.png and *.depth.png
(7-Scenes). One is read, the colour or the left one unless another is asked for, and depth never.
"""

import logging
import os
import re
from collections.abc import Collection, Iterable, Iterator
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


# A camera's folder, and folders between it and the run, and between it and its images.
_CAMERA = re.compile(
    r"(?i)rgb|colou?r|gr[ae]y|ir|infra[12]?|image_?(\d+|left|right)|cam_?\d+|camera_?\d+|left|right|cent(re|er)"
    r"|mono_(left|right|rear)"
)
ABOVE_CAMERAS, BELOW_CAMERA = ("mav0", "lb3", "stereo"), ("data", "images")
_DEPTH = re.compile(r"(?i)(.*_)?depth(_?(raw|registered|aligned|images?|\d+))?")
# The cameras that are read by default: colour, left of colour (KITTI), left, middle, to the front (NCLT), the first.
_PREFERRED = [re.compile(text) for text in (r"(?i)rgb|colou?r", "image_0?2", "(?i).*left", "(?i)cent.*", "Cam5", ".*")]
_WITH_CAMERA = re.compile(r"(?i).*[._-](rgb|colou?r|gr[ae]y|ir|left|right|depth)\.[^.]+")


def seconds_in(name: str) -> float | None:
    """The seconds in an image's name, if it is one of COLD (`t%.6f_x%f_y%f_a%f.jpeg`, `t%.6f.jpeg`) or KTH-IDOL2."""
    match = _COLD.fullmatch(name) or _COLD_POSELESS.fullmatch(name) or _IDOL.fullmatch(name)
    return float(match[1]) if match else None


def room_in(name: str) -> str | None:
    """The room's code (BO, CR, EO, KT, PA) in an image's name of KTH-IDOL2 (`t%.6f_rBO_x%g_y%g_a%g.png`)."""
    match = _IDOL.fullmatch(name)
    return match[2] if match else None


def find_camera_root(folder: Path) -> Path | None:
    """The folder of the run that a folder of images is a camera of; None if it is not called so."""
    camera = folder.parent if folder.name in BELOW_CAMERA else folder
    if not _CAMERA.fullmatch(camera.name):
        return None
    return camera.parent.parent if camera.parent.name in ABOVE_CAMERAS else camera.parent


def is_depth(name: str) -> bool:
    """Whether a folder is called as those of depth images are."""
    return _DEPTH.fullmatch(name) is not None


def is_camera_folder(name: str) -> bool:
    """Whether a folder is called as that of one of several cameras is."""
    return _CAMERA.fullmatch(name) is not None


def cameras_in_names(images: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """The images of each camera, depth left out, where all names end in one of several: `*.color.png`; else none."""
    found: dict[str, list[str]] = {}
    for name in images:
        match = _WITH_CAMERA.fullmatch(name)
        if not match:
            return {}
        found.setdefault(match[1], []).append(name)
    pictures = {camera: tuple(names) for camera, names in found.items() if camera.lower() != "depth"}
    return pictures if len(found) > 1 else {}


def choose_camera(folder: Path, cameras: Collection[str], wanted: str | None) -> str:
    """The camera that is asked for, or the one that is read by default, which is told of.

    Raises SourceError if none is called so.
    """
    if wanted is not None:
        if wanted not in cameras:
            raise SourceError(f"{folder}: has no camera {wanted}; its cameras are: {', '.join(sorted(cameras))}")
        return wanted
    camera = next(name for kind in _PREFERRED for name in sorted(cameras) if kind.fullmatch(name))
    if len(cameras) > 1:
        log.info("%s: of its cameras %s, %s is read; for another say --camera", folder, ", ".join(cameras), camera)
    return camera


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
