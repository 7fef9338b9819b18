"""Frames by the million: kept as names, times and numbers of places, and made when they are asked for."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import overload

from placerec.frames.sequence import Frame


class Texts:
    """Strings one behind the other: each takes its length and eight bytes, where a list takes a hundred more."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self._bytes = bytearray()
        self._ends = array("Q", [0])
        for text in texts:
            self.append(text)

    def append(self, text: str) -> None:
        """One string more."""
        # Names of files may be what no encoding allows.
        self._bytes += text.encode("utf-8", "surrogatepass")
        self._ends.append(len(self._bytes))

    def __len__(self) -> int:
        return len(self._ends) - 1

    def __getitem__(self, index: int) -> str:
        return self._bytes[self._ends[index] : self._ends[index + 1]].decode("utf-8", "surrogatepass")

    def __iter__(self) -> Iterator[str]:
        return map(self.__getitem__, range(len(self)))


class Labels:
    """Strings of which there are few different ones: four bytes each."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self._numbers: dict[str, int] = {}
        self._different: list[str] = []
        self._which = array("I")
        for text in texts:
            self.append(text)

    def append(self, text: str) -> None:
        """One string more."""
        number = self._numbers.setdefault(text, len(self._numbers))
        if number == len(self._different):
            self._different.append(text)
        self._which.append(number)

    def __len__(self) -> int:
        return len(self._which)

    def __iter__(self) -> Iterator[str]:
        return map(self._different.__getitem__, self._which)

    def __getitem__(self, index: int) -> str:
        return self._different[self._which[index]]


class FileFrames(Sequence[Frame]):
    """Frames that are files of one folder: `names` in order, their times in seconds, and their places.

    A part of them (`frames[a:b:step]`) is a view of the same.
    """

    def __init__(self, folder: Path, names: Iterable[str], times: Iterable[float], places: Iterable[str]) -> None:
        self._folder = folder
        self._names = Texts(names)
        self._times = array("d", times)
        self._places = Labels(places)
        self._rows = range(len(self._names))

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> "FileFrames": ...

    def __getitem__(self, index: int | slice) -> "Frame | FileFrames":
        if isinstance(index, slice):
            part = object.__new__(FileFrames)
            part.__dict__ |= self.__dict__ | {"_rows": self._rows[index]}
            return part
        row = self._rows[index]
        name = self._names[row]
        return Frame(name, self._times[row], self._places[row], self._folder / name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FileFrames) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash((self._folder, len(self)))

    def _content(self) -> tuple[Path, bytes, list[tuple[str, str]]]:
        # Times as bytes: an unknown one (nan) equals another.
        times = array("d", (self._times[row] for row in self._rows)).tobytes()
        return self._folder, times, [(self._names[row], self._places[row]) for row in self._rows]
