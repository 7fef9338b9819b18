"""A folder of images, whatever its layout: what it holds, and its frames in order."""

import logging
import math
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from placerec.errors import SourceError
from placerec.frames.cold import parse_name
from placerec.frames.places import PlaceList
from placerec.frames.sequence import Frame

log = logging.getLogger(__name__)

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".pgm", ".ppm")
WANTED = "images (" + " ".join(f"*{suffix}" for suffix in SUFFIXES) + ")"


@dataclass(frozen=True)
class Listing:
    """What lies directly in a folder: names of images (in no order), and folders in natural order."""

    images: tuple[str, ...]
    folders: tuple[str, ...]


def natural_key(name: str) -> tuple[list[str | int], str]:
    """A sort key under which "img2" comes before "img10"; equal only for equal names."""
    # re.split alternates text and digits, so that positions of two keys always compare like with like.
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], name


def list_folder(folder: Path) -> Listing:
    """The images and folders in `folder`, hidden ones left out; no image is opened. SourceError if unreadable."""
    images, folders = [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith("."):
                    continue
                if entry.is_dir():
                    folders.append(entry.name)
                elif entry.name.lower().endswith(SUFFIXES):
                    images.append(entry.name)
    except OSError as error:
        raise SourceError(f"{folder}: cannot be read: {error.strerror}") from error
    return Listing(tuple(images), tuple(sorted(folders, key=natural_key)))


def read_frames(
    folder: Path, images: Iterable[str], *, labels: PlaceList | None = None, place: str = ""
) -> tuple[Frame, ...]:
    """The frames of `images` (file names in `folder`), in the order of their time stamps, else in natural order.

    Labels come from `labels`; without it all are `place`. Raises SourceError where some names carry a time stamp and
    others do not.
    """
    times = _times(folder, images)
    timeless = any(map(math.isnan, times.values()))
    order = sorted(times, key=natural_key if timeless else lambda name: (times[name], name))
    if labels:
        _report(labels, times)
    elif not place:
        log.info("%s: no places.lst; its frames have no label", folder)
    known = labels.places if labels else dict.fromkeys(order, place)
    return tuple(Frame(name, times[name], known.get(name, ""), folder / name) for name in order)


def _times(folder: Path, images: Iterable[str]) -> dict[str, float]:
    parsed = {name: parse_name(name) for name in images}
    timeless = [name for name, found in parsed.items() if found is None]
    if 0 < len(timeless) < len(parsed):
        first = folder / min(timeless, key=natural_key)
        stamped = len(parsed) - len(timeless)
        raise SourceError(f"{first}: no time stamp in its name, and {stamped} images there have one; remove it")
    return {name: math.nan if found is None else found[0] for name, found in parsed.items()}


def _report(labels: PlaceList, images: dict[str, float]) -> None:
    missing = [name for name in labels.places if name not in images]
    if missing:
        first = f"{missing[0]} in line {labels.lines[missing[0]]}"
        log.warning("%s: %d of its images are missing (first: %s)", labels.path, len(missing), first)
    unlabelled = sum(name not in labels.places for name in images)
    if unlabelled:
        log.info("%s: %d of %d images have no label", labels.path, unlabelled, len(images))
