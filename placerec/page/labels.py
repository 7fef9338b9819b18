"""The labels of drives while a page changes them: read, checked, written whole, and watched for what others write."""

import hashlib
import threading
from collections.abc import Iterable, Sequence as Ordered
from pathlib import Path
from typing import Any

from placerec.errors import OutputError, PageError, SourceError
from placerec.files import read_text, write_text
from placerec.frames import Sequence, SourceOptions
from placerec.frames.label_files import label_file, runs

# The frames from the first to before the second are in a place.
Stretch = tuple[int, int, str]
MAX_NAME = 100


class ChangedError(PageError):
    """A file of labels that is no longer what the page had seen."""


class DriveLabels:
    """The labels of one sequence: `places`, one a frame, "" without a label, and the `version` of their file.

    A version is a digest of the file's text, "" where there is no file. Raises SourceError for a sequence whose labels
    no file can hold, and for a file that cannot be read.
    """

    def __init__(self, sequence: Sequence, options: SourceOptions = SourceOptions()) -> None:
        self.sequence = sequence
        self.file = label_file(sequence, options)
        self._lock = threading.Lock()
        self._given = [frame.place for frame in sequence.frames]
        # What the file said before this page wrote: without a change it is to say so again.
        self._base = self._written = _text_of(self.file.path)
        self._places = self._read(self._base)

    def state(self) -> tuple[str, list[str]]:
        """The version and the place of each frame, read anew if somebody else wrote."""
        with self._lock:
            text = _text_of(self.file.path)
            if text != self._written:
                self._places, self._base, self._written = self._read(text), text, text
            return _version(self._written), self._places

    def version(self) -> str:
        """The version of the file as it is now; only a text that was changed is read."""
        return _version(_text_of(self.file.path))

    def save(self, places: Ordered[str], version: str) -> str:
        """Write the place of each frame, whole or not at all, and return the new version.

        Raises ChangedError if the file is not of `version` any more, and then nothing is written; SourceError for
        labels that the file cannot hold, OutputError if it cannot be written.
        """
        with self._lock:
            before = _text_of(self.file.path)
            if _version(before) != version:
                raise ChangedError(f"{self.file.path}: was changed meanwhile by somebody else")
            if before != self._written:
                # The page has seen what somebody else wrote.
                self._base = before
            text = self.file.text(places, self._base or "")
            if text == "" and self._base is None:
                _remove(self.file.path)
                text_now = None
            else:
                if text != before:
                    write_text(self.file.path, text)
                text_now = text
            self._written, self._places = text_now, list(places)
            return _version(text_now)

    def _read(self, text: str | None) -> list[str]:
        return [*self._given] if text is None else self.file.places(text)


def stretches_of(places: Ordered[str]) -> list[Stretch]:
    """The stretches that have a label."""
    return [(first, last, place) for first, last, place in runs(places) if place]


def places_of(sent: Any, count: int) -> list[str]:
    """The place of each of `count` frames by stretches that a page sent; PageError if they are no such stretches."""
    places = [""] * count
    before = 0
    for one in _sequence(sent):
        match _sequence(one):
            case [int(start), int(end), str(place)] if (
                before <= start < end <= count and 0 < len(place) <= MAX_NAME and bool not in (type(start), type(end))
            ):
                places[start:end] = [place] * (end - start)
                before = end
            case _:
                raise PageError(f"{str(one)[:80]!r} is no stretch of {count} frames")
    return places


def _sequence(sent: Any) -> Iterable[Any]:
    if not isinstance(sent, list):
        raise PageError(f"{str(sent)[:80]!r} is no list")
    return sent


def _text_of(path: Path) -> str | None:
    """The text as it is, with its line ends; None if there is no such file."""
    try:
        return read_text(path, SourceError)
    except SourceError:
        if path.exists():
            raise
        return None


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be removed: {error.strerror}") from error


def _version(text: str | None) -> str:
    return "" if text is None else hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:24]
