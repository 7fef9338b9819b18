"""Beliefs, and their text: one tab-separated line per frame, in a file and in a stream.

    frame  time  place  word  selected  best  PLACE...  [unknown]

`time` in seconds, empty where unknown; `place` the true one, empty where unlabelled; `selected` 1 or 0; one column per
place with its belief. The places' columns sum to 1. A last column `unknown`, the probability that the place is none of
them, stands beside them: they hold given that it is not, and `best` is `unknown` where it is above 1/2.
"""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import EvaluationError, OutputError, at, counted
from placerec.files import number_in, read_text, split_lines, write_text
from placerec.words import WordStream
from placerec.words.stream import format_seconds

COLUMNS = ("frame", "time", "place", "word", "selected", "best")
UNKNOWN_PLACE = "unknown"

# A file of rounded numbers may miss 1 by a little; a row that misses it by more is no distribution.
_SUM_TOLERANCE = 1e-3


@dataclass(frozen=True, repr=False)
class Beliefs:
    """What was believed about every frame of one sequence, n frames, and each of C places.

    `stream`: the sequence, its words and true places. `selected` bool (n,): the frames that the filter took in.
    `best`: the most probable place of each frame, or UNKNOWN_PLACE. `belief` float64 (n, C), rows sum to 1: in each
    place, given that it is one of them. `unknown` float64 (n,): that it is none of them; None where nobody asked.
    """

    stream: WordStream
    places: tuple[str, ...]
    selected: Mask
    best: tuple[str, ...]
    belief: Floats
    unknown: Floats | None = None

    @staticmethod
    def of(
        stream: WordStream,
        places: tuple[str, ...],
        belief: Floats,
        *,
        selected: Mask | None = None,
        best: Ints | None = None,
        unknown: Floats | None = None,
    ) -> "Beliefs":
        """The beliefs (n, C) about the frames of a stream; `best` is UNKNOWN_PLACE where `unknown` (n,) is above 1/2.

        `selected` bool (n,): all frames if left out. `best` int64 (n,): a column each, the most probable if left out.
        """
        columns = belief.argmax(axis=1) if best is None else best
        names = [places[column] for column in columns.tolist()]
        if unknown is not None:
            names = [UNKNOWN_PLACE if new else name for name, new in zip(names, (unknown > 0.5).tolist(), strict=True)]
        taken = np.ones(len(stream), bool) if selected is None else selected
        return Beliefs(stream, places, taken, tuple(names), belief, unknown)

    def __len__(self) -> int:
        return len(self.stream)

    def __repr__(self) -> str:
        return f"Beliefs({self.name!r}: {counted(len(self), 'frame')}, {list_places(self.places)})"

    def _repr_html_(self) -> str:
        from placerec.hohmm.beliefs_html import beliefs_html

        return beliefs_html(self)

    @property
    def name(self) -> str:
        """The sequence."""
        return self.stream.name

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of the frames."""
        return self.stream.frames

    @property
    def times(self) -> Floats:
        """Seconds, float64 (n,), nan where unknown."""
        return self.stream.times

    @property
    def truth(self) -> tuple[str, ...]:
        """The true places, "" where the frame has no label."""
        return self.stream.places

    @property
    def words(self) -> tuple[str, ...]:
        """The word of each frame."""
        return self.stream.words

    def to_dict(self) -> dict[str, Sequence[str] | Floats | Mask]:
        """The columns of the beliefs' file: `pandas.DataFrame(beliefs.to_dict())`, and so for polars."""
        own = (self.frames, self.times, self.truth, self.words, self.selected, self.best)
        columns: dict[str, Sequence[str] | Floats | Mask] = dict(zip(COLUMNS, own, strict=True))
        columns |= dict(zip(self.places, self.belief.T, strict=True))
        return columns if self.unknown is None else columns | {UNKNOWN_PLACE: self.unknown}


def list_places(places: Sequence[str]) -> str:
    """How many places there are, and the first of them: for the `repr` of what is about places."""
    names = ", ".join(places)
    return f"{counted(len(places), 'place')}: {names if len(names) <= 60 else names[:57] + '...'}"


class BeliefRow(NamedTuple):
    """A frame's line of a beliefs file: `time` in seconds, nan where unknown; `place` the true one, "" without a label.

    `belief`: C probabilities; `unknown`: that the place is none of them, None where the file has no such column.
    """

    frame: str
    time: float
    place: str
    word: str
    selected: bool
    best: str
    belief: Sequence[float]
    unknown: float | None = None


def format_header(places: Iterable[str], *, unknown: bool = False) -> str:
    """The header line for these places, without its line end; raises OutputError for a name that cannot be a column."""
    return _line((*COLUMNS, *places, *([UNKNOWN_PLACE] if unknown else [])))


def format_row(row: BeliefRow) -> str:
    """A frame's line, without its line end: times to the microsecond, probabilities with nine significant digits.

    Raises OutputError for a text that holds a tab or a line end.
    """
    numbers = [*row.belief] if row.unknown is None else [*row.belief, row.unknown]
    texts = (f"{p:.9g}" for p in numbers)
    return _line(
        (row.frame, format_seconds(row.time), row.place, row.word, "1" if row.selected else "0", row.best, *texts)
    )


def format_json_row(places: Iterable[str], row: BeliefRow) -> str:
    """A frame's line as a JSON object: `time` and `place` null where unknown, `belief` from place to probability."""
    values = row._asdict() | {"time": None if math.isnan(row.time) else row.time, "place": row.place or None}
    values["belief"] = dict(zip(places, row.belief, strict=True))
    unknown = values.pop("unknown")
    return json.dumps(values if unknown is None else values | {UNKNOWN_PLACE: unknown}, ensure_ascii=False)


