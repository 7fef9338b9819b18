"""From what the user names to sequences: folders are searched, layouts told apart, names made unique."""

import logging
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from placerec.errors import SourceError, counted
from placerec.frames.bag import is_bag
from placerec.frames.camera import find_camera
from placerec.frames.folder import (
    EMPTY,
    WANTED,
    FileFrames,
    Listing,
    is_image,
    is_text,
    list_folder,
    natural_key,
    read_frames,
)
from placerec.frames.image_list import LIST_NAME, STDIN, read_list
from placerec.frames.intervals import Intervals, find_intervals
from placerec.frames.layouts import (
    ABOVE_CAMERAS,
    BELOW_CAMERA,
    COLD_CAMERA,
    COLD_LIST_FOLDER,
    IDOL_CAMERA,
    cameras_in_names,
    choose_camera,
    find_camera_root,
    find_places_list,
    find_vpc_list,
    is_camera_folder,
    is_depth,
    read_labels,
    room_in,
)
from placerec.frames.naming import own_name, unique_names
from placerec.frames.places import check_place, check_twins
from placerec.frames.recordings import WANTED as RECORDED, is_recording, read_recording
from placerec.frames.sequence import Sequence, SourceOptions
from placerec.frames.table import Labels
from placerec.frames.times import find_times_list, is_stamped, part_of

log = logging.getLogger(__name__)

# COLD needs four (COLD/lab/part/sequence); the limit keeps a mistyped source from walking a whole disk.
MAX_DEPTH = 6
# What ImageFolder calls the folders of its folders of places.
SPLITS = frozenset({"train", "training", "val", "valid", "validation", "test"})
# Folders that are called so hold runs, whatever is in them, and are no places.
RUN_NAME = re.compile(r"(?i)(seq|sequence|run|drive|tour|traj|trajectory|session|scan|cam|camera|image)s?[-_ ]?\d*")
STREAM = Path("-")


@dataclass(frozen=True)
class _Found:
    """A sequence that is not read yet: `folder` names it, and `camera` holds its frames.

    `camera` is the folder of its images, or what is recorded in, of so many `cameras` if it is one of several; `place`
    its label if it is one place; `listing` all that is in the folder.
    """

    folder: Path
    camera: Path
    images: tuple[str, ...] = ()
    places: Path | None = None
    place: str = ""
    cameras: int = 0
    listing: Listing = EMPTY


def find_sequences(
    sources: Iterable[Path | str], *, options: SourceOptions = SourceOptions(), endless: bool = False
) -> list[Sequence]:
    """The sequences in `sources`, in the order given, within a source in natural order; no image is decoded.

    A source is a sequence (a folder of images, in a layout of docs/inputs.md or in none; a video, a bag), a folder of
    sequences, searched downwards, or `-`: a list of image files on standard input. `endless`: it may be a camera
    (`find_camera`), whose frames are known as they come. Raises SourceError for sources without images, labels that
    cannot be used, a sequence given twice, names that stay equal with the parent's name, and MissingExtraError for a
    bag without rosbags.
    """
    sources = [sources] if isinstance(sources, str | Path) else list(sources)
    if camera := find_camera(sources, options, endless):
        return [camera]
    paths = [Path(source) for source in sources]
    found = [item for path in paths for item in _in_source(path, options)]
    _check_twice(found)
    _tell_unused(found, options)
    one_file = options.labels is not None and not options.labels.is_dir()
    for item in found:
        if not is_text(_absolute(item.folder).name):
            raise SourceError(f"{item.folder}: its name is not UTF-8, or holds a tab or a line end; rename it")
    own = [LIST_NAME if item.folder == STREAM else own_name(item.folder) for item in found]
    names = unique_names([(name, item.folder) for name, item in zip(own, found, strict=True)], SourceError)
    takes = _is_recorded if any(map(_is_recorded, found)) else _is_unlabelled
    others = replace(options, labels=None) if one_file else options
    alone = sum(map(takes, found)) == 1
    read = [
        _read(item, name, options if takes(item) else others, alone=alone)
        for name, item in zip(names, found, strict=True)
    ]
    check_twins(chain.from_iterable(positions for _, positions in read))
    return _not_empty([sequence for sequence, _ in read], options)


