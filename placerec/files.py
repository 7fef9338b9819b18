"""Output files and folders that are written whole or not at all, and text that may be gzipped."""

import ctypes
import errno
import gzip
import math
import os
import re
import shutil
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from placerec.errors import OutputError, PlacerecError

if sys.platform != "win32":
    import fcntl

PARTIAL = ".{}.partial-"
# Where commands keep descriptors for each other, beside their outputs.
CACHE = ".placerec-cache"
REPLACED = ".{}.replaced-"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it is renamed to `path`, on failure it is removed.

    A link is written through. Raises OutputError if `path` cannot be written, or is a folder or a device.
    """
    path = Path(path)
    with writing(path):
        target = path.resolve()
        if target.exists() and not target.is_file():
            kind = "a folder" if target.is_dir() else "no regular file"
            raise OutputError(f"{path}: is {kind}, and a file is to be written; name another")
        target.parent.mkdir(parents=True, exist_ok=True)
    with writing(path), replaced_file(target) as partial, writing(path, partial):
        yield partial


@contextmanager
def replaced_file(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside the regular file `target`, which it becomes on success; on failure it is removed.

    What the system refuses is an OSError.
    """
    # The suffix is kept: numpy and OpenCV choose their format by it.
    handle, name = tempfile.mkstemp(prefix=PARTIAL.format(target.name), suffix=target.suffix, dir=target.parent)
    os.close(handle)
    partial = Path(name)
    lock = _lock(partial)
    try:
        yield partial
        partial.chmod(0o666 & ~_umask())
        partial.replace(target)
    finally:
        _unlock(lock)
        partial.unlink(missing_ok=True)


def sweep_files(folder: Path, name: str | None = None) -> None:
    """Remove what killed runs of `whole_file` left in a folder, of the file `name` or of all; what is written stays."""
    of, suffix = (".+", r"(\..*)?") if name is None else (re.escape(name), re.escape(Path(name).suffix))
    # The eight characters are those of mkstemp; a journal's name has others.
    partial = re.compile(re.escape(PARTIAL).replace(r"\{\}", of) + "[a-z0-9_]{8}" + suffix)
    for entry in folder.iterdir():
        if partial.fullmatch(entry.name) and entry.is_file():
            lock = _lock(entry)
            if lock is not None:
                entry.unlink(missing_ok=True)
                _unlock(lock)


@contextmanager
def whole_folder(path: Path, owned: tuple[str, ...]) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; on success it takes the place of `path`, whose old content goes.

    Only a folder whose every entry matches one of the glob patterns `owned` is replaced: anything else there was
    not written by placerec, and OutputError names it. A link is written through. What a killed run left behind is
    removed; a run that goes on at the same time is not disturbed, and the last one to end is the one that stays.
    """
    path = Path(path)
    with writing(path):
        target = path.resolve()
        _check_replaceable(path, target, owned)
        target.parent.mkdir(parents=True, exist_ok=True)
        restore_folder(target)
        partial = Path(tempfile.mkdtemp(prefix=PARTIAL.format(target.name), dir=target.parent))
        lock = _lock(partial)
    try:
        with writing(path, partial):
            yield partial
            partial.chmod(0o777 & ~_umask())
            _check_replaceable(path, target, owned)
            if not _swap(partial, target):
                _move_in(partial, target)
    finally:
        _unlock(lock)
        shutil.rmtree(partial, ignore_errors=True)


def restore_folder(path: Path) -> None:
    """Mend what a killed run of `whole_folder` left behind: the old folder or the new one stays, and nothing else."""
    target = path.resolve()
    partial, replaced = PARTIAL.format(target.name), REPLACED.format(target.name)
    for entry in target.parent.iterdir() if target.parent.is_dir() else ():
        if entry.name.startswith((partial, replaced)) and entry.is_dir():
            lock = _lock(entry)
            if lock is not None:
                if entry.name.startswith(replaced) and (entry / "old").exists() and not target.exists():
                    (entry / "old").replace(target)
                shutil.rmtree(entry, ignore_errors=True)
                _unlock(lock)


@contextmanager
def held_folder(path: Path) -> Iterator[None]:
    """Keep other runs from this folder while it is read to be replaced; OutputError if another run keeps it.

    Otherwise, of two runs that add to one folder, the second to end would undo what the first one added.
    """
    if sys.platform == "win32":
        yield
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        # Another run may have replaced it since it was opened. Where there are no locks nobody is kept out.
        if locked(handle) is False or not os.path.samestat(os.fstat(handle), path.stat()):
            raise OutputError(f"{path}: is being changed by another run; try again when that has ended")
        yield
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 with LF line ends, gzipped if `path` ends in .gz; whole or not at all."""
    data = encoded(path, text)
    with whole_file(path) as partial:
        # mtime=0: the same text gives the same bytes.
        partial.write_bytes(gzip.compress(data, mtime=0) if partial.suffix == ".gz" else data)


