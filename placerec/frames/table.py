"""A table of frames: their names, sequences, times and places as columns that fit in memory by the million."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import eq
from typing import Self, overload

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import SourceError, counted
from placerec.frames.sequence import Frame

RowIndex = Ints | Mask | Sequence[int] | slice


class _Strings(Sequence[str]):
    """A column of n strings; equal to any sequence of the same strings, a tuple for instance."""

    def take(self, rows: RowIndex) -> Self:
        """The strings of some rows, given by numbers, bool (n,) or a slice."""
        raise NotImplementedError

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> Self: ...

    def __getitem__(self, index: int | slice) -> str | Self:
        return self.take(index) if isinstance(index, slice) else self._at(index)

    def _at(self, index: int) -> str:
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or isinstance(other, str):
            return NotImplemented
        return len(self) == len(other) and all(map(eq, self, other))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} strings)"


class Texts(_Strings):
    """Strings one behind the other: eight bytes each beside their own, where a list takes a hundred."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        joined, ends = bytearray(), array("q", [0])
        for text in texts:
            # Names of files may be what no encoding allows.
            joined += text.encode("utf-8", "surrogatepass")
            ends.append(len(joined))
        self._bytes, self._ends = bytes(joined), np.array(ends, np.int64)

    def __len__(self) -> int:
        return len(self._ends) - 1

    def _at(self, index: int) -> str:
        row = range(len(self))[index]
        return self._bytes[self._ends[row] : self._ends[row + 1]].decode("utf-8", "surrogatepass")

    def __iter__(self) -> Iterator[str]:
        return (self._bytes[start:end].decode("utf-8", "surrogatepass") for start, end in pairwise(self._ends.tolist()))

    def take(self, rows: RowIndex) -> Self:
        """The strings of some rows, given by numbers, bool (n,) or a slice."""
        starts, ends = self._ends[:-1][rows], self._ends[1:][rows]
        pieces = (self._bytes[a:b] for a, b in zip(starts.tolist(), ends.tolist(), strict=True))
        return self._of(b"".join(pieces), ends - starts)

    @classmethod
    def concat(cls, columns: Sequence[Self]) -> Self:
        """The strings of all columns, one column behind the other."""
        lengths = [np.diff(column._ends) for column in columns]
        return cls._of(b"".join(column._bytes for column in columns), np.concatenate([np.zeros(0, np.int64), *lengths]))

    @classmethod
    def _of(cls, joined: bytes, lengths: Ints) -> Self:
        column = cls()
        column._bytes, column._ends = joined, np.concatenate([np.zeros(1, np.int64), np.cumsum(lengths)])
        return column


