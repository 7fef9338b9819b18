"""Token streams: one visual word per frame, as a text file.

Grammar of `NAME.tsv` (UTF-8, LF, tabs; readers need only the column `word`, and accept more columns in any order)::

    file  = "frame" TAB "time" TAB "place" TAB "word" TAB "distance" NL { line }
    line  = name TAB [ seconds ] TAB [ place ] TAB word TAB [ distance ] NL

`time` is empty where the source has no time stamps, `place` where the frame has no label. Lines are in time order.
A text of words without a header (separated by blanks or line ends) is read as a stream without times and labels.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import StreamError, at, refuse_string
from placerec.files import all_lines, number_in, write_text
from placerec.frames.places import checked_place
from placerec.frames.table import FrameTable

COLUMNS = ("frame", "time", "place", "word", "distance")
HEADER = "\t".join(COLUMNS) + "\n"
# SRILM gives these a meaning of their own, and skips lines that start with ##.
RESERVED = ("<s>", "</s>", "<unk>", "-pau-")


@dataclass(frozen=True, repr=False)
class WordStream:
    """The words of one sequence: one per frame, in the order of the rows of `table`, which is that of time.

    `distances` float64 (n,): from the descriptor to its unit, nan where unknown.
    """

    name: str
    table: FrameTable
    words: tuple[str, ...]
    distances: Floats

    @staticmethod
    def of(
        name: str,
        words: Sequence[str],
        places: Sequence[str] | None = None,
        *,
        frames: Iterable[str] | None = None,
        times: Sequence[float] | Floats | None = None,
        distances: Sequence[float] | Floats | None = None,
    ) -> "WordStream":
        """A stream from columns, as another tokeniser makes it.

        `places` are the labels, "" where there is none; `times` are in seconds; `frames` are names, their numbers if
        left out. StreamError for a string in place of words or places, and for columns of different lengths.
        """
        refuse_string(words, StreamError)
        refuse_string(places, StreamError)
        table = FrameTable.of(name, map(str, range(len(words))) if frames is None else frames, times, places)
        far = np.full(len(words), np.nan) if distances is None else np.array(distances, np.float64)
        if not len(words) == len(table) == len(far):
            columns = f"{len(words)} words and {len(far)} distances of {len(table)} frames"
            raise StreamError(f"{name}: {columns}; give one of each a frame")
        return WordStream(name, table, tuple(words), far)

    @staticmethod
    def concat(parts: Sequence["WordStream"]) -> "WordStream":
        """Parts of one sequence, one behind the other; `parts` holds at least one."""
        return WordStream(
            parts[0].name,
            FrameTable.concat(part.table for part in parts),
            tuple(chain.from_iterable(part.words for part in parts)),
            np.concatenate([part.distances for part in parts]),
        )

    def __len__(self) -> int:
        return len(self.words)

    def __repr__(self) -> str:
        labels = len({*self.table.places} - {""})
        return f"WordStream({self.name!r}: {len(self)} frames, {len({*self.words})} words, {labels} places)"

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """The names of the frames."""
        return tuple(self.table.names)

    @property
    def times(self) -> Floats:
        """Seconds, float64 (n,), nan where unknown."""
        return self.table.times

    @cached_property
    def places(self) -> tuple[str, ...]:
        """The labels, "" where there is none."""
        return tuple(self.table.places)

    def renamed(self, name: str) -> "WordStream":
        """The stream as that of a sequence that is called `name`."""
        return replace(self, name=name, table=self.table.renamed(name))


def format_seconds(time: float) -> str:
    """Seconds as decimal text, "" for nan; to the microsecond, since stamps in epoch seconds hold noise beyond."""
    return "" if math.isnan(time) else np.format_float_positional(time, precision=6, trim="-")


def write_stream(stream: WordStream, path: Path | str) -> None:
    """Write a token stream file, whole or not at all."""
    write_text(Path(path), HEADER + format_rows(stream))


def format_rows(stream: WordStream) -> str:
    """The lines of a token stream file after its header; StreamError for a frame's name that a line cannot hold."""
    lines = []
    for frame, time, place, word, distance in zip(
        stream.frames, stream.times, stream.places, stream.words, stream.distances, strict=True
    ):
        if set(frame) & set("\t\n\r"):
            raise StreamError(f"{stream.name}: the frame {frame!r} holds a tab or a line end; rename the image")
        shown = "" if math.isnan(distance) else f"{distance:.6g}"
        lines.append(f"{frame}\t{format_seconds(time)}\t{place}\t{word}\t{shown}\n")
    return "".join(lines)