def encoded(path: Path, text: str) -> bytes:
    """`text` as UTF-8; OutputError for what is not text in any encoding, as names of files can be."""
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        around = text[max(0, error.start - 20) : error.end + 20]
        raise OutputError(f"{path}: a name in {around!r} is not UTF-8, and cannot be written; rename it") from error


def read_text(path: Path, error: type[PlacerecError]) -> str:
    """The UTF-8 text of a file, gunzipped if its name ends in .gz; `error` names what cannot be read."""
    with _reading(path, error):
        data = Path(path).read_bytes()
        if Path(path).suffix == ".gz":
            data = gzip.decompress(data)
    try:
        return data.decode()
    except UnicodeDecodeError as cause:
        raise error(_not_utf8(path, data.count(b"\n", 0, cause.start) + 1, data[cause.start])) from cause


def all_lines(path: Path | str, error: type[PlacerecError]) -> list[str]:
    """The lines of a text file, as `split_lines` has them; `error` names what cannot be read."""
    return split_lines(read_text(Path(path), error))


def split_lines(text: str) -> list[str]:
    """Lines that end in LF or CRLF, the last one also without; a byte order mark is left out.

    Unlike str.splitlines: a frame may be named with one of the dozen characters that Unicode counts as line ends.
    """
    return text.removeprefix("\ufeff").replace("\r\n", "\n").removesuffix("\n").split("\n")


def read_lines(path: Path, error: type[PlacerecError]) -> Iterator[str]:
    """What `all_lines` returns, one line at a time: the file may be of any size."""
    path = Path(path)
    with _reading(path, error), gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            try:
                text = line.decode()
            except UnicodeDecodeError as cause:
                raise error(_not_utf8(path, number, line[cause.start])) from cause
            text = text.removesuffix("\n").removesuffix("\r")
            yield text.removeprefix("\ufeff") if number == 1 else text


def number_in(text: str, otherwise: float = math.nan) -> float:
    """The number that a text is, `otherwise` for any other text: whoever asks says what is wrong with it."""
    try:
        return float(text)
    except ValueError:
        return otherwise


def content_digest(*parts: Any) -> str:
    """SHA-256 of arrays (their type, shape and values), bytes, and what JSON can hold: 64 hexadecimal digits.

    For keys of what is kept by content: other parts, or other limits between them, give another digest.
    """
    # Here and below: not loaded with the package, for the tools in bin/ never need them.
    import json
    from hashlib import sha256

    total = sha256()
    for part in parts:
        try:
            view = memoryview(part)
        except TypeError:
            kind, data = "json", memoryview(json.dumps(part, sort_keys=True).encode())
        else:
            kind, data = f"{view.format} {view.shape}", view if view.c_contiguous else memoryview(view.tobytes())
        total.update(f"{kind} {data.nbytes}\n".encode())
        total.update(data)
    return total.hexdigest()