class Labels(_Strings):
    """Strings of which few are different: as few bytes each as the number of different ones needs."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        numbers: dict[str, int] = {}
        which = array("I", (numbers.setdefault(text, len(numbers)) for text in texts))
        self._set(tuple(numbers), np.array(which, np.uint32))

    def _set(self, different: tuple[str, ...], which: NDArray[np.unsignedinteger]) -> Self:
        self._different = different
        self._which = which.astype(np.min_scalar_type(len(different)), copy=False)
        return self

    def __len__(self) -> int:
        return len(self._which)

    def _at(self, index: int) -> str:
        return self._different[int(self._which[index])]

    def __iter__(self) -> Iterator[str]:
        return map(self._different.__getitem__, self._which.tolist())

    def take(self, rows: RowIndex) -> Self:
        """The strings of some rows, given by numbers, bool (n,) or a slice."""
        return type(self)()._set(self._different, self._which[rows])

    def codes(self, names: Sequence[str]) -> Ints:
        """The index of each string in `names`, int64 (n,), -1 for one that is not there."""
        index = {name: number for number, name in enumerate(names)}
        numbers = np.array([index.get(text, -1) for text in self._different], np.int64)
        found: Ints = numbers[self._which]
        return found

    @classmethod
    def concat(cls, columns: Sequence[Self]) -> Self:
        """The strings of all columns, one column behind the other."""
        numbers: dict[str, int] = {}
        which = [np.zeros(0, np.uint32)]
        for column in columns:
            new = [numbers.setdefault(text, len(numbers)) for text in column._different]
            which.append(np.array(new, np.uint32)[column._which])
        return cls()._set(tuple(numbers), np.concatenate(which))

    @classmethod
    def constant(cls, text: str, count: int) -> Self:
        """A string `count` times."""
        return cls()._set((text,), np.zeros(count, np.uint8))


@dataclass(frozen=True, eq=False, repr=False)
class FrameTable:
    """A row for each of n frames, those of one sequence in the order of time.

    `names`: see `Frame`; `sequences`: names of the frames' sequences; `times` float64 (n,): seconds, nan where unknown;
    `places`: "" where unlabelled.
    """

    names: Texts
    sequences: Labels
    times: Floats
    places: Labels

    @staticmethod
    def of(
        sequence: str,
        names: Iterable[str],
        times: Sequence[float] | Floats | None = None,
        places: Iterable[str] | None = None,
    ) -> "FrameTable":
        """The frames of one sequence from columns; without times and places these are unknown.

        Raises SourceError if the columns are not of one length.
        """
        names = Texts(names)
        n = len(names)
        seconds = np.full(n, np.nan) if times is None else np.array(times, np.float64)
        labels = Labels.constant("", n) if places is None else Labels(places)
        if not n == len(seconds) == len(labels):
            columns = f"{n} names, {len(seconds)} times and {len(labels)} places of frames"
            raise SourceError(f"{sequence}: {columns}; give one of each a frame")
        return FrameTable(names, Labels.constant(sequence, n), seconds, labels)

    @staticmethod
    def of_frames(sequence: str, frames: Iterable[Frame]) -> "FrameTable":
        """The table of some frames of one sequence."""
        frames = list(frames)
        columns = zip(*((frame.name, frame.time, frame.place) for frame in frames), strict=True)
        return FrameTable.of(sequence, *columns) if frames else FrameTable.of(sequence, ())

    @staticmethod
    def concat(tables: Iterable["FrameTable"]) -> "FrameTable":
        """The rows of all tables, one table behind the other."""
        tables = list(tables)
        return FrameTable(
            Texts.concat([table.names for table in tables]),
            Labels.concat([table.sequences for table in tables]),
            np.concatenate([np.zeros(0), *(table.times for table in tables)]),
            Labels.concat([table.places for table in tables]),
        )

    def __len__(self) -> int:
        return len(self.times)

    def __eq__(self, other: object) -> bool:
        # Times as bytes: an unknown one (nan) equals another.
        return isinstance(other, FrameTable) and (
            (self.names, self.sequences, self.times.tobytes(), self.places)
            == (other.names, other.sequences, other.times.tobytes(), other.places)
        )

    def __repr__(self) -> str:
        sequences, places = len({*self.sequences}), len({*self.places} - {""})
        of = f"{counted(sequences, 'sequence')}, {counted(places, 'place')}"
        return f"FrameTable({counted(len(self), 'frame')}, {of})"

    @property
    def labelled(self) -> Mask:
        """Which frames have a place, bool (n,)."""
        return self.places.codes([""]) < 0

    def take(self, rows: RowIndex) -> "FrameTable":
        """Some rows, given by numbers, bool (n,) or a slice."""
        return FrameTable(self.names.take(rows), self.sequences.take(rows), self.times[rows], self.places.take(rows))

    def by_sequence(self) -> dict[str, Ints]:
        """Sequence name -> the numbers of the rows of its frames, int64 (m,), both in order of appearance."""
        names = list(dict.fromkeys(self.sequences))
        code = self.sequences.codes(names)
        return {name: np.flatnonzero(code == number) for number, name in enumerate(names)}

    def renamed(self, sequence: str) -> "FrameTable":
        """The frames as those of one sequence that is called `sequence`."""
        return replace(self, sequences=Labels.constant(sequence, len(self)))
