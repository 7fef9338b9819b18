"""A folder of images, whatever its layout: what it holds, and its frames in order."""

import logging
import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np

from placerec.arrays import Floats
from placerec.errors import SourceError, counted
from placerec.frames import bag, video
from placerec.frames.layouts import room_in, seconds_in
from placerec.frames.places import PlaceList
from placerec.frames.sequence import Frame
from placerec.frames.table import FrameTable
from placerec.frames.times import find_times_list, read_times, stamp_in, times_at_rate

log = logging.getLogger(__name__)

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".pgm", ".ppm")
# What devices, archivers and systems leave behind.
_NOT_OURS = frozenset({"@eaDir", "#recycle", "$RECYCLE.BIN", "__MACOSX", "lost+found", "System Volume Information"})
# Images that no OpenCV decodes, or only some do, or many at once.
_UNREAD = (
    *(".heic", ".heif", ".hif", ".avif", ".jxl", ".jp2", ".j2k", ".gif"),
    *(".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".exr", ".psd"),
)
_LABELS = re.compile(r"(?i)(label|place|class|room|annotation)\w*\.(csv|tsv|txt|lst|json|ya?ml|xml|labels)")
WANTED = "images (" + " ".join(f"*{suffix}" for suffix in SUFFIXES) + ")"


@dataclass(frozen=True)
class Listing:
    """What lies directly in a folder: names of images and of videos and bags, in no order, and of folders.

    `labels`: files that are called as labels are; `unread`: what is said of images that are left out.
    """

    images: tuple[str, ...]
    recordings: tuple[str, ...]
    folders: tuple[str, ...]
    labels: tuple[str, ...] = ()
    unread: str = ""


EMPTY = Listing((), (), ())


@dataclass(frozen=True, eq=False)
class FileFrames(Sequence[Frame]):
    """Frames that are files of one folder, each made of its row in the table when it is asked for."""

    folder: Path
    table: FrameTable

    def __len__(self) -> int:
        return len(self.table)

    def __iter__(self) -> Iterator[Frame]:
        table = self.table
        for name, time, place in zip(table.names, table.times.tolist(), table.places, strict=True):
            yield Frame(name, time, place, self.folder / name)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> "FileFrames": ...

    def __getitem__(self, index: int | slice) -> "Frame | FileFrames":
        if isinstance(index, slice):
            return FileFrames(self.folder, self.table.take(index))
        name = self.table.names[index]
        return Frame(name, float(self.table.times[index]), self.table.places[index], self.folder / name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FileFrames) and (self.folder, self.table) == (other.folder, other.table)

    def __hash__(self) -> int:
        return hash((self.folder, len(self)))


def natural_key(name: str) -> tuple[str, str]:
    """A sort key under which "img2" comes before "img10"; equal only for equal names."""
    # A number is told by its length first, behind a character that is before all others and in no name.
    return re.sub("[0-9]+", _number_key, name), name


def _number_key(match: re.Match[str]) -> str:
    digits = match[0].lstrip("0")
    return f"\0{chr(1 + len(digits))}{digits}"


def list_folder(folder: Path) -> Listing:
    """The images, recordings and folders in `folder`, hidden ones left out, nothing opened; SourceError if unreadable.

    Folders are in natural order. Images whose names are no text are left out: no file could name them.
    """
    images: list[str] = []
    nameless: list[str] = []
    recordings, folders, labels = [], [], []
    unread: Counter[str] = Counter()
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith(".") or entry.name in _NOT_OURS:
                    continue
                if _is_folder(entry):
                    folders.append(entry.name)
                elif entry.name.lower().endswith(SUFFIXES):
                    (images if is_text(entry.name) else nameless).append(entry.name)
                elif entry.name.lower().endswith(_UNREAD):
                    unread[os.path.splitext(entry.name)[1]] += 1
                elif _LABELS.fullmatch(entry.name):
                    labels.append(entry.name)
                elif _is_recording(folder / entry.name):
                    recordings.append(entry.name)
    except OSError as error:
        raise SourceError(f"{folder}: cannot be read: {error.strerror}") from error
    said = []
    if unread:
        suffixes = ", ".join(f"{count} *{suffix}" for suffix, count in sorted(unread.items()))
        said.append(f"{suffixes}; convert them to JPEG or PNG")
    if nameless:
        first = min(map(os.fsencode, nameless))
        said.append(f"{counted(len(nameless), 'image')} whose names are no text, as {first!r}; rename them")
    ordered = tuple(sorted(folders, key=natural_key))
    return Listing(tuple(images), tuple(recordings), ordered, tuple(sorted(labels)), ", and ".join(said))


def is_image(path: Path) -> bool:
    """Whether a path is called as an image is, and is no folder."""
    return path.name.lower().endswith(SUFFIXES) and not path.is_dir()


def holds_images(path: Path, depth: int) -> bool:
    """Whether a path is an image or a recording by name, or a folder with one in it or at most `depth` folders deeper.

    Raises SourceError for a folder that cannot be read.
    """
    if not path.is_dir():
        return is_image(path) or _is_recording(path)
    listing = list_folder(path)
    if listing.images or listing.recordings:
        return True
    return depth > 0 and any(holds_images(path / name, depth - 1) for name in listing.folders)


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() in bag.SUFFIXES or video.is_video(path)


def is_text(name: str) -> bool:
    """Whether a file's name can stand in a line of a file of ours: UTF-8, without tabs and line ends."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return "\t" not in name and len(f"{name}.".splitlines()) == 1


def _is_folder(entry: "os.DirEntry[str]") -> bool:
    try:
        return entry.is_dir()
    except OSError:
        # A link to itself: as an image it is named, and skipped.
        return False


def read_frames(
    folder: Path,
    images: Iterable[str],
    *,
    labels: PlaceList | None = None,
    place: str = "",
    rate: float | None = None,
) -> FileFrames:
    """The frames of `images` (file names in `folder`), in the order of their time stamps, else in natural order.

    Times are those in names as in COLD, of a list beside the images, in names that are numbers, or such that there are
    `rate` a second. Labels come from `labels`; without it from the names (KTH-IDOL2), else all are `place`. Raises
    SourceError where some names carry a time stamp as in COLD and others do not, and for a list that cannot be used.
    """
    names = sorted(images)
    times = _times(folder, names)
    if np.isnan(times).any():
        names.sort(key=natural_key)
        times = _other_times(folder, names, rate)
    if not np.isnan(times).any():
        by_time = np.argsort(times, kind="stable")
        names, times = [names[row] for row in by_time], times[by_time]
    if labels:
        _report(labels, names)
        places = [labels.places.get(name, "") for name in names]
    else:
        places = [room_in(name) or place for name in names]
    # What the sequence will be called is not known yet.
    return FileFrames(folder, FrameTable.of("", names, times, places))


def _times(folder: Path, images: Sequence[str]) -> Floats:
    """The seconds in the names, nan for all where none has any."""
    stamps = (math.nan if (found := seconds_in(name)) is None else found for name in images)
    times = np.fromiter(stamps, np.float64, len(images))
    timeless = np.isnan(times)
    if timeless.any() and not timeless.all():
        first = folder / min((images[row] for row in np.flatnonzero(timeless).tolist()), key=natural_key)
        stamped = len(images) - int(timeless.sum())
        raise SourceError(
            f"{first}: no time stamp in its name, and {counted(stamped, 'image')} there have one; remove it"
        )
    return times


def _other_times(folder: Path, names: Sequence[str], rate: float | None) -> Floats:
    if path := find_times_list(folder):
        return read_times(path, names)
    stamps = [stamp_in(name) for name in names]
    if None not in stamps:
        return np.array(stamps, np.float64)
    return np.full(len(names), np.nan) if rate is None else times_at_rate(names, rate)


def _report(labels: PlaceList, images: Sequence[str]) -> None:
    labelled = sum(name in labels.places for name in images)
    if labelled < len(labels.places):
        there = frozenset(images)
        missing = next(name for name in labels.places if name not in there)
        first = f"{missing} in line {labels.lines[missing]}"
        log.warning("%s: %d of its images are missing (first: %s)", labels.path, len(labels.places) - labelled, first)
    if labelled < len(images):
        log.info("%s: %d of %d images have no label", labels.path, len(images) - labelled, len(images))