def content_digest_of_file(path: Path, error: type[PlacerecError]) -> str:
    """SHA-256 of the bytes of a file: 64 hexadecimal digits; `error` names what cannot be read."""
    from hashlib import file_digest

    try:
        with path.open("rb") as file:
            return file_digest(file, "sha256").hexdigest()
    except OSError as cause:
        raise error(f"{path}: cannot be read: {cause.strerror}") from cause


@contextmanager
def _reading(path: Path, error: type[PlacerecError]) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as cause:
        raise error(f"{path}: no such file") from cause
    except IsADirectoryError as cause:
        raise error(f"{path}: is a folder, and a file is expected; name a file in it") from cause
    except (OSError, EOFError, zlib.error) as cause:
        raise error(f"{path}: cannot be read: {getattr(cause, 'strerror', None) or cause}") from cause


def _not_utf8(path: Path, line: int, byte: int) -> str:
    remedy = "it holds arrays; name a text file" if path.suffix == ".npz" else "save the file as UTF-8"
    return f"{path}:{line}: byte 0x{byte:02x} is not UTF-8; {remedy}"


@contextmanager
def writing(path: Path, partial: Path | None = None) -> Iterator[None]:
    """What the system refuses within is an OutputError that names `path`, also for what is still in `partial`."""
    try:
        yield
    except OutputError as error:
        if partial is None or str(partial) not in str(error):
            raise
        raise OutputError(str(error).replace(str(partial), str(path))) from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _check_replaceable(path: Path, target: Path, owned: tuple[str, ...]) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise OutputError(f"{path}: is a file, and a folder is to be written; name another folder or remove it")
    # A single file that a killed run did not finish is ours as well, and what commands kept that wrote into it.
    patterns = (*owned, PARTIAL.format("*") + "*", CACHE)
    foreign = sorted(
        entry.name for entry in target.iterdir() if not any(fnmatch(entry.name, pattern) for pattern in patterns)
    )
    if foreign:
        remedy = "name another folder, or move it away"
        raise OutputError(f"{path}: holds {foreign[0]}, which this command does not write; {remedy}")
    if target == Path.cwd() or target.is_mount():
        raise OutputError(f"{path}: is the current folder or a mounted one; name a folder in it")


def _swap(first: Path, second: Path) -> bool:
    """Exchange two folders in one step of the system; False where one is missing or the system has no such step."""
    if sys.platform == "win32":
        return False
    # RENAME_SWAP of macOS is RENAME_EXCHANGE of Linux, whose paths are relative to AT_FDCWD.
    name, here = ("renamex_np", ()) if sys.platform == "darwin" else ("renameat2", (-100,))
    rename = getattr(ctypes.CDLL(None), name, None)
    return rename is not None and rename(*here, os.fsencode(first), *here, os.fsencode(second), 2) == 0


def _move_in(partial: Path, target: Path) -> None:
    """Put `partial` where `target` is, which is moved away first and comes back if that fails.

    Whoever is killed between the two moves leaves no `target`, and `restore_folder` brings the old one back.
    """
    aside = Path(tempfile.mkdtemp(prefix=REPLACED.format(target.name), dir=target.parent))
    lock = _lock(aside)
    old = aside / "old"
    try:
        while True:
            shutil.rmtree(old, ignore_errors=True)
            with suppress(FileNotFoundError):
                target.replace(old)
            try:
                partial.replace(target)
                return
            except OSError as error:
                # Another run has put its folder there since: that one goes too.
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
    finally:
        if old.exists() and not target.exists():
            old.replace(target)
        _unlock(lock)
        shutil.rmtree(aside, ignore_errors=True)


def locked(handle: int) -> bool | None:
    """Lock an open file or folder: False if another process has it, None where there are no locks.

    The system drops the lock when the file is closed, however the process ends.
    """
    if sys.platform == "win32":
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _lock(path: Path) -> int | None:
    """An open lock on a file or folder; None if another process has it, or there are no locks."""
    if sys.platform == "win32":
        return None
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    if locked(handle):
        return handle
    os.close(handle)
    return None


def _unlock(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
