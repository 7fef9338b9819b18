"""From what the user names to sequences: folders are searched, layouts told apart, names made unique."""

import logging
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from placerec.errors import SourceError
from placerec.frames.camera import find_camera
from placerec.frames.cold import CAMERA, LIST_FOLDER, find_list, parse_name
from placerec.frames.folder import WANTED, list_folder, read_frames
from placerec.frames.naming import unique_names
from placerec.frames.places import PlaceList, check_place, check_twins, read_places
from placerec.frames.reading import Reading
from placerec.frames.sequence import Sequence

log = logging.getLogger(__name__)

# COLD needs four (COLD/lab/part/sequence); the limit keeps a mistyped source from walking a whole disk.
MAX_DEPTH = 6


@dataclass(frozen=True)
class _Found:
    """A sequence that is not read yet: `camera` is the folder of its images, `place` its label if it is one place."""

    folder: Path
    camera: Path
    images: tuple[str, ...]
    places: Path | None = None
    place: str = ""


def find_sequences(
    sources: Iterable[Path | str], *, reading: Reading = Reading(), endless: bool = False
) -> list[Sequence]:
    """The sequences in `sources`, in the order given, within a source in natural order; no image is opened.

    A source is a sequence (COLD's layout, its std_cam/, or a folder of images) or a folder of sequences, searched
    downwards. `endless`: it may be a camera (`find_camera`), whose frames are known as they come. Raises SourceError
    for sources without images, labels that cannot be used, a sequence given twice, names that stay equal with the
    parent's name.
    """
    sources = [sources] if isinstance(sources, str | Path) else list(sources)
    if camera := find_camera(sources, endless):
        return [camera]
    paths = [Path(source) for source in sources]
    found = [item for path in paths for item in _in_source(path, reading.format)]
    _check_twice(found)
    names = unique_names([(_absolute(item.folder).name, item.folder) for item in found], SourceError)
    labels = [read_places(item.places, frozenset(item.images)) if item.places else None for item in found]
    check_twins(_positions(found, labels))
    return [
        Sequence(name, read_frames(item.camera, item.images, labels=its, place=item.place), item.folder)
        for name, item, its in zip(names, found, labels, strict=True)
    ]


def _in_source(source: Path, format: str) -> list[_Found]:
    if not source.exists():
        raise SourceError(f"{source}: no such folder")
    if not source.is_dir():
        raise SourceError(f"{source}: is a file, and a folder is expected: a sequence or a folder of sequences")
    if format == "places":
        return _place_folders(source)
    found = [_camera(source.parent, source)] if _absolute(source).name == CAMERA else _below(source)
    found = _without_aliases(found)
    if not found:
        raise SourceError(f"{source}: no sequence there; looked for {CAMERA}/ and {WANTED}, {MAX_DEPTH} folders deep")
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
    if CAMERA in listing.folders:
        return [_camera(folder, folder / CAMERA)]
    places = find_list(folder)
    if places and not listing.images:
        log.warning("%s: no %s/ and no images beside it; not read", places, CAMERA)
    itself = [_Found(folder, folder, listing.images, places)] if listing.images else []
    if itself and (places or any(map(parse_name, listing.images))):
        return itself
    inner = [folder / name for name in listing.folders if name != LIST_FOLDER]
    below = [item for path in inner for item in _below(path, depth + 1, seen | {real})]
    if below and itself:
        # Maps and previews lie beside sequences more often than sequences hold folders of images.
        log.warning("%s: its folders hold sequences; %d images beside them not read", folder, len(listing.images))
    return below or itself


def _camera(folder: Path, camera: Path) -> _Found:
    images = list_folder(camera).images
    if not images:
        raise SourceError(f"{camera}: holds no image; looked for {WANTED}")
    return _Found(folder, camera, images, find_list(folder, camera))


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
    return find_list(source) is None and all(
        item.folder == item.camera != source == item.camera.parent
        and item.folder.name != name
        and item.places is None
        and not any(map(parse_name, item.images))
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


def _positions(found: list[_Found], labels: list[PlaceList | None]) -> Iterator[tuple[str, str]]:
    """Every place with the file and line, or the folder, that names it."""
    for item, its in zip(found, labels, strict=True):
        if item.place:
            yield item.place, str(item.folder)
        elif its:
            yield from ((place, f"{its.path}:{its.lines[image]}") for image, place in its.places.items())


def _absolute(path: Path) -> Path:
    # Not resolve(): a link keeps the name that the user gave it.
    return Path(os.path.abspath(path))