def _read(
    item: _Found, name: str, options: SourceOptions, *, alone: bool
) -> tuple[Sequence, Iterable[tuple[str, str]]]:
    """A sequence, and each of its places with the file and line, or the folder, that names it.

    `alone`: nothing else takes a file of labels.
    """
    where: Iterable[tuple[str, str]] = ()
    if item.folder == STREAM:
        listed, where = read_list(options.rate)
        part = part_of(np.array([frame.time for frame in listed]), options.begin, options.end, STDIN)
        return Sequence(name, listed[part][:: options.every], item.folder), where
    if item.listing.unread:
        log.warning("%s: not read: %s", item.camera, item.listing.unread)
    if _is_recorded(item):
        intervals = find_intervals(item.camera, name, options.labels, alone=alone)
        frames, recording = read_recording(item.camera, intervals, options)
        return Sequence(name, frames, item.folder, recording), intervals.positions() if intervals else ()
    labels = None
    if item.places:
        labels = read_labels(item.places, _absolute(item.folder).name, item.images)
    files = read_frames(item.camera, item.images, labels=labels, place=item.place, rate=options.rate)
    if labels:
        where = labels.positions()
    elif item.place:
        where = [(item.place, str(item.folder))]
    elif files.table.labelled.any():
        where = [(frame.place, str(frame.path)) for frame in files if frame.place]
    elif intervals := find_intervals(item.folder, name, options.labels, alone=alone, images=True):
        files, where = _labelled(item, files, intervals, options), intervals.positions()
    elif item.listing.labels:
        named = ", ".join(item.listing.labels)
        log.warning("%s: %s not read; labels are in places.lst or %s.labels", item.camera, named, name)
    files = files[part_of(files.table.times, options.begin, options.end, str(item.folder))][:: options.every]
    return Sequence(name, files, item.folder), where


def _labelled(item: _Found, files: FileFrames, intervals: Intervals, options: SourceOptions) -> FileFrames:
    if np.isnan(files.table.times).any():
        log.warning("%s: labels by times, and %s has none; give --rate HZ", intervals.path, item.folder)
        return files
    places = intervals.places(files.table.times.tolist(), options.label_clock)
    return replace(files, table=replace(files.table, places=Labels(places)))


def _not_empty(sequences: list[Sequence], options: SourceOptions) -> list[Sequence]:
    """Those that have a frame in the part that is asked for; SourceError if none has."""
    some = [sequence for sequence in sequences if len(sequence.frames)]
    part = f"no frame from second {options.begin:g}" + (f" to {options.end:g}" if options.end is not None else "")
    if sequences and not some:
        raise SourceError(f"{sequences[0].source}: has {part}; choose another part (--from, --to)")
    for sequence in sequences:
        if not len(sequence.frames):
            log.warning("%s: has %s; left out", sequence.source, part)
    return some


def _is_recorded(item: _Found) -> bool:
    return not item.images and item.folder != STREAM


def _is_unlabelled(item: _Found) -> bool:
    return bool(item.images) and not item.places and not item.place


def _tell_unused(found: list[_Found], options: SourceOptions) -> None:
    if options.labels and found and not any(_is_recorded(item) or _is_unlabelled(item) for item in found):
        log.warning("%s: every source has labels of its own; not read", options.labels)
    if options.topic and found and not any(is_bag(item.camera) for item in found):
        log.warning("topic %s: no source is a bag", options.topic)
    if options.camera and found and not any(item.cameras for item in found):
        log.warning("camera %s: no source is a run of several cameras", options.camera)


def _in_source(source: Path, options: SourceOptions) -> list[_Found]:
    if source == STREAM:
        return [_Found(source, source)]
    if not source.exists():
        raise SourceError(f"{source}: no such file or folder")
    if is_recording(source):
        return [_Found(source, source)]
    if is_image(source):
        raise SourceError(f"{source}: is one image; name its folder, or a list of images (`-`)")
    if not source.is_dir():
        raise SourceError(f"{source}: is a file of no kind that is read; name a folder of {WANTED}, or {RECORDED}")
    # ImageFolder's splits hold a folder a place.
    listing = list_folder(source)
    splits = listing.folders
    roots = [source / name for name in splits] if splits and SPLITS.issuperset(splits) else [source]
    if options.format == "places":
        return [place for root in roots for place in _place_folders(root)]
    if _absolute(source).name == COLD_CAMERA:
        found = [_camera(source.parent, source)]
    else:
        found = _below(source, options.camera, listing)
    found = _without_aliases(found)
    if not found:
        wanted = f"{COLD_CAMERA}/, {WANTED}, {RECORDED}"
        if next(source.glob("*.tsv"), None):
            raise SourceError(f"{source}: holds no images, but .tsv files; train-lm and decode take token streams")
        raise SourceError(f"{source}: no sequence there; looked for {wanted}, {MAX_DEPTH} folders deep")
    if options.format == "auto" and _looks_like_places(roots, found):
        names = list(dict.fromkeys(item.folder.name for item in found))
        log.warning(
            "%s: read as one folder per place (%s); if they are sequences, say --format sequences",
            source,
            ", ".join(names[:3]) + (", ..." if len(names) > 3 else ""),
        )
        return [place for root in roots for place in _place_folders(root)]
    return found


