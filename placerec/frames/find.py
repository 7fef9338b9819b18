"""From what the user names to sequences: folders are searched, layouts told apart, names made unique.

A list on standard input (`-`): the path of an image a line, optionally followed by TAB seconds, and TAB place.
"""

import logging
import math
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from placerec.errors import SourceError, at
from placerec.frames.bag import is_bag
from placerec.frames.camera import find_camera
from placerec.frames.folder import WANTED, list_folder, natural_key, read_frames
from placerec.frames.intervals import checked_seconds, find_intervals
from placerec.frames.layouts import (
    COLD_CAMERA,
    COLD_LIST_FOLDER,
    IDOL_CAMERA,
    find_places_list,
    find_vpc_list,
    read_labels,
    room_in,
    seconds_in,
)
from placerec.frames.naming import own_name, unique_names
from placerec.frames.places import check_place, check_twins, checked_place
from placerec.frames.recordings import WANTED as RECORDED, is_recording, read_recording
from placerec.frames.sequence import Frame, Sequence, SourceOptions

log = logging.getLogger(__name__)

# COLD needs four (COLD/lab/part/sequence); the limit keeps a mistyped source from walking a whole disk.
MAX_DEPTH = 6
STREAM = Path("-")
LIST_NAME, STDIN = "stdin", "<stdin>"


@dataclass(frozen=True)
class _Found:
    """A sequence that is not read yet: `folder` names it, and `camera` holds its frames.

    `camera` is the folder of its images, or what is recorded in; `place` its label if it is one place.
    """

    folder: Path
    camera: Path
    images: tuple[str, ...] = ()
    places: Path | None = None
    place: str = ""


def find_sequences(
    sources: Iterable[Path | str], *, options: SourceOptions = SourceOptions(), endless: bool = False
) -> list[Sequence]:
    """The sequences in `sources`, in the order given, within a source in natural order; no image is decoded.

    A source is a sequence (the layout of COLD, KTH-IDOL2 or VPC, or a folder of images; a video, a bag), a folder of
    sequences, searched downwards, or `-`: a list of image files on standard input. `endless`: it may be a camera
    (`find_camera`), whose frames are known as they come. Raises SourceError for sources without images, labels that
    cannot be used, a sequence given twice, names that stay equal with the parent's name, and MissingExtraError for a
    bag without rosbags.
    """
    sources = [sources] if isinstance(sources, str | Path) else list(sources)
    if camera := find_camera(sources, options, endless):
        return [camera]
    paths = [Path(source) for source in sources]
    found = [item for path in paths for item in _in_source(path, options.format)]
    _check_twice(found)
    _tell_unused(found, options)
    own = [LIST_NAME if item.folder == STREAM else own_name(item.folder) for item in found]
    names = unique_names([(name, item.folder) for name, item in zip(own, found, strict=True)], SourceError)
    alone = sum(_is_recorded(item) for item in found) == 1
    read = [_read(item, name, options, alone=alone) for name, item in zip(names, found, strict=True)]
    check_twins(chain.from_iterable(positions for _, positions in read))
    return [sequence for sequence, _ in read]


def _read(
    item: _Found, name: str, options: SourceOptions, *, alone: bool
) -> tuple[Sequence, Iterable[tuple[str, str]]]:
    """A sequence, and each of its places with the file and line, or the folder, that names it."""
    if item.folder == STREAM:
        frames, where = _read_list()
        return Sequence(name, frames[:: options.every], item.folder), where
    if _is_recorded(item):
        intervals = find_intervals(item.camera, name, options.labels, alone=alone)
        frames, recording = read_recording(item.camera, intervals, options)
        return Sequence(name, frames, item.folder, recording), intervals.positions() if intervals else ()
    labels = None
    if item.places:
        labels = read_labels(item.places, _absolute(item.folder).name, item.images)
    files = read_frames(item.camera, item.images, labels=labels, place=item.place)[:: options.every]
    if labels:
        return Sequence(name, files, item.folder), labels.positions()
    where = [(item.place, str(item.folder))] if item.place else [(f.place, str(f.path)) for f in files if f.place]
    return Sequence(name, files, item.folder), where


def _is_recorded(item: _Found) -> bool:
    return not item.images and item.folder != STREAM


def _tell_unused(found: list[_Found], options: SourceOptions) -> None:
    if options.labels and found and not any(map(_is_recorded, found)):
        log.warning("%s: labels videos and bags, and no source is one; not read", options.labels)
    if options.topic and found and not any(is_bag(item.camera) for item in found):
        log.warning("topic %s: no source is a bag", options.topic)


def _in_source(source: Path, format: str) -> list[_Found]:
    if source == STREAM:
        return [_Found(source, source)]
    if not source.exists():
        raise SourceError(f"{source}: no such file or folder")
    if is_recording(source):
        return [_Found(source, source)]
    if not source.is_dir():
        raise SourceError(f"{source}: is a file of no kind that is read; name a folder of {WANTED}, or {RECORDED}")
    if format == "places":
        return _place_folders(source)
    found = [_camera(source.parent, source)] if _absolute(source).name == COLD_CAMERA else _below(source)
    found = _without_aliases(found)
    if not found:
        wanted = f"{COLD_CAMERA}/, {WANTED}, {RECORDED}"
        raise SourceError(f"{source}: no sequence there; looked for {wanted}, {MAX_DEPTH} folders deep")
    if format == "auto" and _looks_like_places(source, found):
        log.warning(
            "%s: read as one folder per place (%s); if they are sequences, say --format sequences",
            source,
            ", ".join(item.folder.name for item in found[:3]) + (", ..." if len(found) > 3 else ""),
        )
        return _place_folders(source)
    return found


