"""Names of sequences: the folder's or the file's own, with the parent's in front where two are equal."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from placerec.errors import PlacerecError
from placerec.frames.layouts import find_vpc_list


def own_name(source: Path) -> str:
    """What the sequence in this folder or file is called: as it is, without suffix; a floor of VPC as HOME-FLOOR."""
    # Not resolve(): a link keeps the name that the user gave it.
    path = Path(os.path.abspath(source))
    if path.is_file():
        return path.stem
    return f"{path.parent.name}-{path.name}" if find_vpc_list(path) else path.name


def unique_names(named: Sequence[tuple[str, Path]], error: type[PlacerecError]) -> list[str]:
    """A name for each pair of own name and path; `error` names both paths where two stay equal."""
    count = Counter(name for name, _ in named)
    names = [with_parent(name, path) if count[name] > 1 else name for name, path in named]
    seen: dict[str, Path] = {}
    for name, (_, path) in zip(names, named, strict=True):
        first = seen.setdefault(name, path)
        if first is not path:
            raise error(f"{path}: is named {name}, as {first} is; rename one of them")
    return names


def with_parent(name: str, path: Path) -> str:
    """`name` behind the name of the folder that holds `path`."""
    # Not resolve(): a link keeps the name that the user gave it.
    path = Path(os.path.abspath(path))
    # Past the second folder of the same name that some archives unpack to: the name is wanted, not its echo.
    while path.parent.name == path.name != "":
        path = path.parent
    return f"{path.parent.name}-{name}"
