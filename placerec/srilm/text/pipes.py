"""Several files, or what a command makes of them, as one file."""

import io
import os
import signal
import subprocess
from collections.abc import Iterable, Iterator
from threading import Thread
from typing import IO, BinaryIO, cast

from placerec.srilm.text.streams import SrilmError, Streams

_BLOCK = 1 << 16


def joined(names: Iterable[str], streams: Streams) -> Iterator[bytes]:
    """The bytes of files one after the other, unpacked; each ends its last line."""
    for name in names:
        for block in streams.lines(name).blocks(_BLOCK):
            yield block if block.endswith(b"\n") else block + b"\n"


def filtered(command: str, chunks: Iterable[bytes]) -> Iterator[bytes]:
    """What a shell command makes of bytes on its standard input; SrilmError if it, or the reading of them, fails."""
    failures: list[Exception] = []

    def feed(pipe: IO[bytes]) -> None:
        # The tools end where standard output is closed; a command that reads no more is another matter.
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
        try:
            with pipe:
                pipe.writelines(chunks)
        except BrokenPipeError:
            # Whoever reads no more (`head`) has what is needed.
            pass
        except Exception as error:
            failures.append(error)

    with subprocess.Popen(
        os.fsdecode(command.encode("latin-1")), shell=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdin
        assert process.stdout
        feeder = Thread(target=feed, args=(process.stdin,))
        feeder.start()
        try:
            while chunk := os.read(process.stdout.fileno(), _BLOCK):
                yield chunk
        finally:
            process.stdout.close()
            feeder.join()
    if failures:
        raise failures[0]
    if process.returncode:
        raise SrilmError(f"the filter {command!r} ended with status {process.returncode}")


def as_file(chunks: Iterator[bytes]) -> BinaryIO:
    """A file that holds the pieces one after the other."""
    return cast(BinaryIO, io.BufferedReader(_Chunks(chunks), _BLOCK))


class _Chunks(io.RawIOBase):
    """A file of bytes that come in pieces."""

    def __init__(self, chunks: Iterator[bytes]) -> None:
        self.chunks, self.rest = chunks, b""

    def readable(self) -> bool:
        """Always."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill some of a buffer; 0 at the end."""
        self.rest = self.rest or next(self.chunks, b"")
        size = min(len(buffer), len(self.rest))
        buffer[:size], self.rest = self.rest[:size], self.rest[size:]
        return size