def format_beliefs(beliefs: Beliefs, *, as_json: bool = False) -> str:
    """The text of a beliefs file: TSV with a header, or one JSON object a line."""
    unknown = [None] * len(beliefs) if beliefs.unknown is None else beliefs.unknown.tolist()
    stream, numbers = beliefs.stream, (beliefs.selected.tolist(), beliefs.best, beliefs.belief.tolist(), unknown)
    rows = map(BeliefRow, stream.frames, stream.times.tolist(), stream.places, stream.words, *numbers)
    if as_json:
        lines = [format_json_row(beliefs.places, row) for row in rows]
    else:
        lines = [format_header(beliefs.places, unknown=beliefs.unknown is not None), *map(format_row, rows)]
    return "".join(f"{line}\n" for line in lines)


def write_beliefs(path: Path | str, beliefs: Beliefs) -> None:
    """Write one sequence's beliefs, gzipped if `path` ends in .gz; raises OutputError if that cannot be done."""
    write_text(Path(path), format_beliefs(beliefs))


def read_beliefs(path: Path | str) -> Beliefs:
    """Read one sequence's beliefs; its name is the file's without .tsv and .gz.

    Raises EvaluationError for a file that cannot be read or is not a beliefs file.
    """
    path = Path(path)
    return parse_beliefs(
        read_text(path, EvaluationError), name=path.name.removesuffix(".gz").removesuffix(".tsv"), source=path
    )


def parse_beliefs(text: str, *, name: str, source: Path | str) -> Beliefs:
    """The beliefs in a file's text; `source` is what error messages call it.

    Raises EvaluationError with the line, the value and the remedy if the text is not a beliefs file.
    """
    lines = split_lines(text)
    if lines == [""]:
        raise EvaluationError(f"{source}: is empty; a beliefs file starts with a header: {' '.join(COLUMNS)} PLACE...")
    header = lines[0].split("\t")
    places = _places(header, source)
    answers = frozenset(header[len(COLUMNS) :])
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            rows.append(_row(line.split("\t"), header, places, answers))
        except ValueError as error:
            raise EvaluationError(at(source, number, str(error))) from None
    stream = WordStream.of(
        name,
        [row.word for row in rows],
        [row.place for row in rows],
        frames=[row.frame for row in rows],
        times=[row.time for row in rows],
    )
    return Beliefs(
        stream,
        places,
        selected=np.array([row.selected for row in rows], dtype=np.bool_),
        best=tuple(row.best for row in rows),
        belief=np.array([row.belief for row in rows], dtype=np.float64).reshape(len(rows), len(places)),
        unknown=np.array([row.unknown for row in rows], dtype=np.float64) if UNKNOWN_PLACE in answers else None,
    )


def _line(fields: Iterable[str]) -> str:
    fields = tuple(fields)
    for text in fields:
        if "\t" in text or "\n" in text or "\r" in text:
            raise OutputError(f"{text!r} holds a tab or a line end, which a beliefs file cannot hold; rename it")
    return "\t".join(fields)


def _places(header: list[str], source: Path | str) -> tuple[str, ...]:
    missing = [column for column in COLUMNS if column not in header]
    if missing:
        remedy = "write it with `placerec decode`"
        raise EvaluationError(at(source, 1, f"not a beliefs file: no column {', '.join(missing)}; {remedy}"))
    if tuple(header[: len(COLUMNS)]) != COLUMNS:
        found, wanted = " ".join(header[: len(COLUMNS)]), " ".join(COLUMNS)
        raise EvaluationError(at(source, 1, f"the header begins {found!r}; the order is {wanted!r}"))
    places = header[len(COLUMNS) :]
    if places and places[-1] == UNKNOWN_PLACE:
        places = places[:-1]
    if not places:
        raise EvaluationError(at(source, 1, f"no column for a place after {COLUMNS[-1]!r}; one per place is needed"))
    for index, place in enumerate(places):
        if place in places[:index] or place in (*COLUMNS, UNKNOWN_PLACE, ""):
            raise EvaluationError(at(source, 1, f"{place!r} cannot be the name of one more place; rename that column"))
    return tuple(places)


def _row(fields: list[str], header: list[str], places: tuple[str, ...], answers: frozenset[str]) -> BeliefRow:
    if len(fields) != len(header):
        raise ValueError(f"the line has {len(fields)} of the header's {len(header)} fields; mend or remove it")
    frame, time, place, word, selected, best = fields[: len(COLUMNS)]
    if selected not in ("0", "1"):
        raise ValueError(f"selected is {selected!r}; it is 1 or 0")
    if best not in answers:
        raise ValueError(f"best is {best!r}, which is no place of the header; the places are {', '.join(places)}")
    cells = fields[len(COLUMNS) :]
    numbers = [_probability(cell, column) for cell, column in zip(cells, header[len(COLUMNS) :], strict=True)]
    belief, unknown = numbers[: len(places)], numbers[-1] if UNKNOWN_PLACE in answers else None
    if abs(math.fsum(belief) - 1) > _SUM_TOLERANCE:
        raise ValueError(f"the beliefs sum to {math.fsum(belief):.6g}, not to 1; decode the sequence again")
    return BeliefRow(frame, _seconds(time), place, word, selected == "1", best, belief, unknown)


def _seconds(text: str) -> float:
    if not text:
        return math.nan
    seconds = number_in(text)
    if not math.isfinite(seconds):
        raise ValueError(f"time is {text!r}, not a number of seconds; leave it empty where it is unknown")
    return seconds


def _probability(text: str, column: str) -> float:
    value = number_in(text)
    if not 0 <= value <= 1:
        raise ValueError(f"the belief in {column} is {text!r}, not a number from 0 to 1; decode the sequence again")
    return value
