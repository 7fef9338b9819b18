"""The file of `placerec describe` as a source: the images need not be seen again."""

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError, VisionError
from placerec.frames.sequence import SourceOptions
from placerec.frames.table import FrameTable, Labels, Texts
from placerec.vision.describe import KeptDescriptors
from placerec.vision.spec import DescriptorSpec
from placerec.vision.storage import StreamedArray, read_npz, stored_array


def are_stored(sources: Iterable[Path | str], options: SourceOptions = SourceOptions()) -> bool:
    """Whether sources are files of descriptors (.npz) and not of images.

    Raises SourceError if some of them are, and for options that say how images are read.
    """
    paths = [Path(source) for source in sources]
    stored = [path for path in paths if path.suffix == ".npz"]
    if stored and len(stored) < len(paths):
        raise SourceError(f"{stored[0]}: holds descriptors, which do not go with images; describe all, or give all")
    if stored and options != SourceOptions():
        raise SourceError(
            f"{stored[0]}: holds descriptors, of which --every, --labels and the like say nothing; leave these out"
        )
    return bool(stored)


def read_descriptors(sources: Iterable[Path | str], spec: DescriptorSpec | None = None) -> KeptDescriptors:
    """The descriptors in files of `placerec describe`, one file behind the other; they stay in the files.

    Raises VisionError naming the file: for one that `describe` did not write or that is damaged, for descriptors of
    another kind than `spec` or than the first file's, and for a sequence that is in two files.
    """
    parts = []
    where: dict[str, Path] = {}
    for path in map(Path, sources):
        try:
            parts.append(_read(path))
            kind = spec or parts[0].spec
            if not parts[-1].spec.holds(kind) or parts[-1].spec != parts[0].spec:
                raise VisionError(
                    f"holds {_told(parts[-1].spec)}, and {_told(kind)} are wanted; describe the images so"
                )
        except VisionError as error:
            raise VisionError(f"{path}: {error}") from error
        for name in parts[-1].table.by_sequence():
            if name in where:
                raise VisionError(f"{path}: the sequence {name!r} is in {where[name]}, too; leave one of them out")
            where[name] = path

    def pieces() -> Iterator[NDArray[Any]]:
        return itertools.chain.from_iterable(part.values.pieces() for part in parts)

    table = FrameTable.concat(part.table for part in parts)
    values = StreamedArray((len(table), parts[0].spec.length), pieces)
    skipped, constant = sum(part.skipped for part in parts), sum(part.constant for part in parts)
    return KeptDescriptors(parts[0].spec, values, table, skipped, constant)


def _read(path: Path) -> KeptDescriptors:
    arrays, meta = read_npz(path, ("times",))
    try:
        if meta["format"] != "placerec-descriptors":
            raise VisionError(f"is a file of {meta['format']}, and descriptors of `placerec describe` are wanted")
        spec = DescriptorSpec(**meta["descriptor"])
        skipped, constant = int(meta["skipped"]), int(meta["constant"])
    except (KeyError, TypeError, ValueError) as error:
        raise VisionError("its meta is not that of `placerec describe`; describe the images again") from error
    values, *texts = (stored_array(path, name) for name in ("descriptors", "frames", "sequences", "places"))
    n = len(arrays["times"])
    if values.shape != (n, spec.length) or values.dtype != "<f4" or arrays["times"].dtype != np.float64:
        raise VisionError(f"holds descriptors {values.dtype} {values.shape}, and <f4 {(n, spec.length)} are wanted")
    if any(text.shape != (n,) or not text.dtype.startswith("<U") for text in texts):
        raise VisionError(f"its frames, sequences and places are not texts of {n} frames; describe the images again")
    names, sequences, places = (
        itertools.chain.from_iterable(piece.tolist() for piece in text.pieces()) for text in texts
    )
    table = FrameTable(Texts(names), Labels(sequences), arrays["times"], Labels(places))
    return KeptDescriptors(spec, values, table, skipped, constant)


def _told(spec: DescriptorSpec) -> str:
    return "descriptors " + " ".join(f"{name}={value}" for name, value in spec.as_dict().items())
