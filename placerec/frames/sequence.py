"""What every source of images is turned into: sequences of frames."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Frame:
    """One image of a sequence; nothing of it is decoded until `read_gray(frame.path)`.

    `name`: the image's file name. `time`: seconds, nan where the source has no time stamps. `place`: "" where
    unlabelled.
    """

    name: str
    time: float
    place: str
    path: Path


@dataclass(frozen=True, slots=True)
class Sequence:
    """One run of a camera: its frames in time order. `source` is the folder that it was read from."""

    name: str
    frames: tuple[Frame, ...]
    source: Path