def _below(folder: Path, depth: int = 0, seen: frozenset[str] = frozenset()) -> list[_Found]:
    """The sequences at and below a folder. `seen`: the real paths above it, where a loop of links would lead back."""
    real = os.path.realpath(folder)
    if real in seen or depth > MAX_DEPTH:
        return []
    listing = list_folder(folder)
    if COLD_CAMERA in listing.folders:
        return [_camera(folder, folder / COLD_CAMERA)]
    if is_bag(folder):
        return [_Found(folder, folder)]
    places = find_places_list(folder) or find_vpc_list(folder)
    if places and not listing.images:
        log.warning("%s: no %s/ and no images beside it; not read", places, COLD_CAMERA)
    itself = [_Found(_owner(folder, listing.images), folder, listing.images, places)] if listing.images else []
    if itself and (places or any(seconds_in(name) is not None for name in listing.images)):
        if listing.recordings:
            log.warning("%s: its images are read, and not %s beside them", folder, ", ".join(listing.recordings))
        return itself
    below = []
    for name in sorted({*listing.folders, *listing.recordings} - {COLD_LIST_FOLDER}, key=natural_key):
        path = folder / name
        below += [_Found(path, path)] if name in listing.recordings else _below(path, depth + 1, seen | {real})
    if below and itself:
        # Maps and previews lie beside sequences more often than sequences hold folders of images.
        log.warning("%s: holds sequences; %d images beside them not read", folder, len(listing.images))
    return below or itself


def _owner(folder: Path, images: tuple[str, ...]) -> Path:
    """The folder that a sequence with images in `folder` is called after: in KTH-IDOL2 it holds png/."""
    named = _absolute(folder).name == IDOL_CAMERA and all(map(room_in, images))
    return _absolute(folder).parent if named else folder


def _camera(folder: Path, camera: Path) -> _Found:
    images = list_folder(camera).images
    if not images:
        raise SourceError(f"{camera}: holds no image; looked for {WANTED}")
    return _Found(folder, camera, images, find_places_list(folder, camera))


def _without_aliases(found: list[_Found]) -> list[_Found]:
    """`found` with each folder once, under its own name rather than a link's ("latest")."""
    chosen: dict[str, _Found] = {}
    for item in found:
        real = os.path.realpath(item.camera)
        if real not in chosen or chosen[real].folder.is_symlink():
            chosen[real] = item
    kept = {id(item) for item in chosen.values()}
    return [item for item in found if id(item) in kept]


def _looks_like_places(source: Path, found: list[_Found]) -> bool:
    # A folder in a folder of the same name is how some archives unpack, and no place.
    name = _absolute(source).name
    return find_places_list(source) is None and all(
        item.folder == item.camera != source == item.camera.parent
        and item.folder.name != name
        and item.places is None
        and item.images
        and all(seconds_in(name) is None for name in item.images)
        for item in found
    )


def _place_folders(source: Path) -> list[_Found]:
    found = []
    for name in list_folder(source).folders:
        folder = source / name
        images = list_folder(folder).images
        if not images:
            log.warning("%s: holds no image; not read as a place", folder)
            continue
        if reason := check_place(name):
            raise SourceError(f"{folder}: place {name!r} {reason}; rename the folder")
        found.append(_Found(folder, folder, images, place=name))
    if not found:
        raise SourceError(f"{source}: no folder of a place there; looked for {source}/PLACE/ with {WANTED}")
    return found


def _check_twice(found: list[_Found]) -> None:
    seen: dict[str, Path] = {}
    for item in found:
        first = seen.setdefault(os.path.realpath(item.camera), item.folder)
        if first is not item.folder:
            also = "" if first == item.folder else f" (also as {first})"
            raise SourceError(f"{item.folder}: is given twice{also}; name each sequence once")


def _absolute(path: Path) -> Path:
    # Not resolve(): a link keeps the name that the user gave it.
    return Path(os.path.abspath(path))


def _read_list() -> tuple[tuple[Frame, ...], list[tuple[str, str]]]:
    """The frames of a list, called as it calls them, and every place with the line that names it.

    Frames are in the order of their seconds, without any in that of the lines. Raises SourceError naming the line: no
    number, seconds in some lines alone, a name that cannot be a place's, a file named twice; and for an empty list.
    """
    if sys.stdin is None:
        raise SourceError("`-`: reads standard input, and that is closed")
    lines: dict[str, int] = {}
    frames: list[Frame] = []
    # As bytes: a file's name need not be UTF-8.
    for number, line in enumerate(sys.stdin.buffer, start=1):
        text = os.fsdecode(line).rstrip("\r\n")
        if text.strip():
            frame = _listed_frame(number, text)
            first = lines.setdefault(frame.name, number)
            if first != number:
                raise SourceError(at(STDIN, number, f"{frame.name} is named in line {first} already; remove one"))
            if frames and math.isnan(frame.time) != math.isnan(frames[0].time):
                raise SourceError(at(STDIN, number, "some lines have seconds and others do not; give all or none"))
            frames.append(frame)
    if not frames:
        raise SourceError(f"{STDIN}: names no image; give the path of an image a line")
    positions = [(frame.place, f"{STDIN}:{lines[frame.name]}") for frame in frames if frame.place]
    if not math.isnan(frames[0].time):
        frames.sort(key=lambda frame: frame.time)
    return tuple(frames), positions


def _listed_frame(number: int, text: str) -> Frame:
    path, *more = text.split("\t")
    if len(more) > 2 or not path or "\0" in path:
        raise SourceError(at(STDIN, number, f"{text!r} is not 'path [TAB seconds [TAB place]]'"))
    seconds, place = (*more, "", "")[:2]
    time = checked_seconds(STDIN, number, seconds) if seconds else math.nan
    return Frame(path, time, place and checked_place(STDIN, number, place), Path(path))
