"""Output files and folders that are written whole or not at all, and text that may be gzipped."""

import gzip
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path

from placerec.errors import OutputError, PlacerecError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it is renamed to `path`, on failure it is removed.

    Raises OutputError if `path` cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # The suffix is kept: numpy and OpenCV choose their format by it.
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.partial-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    partial = Path(name)
    try:
        yield partial
        partial.chmod(0o666 & ~_umask())
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path, owned: tuple[str, ...]) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; on success it takes the place of `path`, whose old content goes.

    Only a folder whose every entry matches one of the glob patterns `owned` is replaced: anything else there was
    not written by placerec, and OutputError names it.
    """
    path = Path(path)
    foreign = sorted(
        entry.name for entry in _entries(path) if not any(fnmatch(entry.name, pattern) for pattern in owned)
    )
    if foreign:
        raise OutputError(f"{path}: holds {foreign[0]}, which this command does not write; name another folder")
    partial = path.parent / f".{path.name}.partial"
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        yield partial
        shutil.rmtree(path, ignore_errors=True)
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with LF line ends, gzipped if `path` ends in .gz; whole or not at all."""
    with whole_file(path) as partial:
        data = text.encode()
        # mtime=0: the same text gives the same bytes.
        partial.write_bytes(gzip.compress(data, mtime=0) if partial.suffix == ".gz" else data)


def read_text(path: Path, error: type[PlacerecError]) -> str:
    """The UTF-8 text of a file, gunzipped if its name ends in .gz; `error` names what cannot be read."""
    try:
        data = Path(path).read_bytes()
        if Path(path).suffix == ".gz":
            data = gzip.decompress(data)
        return data.decode()
    except UnicodeDecodeError as cause:
        line = data.count(b"\n", 0, cause.start) + 1
        byte = data[cause.start]
        raise error(f"{path}:{line}: byte 0x{byte:02x} is not UTF-8; save the file as UTF-8") from cause
    except FileNotFoundError as cause:
        raise error(f"{path}: no such file") from cause
    except (OSError, EOFError) as cause:
        raise error(f"{path}: cannot be read: {getattr(cause, 'strerror', None) or cause}") from cause


def _entries(path: Path) -> list[Path]:
    if not path.exists():
        return []
    if not path.is_dir():
        raise OutputError(f"{path}: is a file, and a folder is to be written; name another folder or remove it")
    return list(path.iterdir())


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
