"""What long work has found so far, in files: a run that was killed goes on from there, others need not do it again.

A record is 16 bytes of BLAKE2b over the rest, the key's and the content's length (8 bytes each, little-endian), the
key, the content. A record that is cut or damaged ends what is taken from the file; it is written over.
"""

import logging
import os
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from io import FileIO
from pathlib import Path

from placerec.errors import OutputError
from placerec.files import PARTIAL, locked, sweep_files, whole_file, writing
from placerec.jobs import JobError

log = logging.getLogger(__name__)
_HEAD = struct.Struct("<16sQQ")


class Journal:
    """Results in their order, each under the key that says what it was made from."""

    def __init__(self, file: FileIO, path: Path) -> None:
        self._file, self._path = file, path
        self._at = 0

    def next(self, key: bytes) -> bytes | None:
        """The next result of an earlier run, if it was made under `key`; None, and nothing more, once it was not."""
        self._file.seek(self._at)
        record = _read(self._file)
        if record is None or record[0] != key:
            return None
        self._at = self._file.tell()
        return record[1]

    def add(self, key: bytes, content: bytes) -> None:
        """Append a result; what an earlier run has from here on is forgotten. OutputError if the disk is full."""
        with writing(self._path):
            if self._file.seek(0, os.SEEK_END) != self._at:
                self._file.truncate(self._at)
                self._file.seek(self._at)
            left = memoryview(_record(key, content))
            while left:
                left = left[self._file.write(left) :]
        self._at = self._file.tell()

    def contents(self) -> Iterator[bytes]:
        """All results so far, from the first."""
        place = 0
        while place < self._at:
            self._file.seek(place)
            record = _read(self._file)
            if record is None:
                raise OutputError(f"{self._path}: was changed by something else; run the command again")
            place = self._file.tell()
            yield record[1]


class Cache:
    """Results under keys that say what they were made from, a record in a file each, for all runs that name the folder.

    Any file of it may be removed at any time. What cannot be written is not kept, with a warning.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._writable = True
        with suppress(OSError):
            sweep_files(self.folder)

    def get(self, key: bytes) -> bytes | None:
        """What was kept under `key`, None if nothing was, or if it is damaged."""
        with suppress(OSError), self._path(key).open("rb", buffering=0) as file:
            record = _read(file)
            if record is not None and record[0] == key:
                return record[1]
        return None

    def put(self, key: bytes, content: bytes) -> None:
        """Keep a result."""
        if not self._writable:
            return
        try:
            if not self.folder.exists():
                log.info("%s: keeps descriptors for other commands; it may be removed", self.folder.parent)
            with whole_file(self._path(key)) as partial:
                partial.write_bytes(_record(key, content))
        except OutputError as error:
            self._writable = False
            log.warning("%s; descriptors are not kept for other commands", error)
            # What holds nothing is not left behind.
            with suppress(OSError):
                self.folder.rmdir()
                self.folder.parent.rmdir()

    def _path(self, key: bytes) -> Path:
        return self.folder / key.hex()


@contextmanager
def open_journal(output: Path) -> Iterator[Journal]:
    """The journal of the run that makes `output`, a hidden file beside it: what a killed or interrupted run left.

    It is removed when the run ends, be it with an error; only an interrupt and a killed worker leave it. Where another
    run holds it, or it is another user's, a nameless file takes its place. OutputError if the folder cannot be written.
    """
    path = output.resolve()
    path = path.parent / (PARTIAL.format(path.name) + "journal")
    keep = False
    file, named = _opened(path, output)
    sweep_files(output.resolve().parent, output.resolve().name)
    try:
        with file:
            yield Journal(file, output)
    except (JobError, KeyboardInterrupt):
        keep = True
        raise
    finally:
        if named and not keep:
            path.unlink(missing_ok=True)


def _opened(path: Path, output: Path) -> tuple[FileIO, bool]:
    """The file to write to, and whether it is `path`."""
    with writing(output):
        path.parent.mkdir(parents=True, exist_ok=True)
        # A link there is none of ours. Without a buffer: what does not fit must not be tried again when it is closed.
        with suppress(PermissionError):
            handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
            file = os.fdopen(handle, "r+b", buffering=0)
            if locked(file.fileno()) is not False:
                return file, True
            file.close()
        return tempfile.TemporaryFile(dir=path.parent, buffering=0), False


def _record(key: bytes, content: bytes) -> bytes:
    rest = struct.pack("<QQ", len(key), len(content)) + key + content
    return blake2b(rest, digest_size=16).digest() + rest


def _read(file: FileIO) -> tuple[bytes, bytes] | None:
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    digest, key, content = _HEAD.unpack(head)
    left = os.fstat(file.fileno()).st_size - file.tell()
    if key + content > left:
        return None
    rest = file.read(key + content)
    if blake2b(head[16:] + rest, digest_size=16).digest() != digest:
        return None
    return rest[:key], rest[key:]