def read_stream(path: Path | str) -> WordStream:
    """Read a token stream file, or a plain text of words.

    Raises StreamError, naming the file, the line and the value, for what is not by the grammar.
    """
    path = Path(path)
    lines = all_lines(path, StreamError)
    header = lines[0].split("\t")
    name = stream_name(path)
    if "word" not in header:
        if len(header) > 1 or "frame" in header:
            raise StreamError(at(path, 1, f"the header {lines[0]!r} has no column 'word'"))
        if not any(line.split() for line in lines):
            raise StreamError(f"{path}: holds no word; a token stream or a text of words is expected")
        return WordStream.of(name, [check_word(path, i, w) for i, line in enumerate(lines, 1) for w in line.split()])
    rows = [(i, line.split("\t")) for i, line in enumerate(lines[1:], start=2) if line]
    for i, fields in rows:
        if len(fields) != len(header):
            raise StreamError(at(path, i, f"{len(fields)} fields found, {len(header)} expected as in the header"))
    column = {title: [fields[at_] for _, fields in rows] for at_, title in enumerate(header)}
    line_numbers = [i for i, _ in rows]
    for i, place in zip(line_numbers, column.get("place", []), strict=False):
        if place:
            checked_place(path, i, place, StreamError)
    blank = [""] * len(rows)
    times = _numbers(path, line_numbers, "time", column.get("time", blank))
    words = [check_word(path, i, word) for i, word in zip(line_numbers, column["word"], strict=True)]
    distances = _numbers(path, line_numbers, "distance", column.get("distance", blank))
    return WordStream.of(name, words, column.get("place"), frames=column.get("frame"), times=times, distances=distances)


def stream_name(path: Path) -> str:
    """The name of the sequence in a file: that of the file, without .gz and the suffix before it."""
    return Path(path.name.removesuffix(".gz")).stem


def check_word(path: Path | str, line: int, word: str) -> str:
    """`word` if it can stand in sentences and ARPA files, else a StreamError with its position."""
    if not word or word.split() != [word]:
        raise StreamError(at(path, line, f"the word {word!r} is empty or holds white space"))
    if word in RESERVED or word.startswith("##"):
        raise StreamError(at(path, line, f"the word {word!r} has a meaning of its own in language models; rename it"))
    return word


def _numbers(path: Path, lines: Iterable[int], title: str, texts: Sequence[str]) -> Floats:
    numbers = np.full(len(texts), np.nan)
    for row, (i, text) in enumerate(zip(lines, texts, strict=True)):
        numbers[row] = number_in(text, np.inf) if text else np.nan
        if np.isinf(numbers[row]):
            raise StreamError(at(path, i, f"{title} {text!r} is not a number"))
    return numbers


def locate(path: Path, column: str, value: str) -> str:
    """`path:line` of the first `value` in a column of a token stream, or among the words of a plain text."""
    lines = all_lines(path, StreamError)
    header = lines[0].split("\t")
    for number, line in enumerate(lines, start=1):
        if "word" not in header:
            found = line.split()
        else:
            found = line.split("\t")[header.index(column) :][:1] if number > 1 else []
        if value in found:
            return f"{path}:{number}"
    return str(path)
