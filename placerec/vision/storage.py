"""npz files of plain arrays and one JSON string `meta`: no pickle, and the same content gives the same bytes."""

import hashlib
import json
import math
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.files import whole_file

# Strings of a column that are in memory at one time.
TOGETHER = 4096
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class StreamedArray:
    """An array that is not in memory: `pieces()` gives all of its rows, in order; `dtype` as in npy files."""

    shape: tuple[int, ...]
    pieces: Callable[[], Iterator[NDArray[Any]]]
    dtype: str = "<f4"


def text_column(texts: Sequence[str]) -> StreamedArray:
    """Strings as an array of them, as numpy makes it of a list."""
    dtype = f"<U{max(1, max(map(len, texts), default=0))}"

    def pieces() -> Iterator[NDArray[np.str_]]:
        rest = iter(texts)
        while some := list(islice(rest, TOGETHER)):
            yield np.array(some, dtype)

    return StreamedArray((len(texts),), pieces, dtype)


def write_npz(path: Path, arrays: Mapping[str, NDArray[Any] | StreamedArray], meta: dict[str, Any]) -> None:
    """Write the arrays and `meta` as numpy.savez does, whole or not at all; OutputError if it cannot be written."""
    content = {**arrays, "meta": np.array(_text(meta))}
    with whole_file(Path(path)) as partial, zipfile.ZipFile(partial, "w", allowZip64=True) as archive:
        for name, array in content.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                if isinstance(array, StreamedArray):
                    header = {"descr": array.dtype, "fortran_order": False, "shape": array.shape}
                    np.lib.format.write_array_header_1_0(file, header)
                    for piece in array.pieces():
                        file.write(piece.astype(array.dtype, copy=False).tobytes())
                else:
                    np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=False)


def stored_array(path: Path, name: str) -> StreamedArray:
    """An array of an npz file, which stays there and is read piece by piece: one that `read_npz` found sound.

    Raises VisionError without the file's name if there is none, or none in C order.
    """

    def opened(archive: zipfile.ZipFile) -> tuple[IO[bytes], tuple[int, ...], np.dtype[Any]]:
        file = archive.open(f"{name}.npy")
        if np.lib.format.read_magic(file) != (1, 0):
            raise VisionError(f"the array {name} has a header that is not read")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        if dtype.hasobject or (fortran and len(shape) > 1):
            raise VisionError(f"the array {name} is not stored row by row")
        return file, shape, dtype

    with reading(), zipfile.ZipFile(path) as archive:
        _check_there([one.removesuffix(".npy") for one in archive.namelist()], (name,))
        _, shape, dtype = opened(archive)

    def pieces() -> Iterator[NDArray[Any]]:
        with zipfile.ZipFile(path) as archive:
            file, *_ = opened(archive)
            size = dtype.itemsize * math.prod(shape[1:])
            left = shape[0]
            while left:
                rows = min(left, TOGETHER)
                with reading():
                    data = file.read(rows * size)
                if len(data) < rows * size:
                    raise VisionError(f"{path}: the array {name} ends too soon; describe the images again")
                yield np.frombuffer(data, dtype).reshape(rows, *shape[1:])
                left -= rows

    return StreamedArray(shape, pieces, dtype.str)


def read_npz(
    path: Path, names: Iterable[str], more: Callable[[dict[str, Any]], Iterable[str]] = lambda meta: ()
) -> tuple[Arrays, dict[str, Any]]:
    """The arrays called `names`, those that `more` names of the `meta`, and `meta`; nothing in the file is executed.

    Raises VisionError without the file's name for anything that `write_npz` would not have written.
    """
    with reading():
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        if damaged is not None:
            raise VisionError(f"the checksum of {damaged} is wrong")
        with np.load(path, allow_pickle=False) as file:
            _check_there(file.files, (*names, "meta"))
            meta = json.loads(str(file["meta"]))
            if not isinstance(meta, dict):
                raise VisionError("its meta is not a JSON object")
            names = dict.fromkeys((*names, *more(meta)))
            _check_there(file.files, names)
            arrays = {name: file[name] for name in names}
    return arrays, meta


def _check_there(there: Iterable[str], wanted: Iterable[str]) -> None:
    missing = [name for name in wanted if name not in there]
    if missing:
        raise VisionError(f"the array {missing[0]} is missing")


@contextmanager
def reading() -> Iterator[None]:
    """What goes wrong within with a file of arrays becomes a VisionError without the file's name."""
    try:
        yield
    except FileNotFoundError as error:
        raise VisionError("no such file") from error
    except IsADirectoryError as error:
        raise VisionError("it is a folder") from error
    except zipfile.BadZipFile as error:
        raise VisionError("it is not an npz file, or it is truncated") from error
    except (OSError, EOFError, ValueError, zlib.error, NotImplementedError, RuntimeError, MemoryError) as error:
        raise VisionError(f"it cannot be read: {error}") from error


def fingerprint(arrays: Arrays, meta: dict[str, Any]) -> str:
    """SHA-256 over names, types, shapes and bytes of the arrays, and `meta`: 64 hexadecimal digits."""
    digest = hashlib.sha256(_text(meta).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _text(meta: dict[str, Any]) -> str:
    return json.dumps(meta, sort_keys=True, allow_nan=False)