def _below(
    folder: Path, camera: str | None, listing: Listing | None = None, depth: int = 0, seen: frozenset[str] = frozenset()
) -> list[_Found]:
    """The sequences at and below a folder; `listing`: what is in it, if that is known.

    `seen`: the real paths above it, where a loop of links would lead back.
    """
    real = os.path.realpath(folder)
    if real in seen or depth > MAX_DEPTH:
        return []
    listing = listing or list_folder(folder)
    if COLD_CAMERA in listing.folders:
        return [_camera(folder, folder / COLD_CAMERA)]
    if is_bag(folder):
        return [_Found(folder, folder)]
    if run := _run(folder, listing.folders, camera):
        return [run]
    places = find_places_list(folder) or find_vpc_list(folder)
    if places and not listing.images:
        log.warning("%s: no %s/ and no images beside it; not read", places, COLD_CAMERA)
    cameras = cameras_in_names(listing.images)
    images = cameras[choose_camera(folder, cameras, camera)] if cameras else listing.images
    owner = _owner(folder, images)
    itself = [_Found(owner, folder, images, places, cameras=len(cameras), listing=listing)] if images else []
    if listing.unread and not images:
        log.warning("%s: not read: %s", folder, listing.unread)
    if itself and (places or cameras or any(map(is_stamped, images))):
        if listing.recordings:
            log.warning("%s: its images are read, and not %s beside them", folder, ", ".join(listing.recordings))
        return itself
    below = []
    for name in sorted({*listing.folders, *listing.recordings} - {COLD_LIST_FOLDER}, key=natural_key):
        path = folder / name
        if is_depth(name):
            log.warning("%s: depth is no picture; not read", path)
            continue
        below += (
            [_Found(path, path)] if name in listing.recordings else _below(path, camera, None, depth + 1, seen | {real})
        )
    if below and itself:
        # Maps and previews lie beside sequences more often than sequences hold folders of images.
        log.warning("%s: holds sequences; %s beside them not read", folder, counted(len(listing.images), "image"))
    return below or itself


def _run(folder: Path, folders: Iterable[str], wanted: str | None) -> _Found | None:
    """The run in `folder` if there are cameras of one: the camera that is `wanted`, or is read by default."""
    cameras = _cameras(folder, folders)
    if not cameras:
        return None
    others = [name for name in folders if name not in cameras and name not in ABOVE_CAMERAS]
    if len(cameras) == 1 and not any(map(is_depth, others)):
        (alone,) = cameras.values()
        listed = find_times_list(alone.camera) is not None
        # A folder that is called left or grey may as well be a place among others.
        if not listed and any(list_folder(folder / name).images for name in others):
            return None
    return replace(cameras[choose_camera(folder, cameras, wanted)], cameras=len(cameras))


def _cameras(folder: Path, folders: Iterable[str]) -> dict[str, _Found]:
    """By name, the cameras of a run in `folder` that have images."""
    found: dict[str, _Found] = {}
    for name in folders:
        if name in ABOVE_CAMERAS:
            found |= _cameras(folder / name, list_folder(folder / name).folders)
        elif is_camera_folder(name):
            inside = (folder / name, *(folder / name / part for part in BELOW_CAMERA))
            if item := next(filter(None, map(_images_of_camera, inside)), None):
                found[name] = item
    return found


def _images_of_camera(path: Path) -> _Found | None:
    root = find_camera_root(path)
    if root is None or not path.is_dir() or not (listing := list_folder(path)).images:
        return None
    return _Found(root, path, listing.images, find_places_list(root, path), listing=listing)


def _owner(folder: Path, images: tuple[str, ...]) -> Path:
    """The folder that a sequence with images in `folder` is called after: KTH-IDOL2's holds png/, EuRoC's data/."""
    here = _absolute(folder)
    named = here.name == IDOL_CAMERA and all(map(room_in, images))
    return here.parent if named or (here.name in BELOW_CAMERA and is_camera_folder(here.parent.name)) else folder


def _camera(folder: Path, camera: Path) -> _Found:
    listing = list_folder(camera)
    if not listing.images:
        raise SourceError(f"{camera}: holds no image; looked for {WANTED}")
    return _Found(folder, camera, listing.images, find_places_list(folder, camera), listing=listing)


def _without_aliases(found: list[_Found]) -> list[_Found]:
    """`found` with each folder once, under its own name rather than a link's ("latest")."""
    chosen: dict[str, _Found] = {}
    for item in found:
        real = os.path.realpath(item.camera)
        if real not in chosen or chosen[real].folder.is_symlink():
            chosen[real] = item
    kept = {id(item) for item in chosen.values()}
    return [item for item in found if id(item) in kept]


def _looks_like_places(roots: list[Path], found: list[_Found]) -> bool:
    return (
        # One folder alone is no place: some archives unpack so.
        len({item.folder.name for item in found}) > 1
        and all(find_places_list(root) is None for root in roots)
        and all(
            item.folder == item.camera
            and item.camera.parent in roots
            and not RUN_NAME.fullmatch(item.folder.name)
            and item.places is None
            and not item.cameras
            and item.images
            and not any(map(is_stamped, item.images))
            and find_times_list(item.camera) is None
            for item in found
        )
    )


def _place_folders(source: Path) -> list[_Found]:
    found = []
    for name in list_folder(source).folders:
        folder = source / name
        listing = list_folder(folder)
        if not listing.images:
            log.warning("%s: holds no image; not read as a place", folder)
            continue
        if reason := check_place(name):
            raise SourceError(f"{folder}: place {name!r} {reason}; rename the folder")
        found.append(_Found(folder, folder, listing.images, place=name, listing=listing))
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
