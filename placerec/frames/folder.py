"""A folder of images, whatever its layout: what it holds, and its frames in order."""

import logging
import math
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from placerec.errors import SourceError
from placerec.frames import bag, cold, idol, video
from placerec.frames.places import PlaceList
from placerec.frames.sequence import Frame

log = logging.getLogger(__name__)

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".pgm", ".ppm")
RECORDINGS = (*video.SUFFIXES, *bag.SUFFIXES)
WANTED = "images (" + " ".join(f"*{suffix}" for suffix in SUFFIXES) + ")"


@dataclass(frozen=True)
class Listing:
    """What lies directly in a folder: names of images (in no order), of videos and bags (the same), and folders."""

    images: tuple[str, ...]
    recordings: tuple[str, ...]
    folders: tuple[str, ...]


def natural_key(name: str) -> tuple[list[str | int], str]:
    """A sort key under which "img2" comes before "img10"; equal only for equal names."""
    # re.split alternates text and digits, so that positions of two keys always compare like with like.
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], name


def list_folder(folder: Path) -> Listing:
    """The images, recordings and folders in `folder`, hidden ones left out, nothing opened; SourceError if unreadable.

    Folders are in natural order.
    """
    images, recordings, folders = [], [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith("."):
                    continue
                if entry.is_dir():
                    folders.append(entry.name)
                elif entry.name.lower().endswith(SUFFIXES):
                    images.append(entry.name)
                elif entry.name.lower().endswith(RECORDINGS):
                    recordings.append(entry.name)
    except OSError as error:
        raise SourceError(f"{folder}: cannot be read: {error.strerror}") from error
    return Listing(tuple(images), tuple(recordings), tuple(sorted(folders, key=natural_key)))


def stamp(name: str) -> float | None:
    """The seconds in an image's name, if it is one of COLD or KTH-IDOL2."""
    found = cold.parse_name(name)
    if found is not None:
        return found[0]
    named = idol.parse_name(name)
    return None if named is None else named.time


def read_frames(
    folder: Path, images: Iterable[str], *, labels: PlaceList | None = None, place: str = ""
) -> tuple[Frame, ...]:
    """The frames of `images` (file names in `folder`), in the order of their time stamps, else in natural order.

    Labels come from `labels`; without it from the names (KTH-IDOL2), else all are `place`. Raises SourceError where
    some names carry a time stamp and others do not.
    """
    times = _times(folder, images)
    timeless = any(map(math.isnan, times.values()))
    order = sorted(times, key=natural_key if timeless else lambda name: (times[name], name))
    if labels:
        _report(labels, times)
        known = labels.places
    else:
        known = {name: named.place if (named := idol.parse_name(name)) else place for name in order}
    if not labels and not any(known.values()):
        log.info("%s: no places.lst; its frames have no label", folder)
    return tuple(Frame(name, times[name], known.get(name, ""), folder / name) for name in order)


def _times(folder: Path, images: Iterable[str]) -> dict[str, float]:
    parsed = {name: stamp(name) for name in images}
    timeless = [name for name, found in parsed.items() if found is None]
    if 0 < len(timeless) < len(parsed):
        first = folder / min(timeless, key=natural_key)
        stamped = len(parsed) - len(timeless)
        raise SourceError(f"{first}: no time stamp in its name, and {stamped} images there have one; remove it")
    return {name: math.nan if found is None else found for name, found in parsed.items()}


def _report(labels: PlaceList, images: dict[str, float]) -> None:
    missing = [name for name in labels.places if name not in images]
    if missing:
        first = f"{missing[0]} in line {labels.lines[missing[0]]}"
        log.warning("%s: %d of its images are missing (first: %s)", labels.path, len(missing), first)
    unlabelled = sum(name not in labels.places for name in images)
    if unlabelled:
        log.info("%s: %d of %d images have no label", labels.path, unlabelled, len(images))
