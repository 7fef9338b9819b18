"""The files and messages of SRILM's commands: section 2.2 of our SRILM specification.

Text is handled as bytes kept in str (Latin-1), so that no byte is lost and words sort by their bytes.
"""

import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import BinaryIO, TypeVar, cast

from placerec.errors import PlacerecError

SPACES = " \t\n\v\f\r"
_BLANKS = str.maketrans("\t\r\n", "   ")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_OTHER_MARKS = {b"\xff\xfe": "UTF-16LE", b"\xfe\xff": "UTF-16BE"}
# Suffix -> what packed files begin with.
_PACKERS = {".gz": b"\x1f\x8b", ".bz2": b"BZh"}
_OTHER_PACKERS = (".Z", ".z", ".7z", ".xz")
_Tool = TypeVar("_Tool", bound=Callable[..., int])


class SrilmError(PlacerecError):
    """A message that ends the run with `status`."""

    def __init__(self, message: str, status: int = 1) -> None:
        super().__init__(message)
        self.status = status


class Streams:
    """Standard input, output and error of one run, and whether `-` was read or written before."""

    def __init__(self, stdin: BinaryIO, stdout: BinaryIO, stderr: BinaryIO) -> None:
        self.stdin, self.stdout, self.stderr = stdin, stdout, stderr
        self.used: set[str] = set()

    def say(self, message: str) -> None:
        """A line on standard error, at once."""
        self.stderr.write(message.encode("latin-1", "replace") + b"\n")
        self.stderr.flush()

    def print(self, text: str) -> None:
        """Text on standard output."""
        self.stdout.write(text.encode("latin-1"))

    def open(self, name: str) -> BinaryIO:
        """A file to read (`-`: standard input), unpacked where it is packed; SrilmError if there is none."""
        if name == "-":
            self._once("input")
            return self.stdin
        with _named(name):
            path = path_of(name)
            suffix = _packing(name)
            if not suffix or (os.path.isfile(path) and not _is_packed(path, suffix)):
                return open(path, "rb")
            return _unpacking(path, suffix)

    @contextmanager
    def closing(self, file: BinaryIO) -> Iterator[BinaryIO]:
        """Closes a file that `open` gave, unless it is standard input."""
        try:
            yield file
        finally:
            if file is not self.stdin:
                file.close()

    @contextmanager
    def output(self, name: str) -> Iterator[BinaryIO]:
        """A file to write to (`-`: standard output), packed by its suffix; it appears when it is whole."""
        if name == "-":
            self._once("output")
            yield self.stdout
            return
        with _named(name):
            path = os.path.realpath(path_of(name))
            suffix = _packing(name)
            # A device or a pipe has to be written itself; so has a file in a folder that takes no other.
            if os.path.exists(path) and not (os.path.isfile(path) and os.access(os.path.dirname(path), os.W_OK)):
                with open(path, "wb") as file:
                    yield from _packed_into(file, suffix)
                return
            # Here and below: not needed by those who only read.
            from pathlib import Path

            from placerec.files import replaced_file

            with replaced_file(Path(path)) as partial, open(partial, "wb") as file:
                yield from _packed_into(file, suffix)

    def write(self, name: str, text: str) -> None:
        """Write a file whole (`-`: standard output), packed by its suffix."""
        with self.output(name) as file:
            file.write(text.encode("latin-1"))

    def _once(self, what: str) -> None:
        if what in self.used and what + "!" not in self.used:
            self.say(f"warning: '-' used multiple times for {what}")
            self.used.add(what + "!")
        self.used.add(what)

    def lines(self, name: str) -> "Lines":
        """The lines of a file that are neither blank nor comments."""
        return Lines(name, self.open(name), self)


