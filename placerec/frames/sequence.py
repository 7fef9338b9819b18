"""What every source of images is turned into, sequences of frames, and how it is asked for."""

import collections.abc
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError

Gray = NDArray[np.uint8 | np.float32]
Colours = NDArray[np.uint8]
# The seconds since 1970 in 2001: what is less counts from something else, as from the start of a robot or a simulation.
EPOCH = 10**9


@dataclass(frozen=True, slots=True, eq=False)
class ColourImage:
    """An image in colours: `colours` (h, w, 3) blue, green, red of 0..255.

    `gray` (h, w): byte for byte what is read where nobody wants colours.
    """

    gray: Gray
    colours: Colours


Image = Gray | ColourImage


def gray_levels(image: Image) -> Gray:
    """The grey levels (h, w) of an image that may be in colours."""
    return image.gray if isinstance(image, ColourImage) else image


def shown_pixels(image: Image | str) -> Gray | str:
    """The colours (h, w, 3) of an image, its grey levels (h, w) if it has none, or the reason why there is none."""
    return image.colours if isinstance(image, ColourImage) else image


@dataclass(frozen=True, slots=True)
class Frame:
    """One image of a sequence; nothing of it is decoded until it is asked for.

    `name`: the image's file name, or its number in a recording. `time`: seconds, nan where the source has no time
    stamps. `place`: "" where unlabelled. `path`: the image file, or the recording that the frame is in.
    """

    name: str
    time: float
    place: str
    path: Path


class Recording(Protocol):
    """What holds the images of a sequence that are not files of their own: a video, a bag, a camera.

    `endless`: a camera, whose frames are known only as they come; `Sequence.frames` is empty then.
    """

    @property
    def endless(self) -> bool: ...

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
        """The frames in order from index `first`, each with its grey levels 0..255 or the reason why it has none.

        `colours`: with a `ColourImage` in place of the grey levels.
        """

    def picture(self, index: int) -> Gray | str:
        """The frame at `index` for people to look at, in colours, (h, w, 3) blue, green, red, where that costs nothing;
        or why there is none."""

    def files(self) -> list[Path]:
        """The files that it is read from: if none of them changed, neither did a frame."""


@dataclass(frozen=True, slots=True)
class Sequence:
    """One run of a camera: its frames in time order.

    `source`: the folder or file that it was read from. `recording`: None if every frame is an image file of its own.
    """

    name: str
    frames: collections.abc.Sequence[Frame]
    source: Path
    recording: Recording | None = None


FORMATS = ("auto", "sequences", "places")
CLOCKS = ("auto", "stamps", "start")


@dataclass(frozen=True)
class SourceOptions:
    """How sources are to be read; the defaults fit most.

    `format`: what a folder of folders of images is: "sequences"; "places" (one folder per place: SOURCE/PLACE/ holds
    images); or "auto", which takes a folder of unlabelled, unstamped image folders for the latter and says so.
    `every`: of so many frames the first is read. `topic`: the topic of a bag, None for its only one of images.
    `labels`: the file of intervals that labels a video, a bag or timed images, or a folder of NAME.labels; None for
    NAME.labels beside it. `label_clock`: what the seconds in it are: "stamps", those of the frames' times; "start",
    counted from the first frame; or "auto", which takes them for the latter if all end before the first frame.
    `camera`: of several in a run, None for colour or the left one. `begin`, `end`: the part of each sequence that is
    read, in seconds from the first frame, without its end. `rate`: frames a second where images have no times. Raises
    SourceError for a value that does not exist.
    """

    format: str = "auto"
    every: int = 1
    topic: str | None = None
    labels: Path | None = None
    label_clock: str = "auto"
    camera: str | None = None
    begin: float = 0.0
    end: float | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise SourceError(f"format {self.format!r} is not known; choose one of {', '.join(FORMATS)}")
        if self.label_clock not in CLOCKS:
            raise SourceError(f"label clock {self.label_clock!r} is not known; choose one of {', '.join(CLOCKS)}")
        if not (0 <= self.begin < (inf if self.end is None else self.end)):
            end = "the end" if self.end is None else f"{self.end:g}"
            raise SourceError(f"from {self.begin:g} to {end} seconds is no part of a run; give 0 <= from < to")
        if self.rate is not None and not 0 < self.rate < inf:
            raise SourceError(f"a rate of {self.rate:g} frames a second is not possible; give one above 0")
        if self.every < 1:
            raise SourceError(f"every {self.every} frames is not possible; say 1 at least")
        if self.labels is not None and not self.labels.exists():
            raise SourceError(f"{self.labels}: no such file")