class Lines:
    """Iterates over the lines of a file that are neither blank nor comments; `number` is that of the last line read.

    `end`: what ends that line, nothing at the end of a file that lacks it.
    A line is read when it is asked for. `blocks` are the file's parts, for those who take it apart themselves.
    """

    def __init__(self, name: str, source: BinaryIO, streams: Streams) -> None:
        self.name = name
        self.number = 0
        self.end = "\n"
        self.source = source
        self.streams = streams

    def _unmarked(self, start: bytes) -> bytes:
        encoding = _OTHER_MARKS.get(start[:2])
        if encoding:
            self.streams.say(f"{self.name}: line 0: conversion from {encoding} not supported")
            return b""
        return start.removeprefix(_BYTE_ORDER_MARK)

    def _physical(self) -> Iterator[bytes]:
        first = self._unmarked(self.source.readline())
        if first:
            yield first
            yield from self.source

    def __iter__(self) -> Iterator[str]:
        with _named(self.name), self.streams.closing(self.source):
            yield from self.of(self._physical())

    def of(self, physical: Iterable[bytes]) -> Iterator[str]:
        """The lines that physical lines make, which are counted."""
        begun, joined = "", False
        for line_and_end in physical:
            self.end = "\n" if line_and_end.endswith(b"\n") else ""
            # What follows a NUL byte is lost, the line end with it: the next line is part of this one.
            self.number += not joined
            line = line_and_end.decode("latin-1").removesuffix("\n")
            joined = "\0" in line
            if joined:
                begun += line.partition("\0")[0]
                continue
            whole, begun = begun + line, ""
            if whole.strip(SPACES) and not whole.startswith("##"):
                yield whole
        if begun.strip(SPACES) and not begun.startswith("##"):
            yield begun

    def blocks(self, size: int) -> Iterator[bytes]:
        """The file in blocks of whole physical lines, of `size` bytes or a little more; they are not counted."""
        with _named(self.name), self.streams.closing(self.source):
            block = self._unmarked(self.source.read(size) + self.source.readline())
            while block:
                yield block
                block = self.source.read(size) + self.source.readline()

    @property
    def position(self) -> str:
        """What messages about the last line start with."""
        return f"{self.name}: line {self.number}: "


def tokens(line: str) -> list[str]:
    """The words of a line: blank, tab, CR and LF separate them; vertical tab and form feed do not."""
    return [word for word in line.translate(_BLANKS).split(" ") if word]


def exit_status(tool: _Tool) -> _Tool:
    """A tool (arguments, streams, ...) that ends with a message and its status where `tool` raises SrilmError."""

    @wraps(tool)
    def run(arguments: Sequence[str], streams: Streams, *others: str) -> int:
        try:
            return tool(arguments, streams, *others)
        except SrilmError as error:
            streams.say(str(error))
            return error.status

    return cast(_Tool, run)


def path_of(name: str) -> str:
    """The path that a name stands for, as the system has it; SrilmError for one that none can have."""
    if "\0" in name:
        raise SrilmError(f"{name!r} is no file name: there is a NUL in it")
    return os.fsdecode(name.encode("latin-1"))


def _packing(name: str) -> str:
    """The suffix by which a file is packed, an empty text if it is not."""
    suffix = name[name.rfind(".") :] if "." in name[1:] else ""
    if suffix in _OTHER_PACKERS:
        raise SrilmError(f"{name}: placerec does not read or write {suffix} files; use .gz or .bz2", 2)
    return suffix if suffix in _PACKERS else ""


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Turns what the system refuses, and damaged packed files, into SrilmError with `name` in front."""
    try:
        yield
    except (OSError, EOFError, zlib.error) as error:
        raise SrilmError(f"{name}: {getattr(error, 'strerror', None) or error}") from error


def _is_packed(path: str, suffix: str) -> bool:
    with open(path, "rb") as file:
        return file.read(len(_PACKERS[suffix])) == _PACKERS[suffix]


def _unpacking(path: str, suffix: str) -> BinaryIO:
    from bz2 import BZ2File
    from gzip import GzipFile

    return cast(BinaryIO, GzipFile(path, "rb") if suffix == ".gz" else BZ2File(path, "rb"))


def _packed_into(file: BinaryIO, suffix: str) -> Iterator[BinaryIO]:
    """The file, or what packs bytes into it and is closed afterwards."""
    if not suffix:
        yield file
        return
    from bz2 import BZ2File
    from gzip import GzipFile

    # Without name and time, so that the same text gives the same bytes.
    with GzipFile("", "wb", 6, file, mtime=0) if suffix == ".gz" else BZ2File(file, "wb") as packed:
        yield cast(BinaryIO, packed)
