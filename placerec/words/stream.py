"""Token streams: one visual word per frame, as a text file.

Grammar of `NAME.tsv` (UTF-8, LF, tabs; readers need only the column `word`, and accept more columns in any order)::

    file  = "frame" TAB "time" TAB "place" TAB "word" TAB "distance" { more } NL { line }
    more  = TAB "word." NAME TAB "distance." NAME
    line  = name TAB [ seconds ] TAB [ place ] TAB word TAB [ distance ] { TAB word TAB [ distance ] } NL

`time` is empty where the source has no time stamps, `place` where the frame has no label. Lines are in time order. Of
several dictionaries the first one has the columns `word` and `distance`, each further one columns with its NAME.
A text of words without a header (separated by blanks or line ends) is read as a stream without times and labels.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import StreamError, at, counted, refuse_string
from placerec.files import all_lines, number_in, read_lines, write_text
from placerec.frames.places import check_place, checked_place
from placerec.frames.table import FrameTable

COLUMNS = ("frame", "time", "place", "word", "distance")
# The name of the first dictionary, and what columns of further ones begin with.
FIRST, WORD, DISTANCE = "", "word.", "distance."
# What a model's folder has beside the folders of its dictionaries.
TAKEN = ("sentences", "counts", "tokens")
# SRILM gives these a meaning of their own, and skips lines that start with ##.
RESERVED = ("<s>", "</s>", "<unk>", "-pau-")


@dataclass(frozen=True)
class WordColumn:
    """The words (n) of a sequence in a further dictionary, and their distances float64 (n,), nan where unknown."""

    words: tuple[str, ...]
    distances: Floats


@dataclass(frozen=True, repr=False)
class WordStream:
    """The words of one sequence: one per frame, in the order of the rows of `table`, which is that of time.

    `distances` float64 (n,): from the descriptor to its unit, nan where unknown. `further`: the words in other
    dictionaries than the first one, by the dictionary's name.
    """

    name: str
    table: FrameTable
    words: tuple[str, ...]
    distances: Floats
    further: Mapping[str, WordColumn] = field(default_factory=dict)

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
            {
                name: WordColumn(
                    tuple(chain.from_iterable(part.further[name].words for part in parts)),
                    np.concatenate([part.further[name].distances for part in parts]),
                )
                for name in parts[0].further
            },
        )

    def __len__(self) -> int:
        return len(self.words)

    def __repr__(self) -> str:
        words, labels = len({*self.words}), len({*self.table.places} - {""})
        of = f"{counted(words, 'word')}, {counted(labels, 'place')}"
        return f"WordStream({self.name!r}: {counted(len(self), 'frame')}, {of})"

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

    @property
    def dictionaries(self) -> tuple[str, ...]:
        """The names of the dictionaries that the frames have words of; that of the first one is empty."""
        return FIRST, *self.further

    def in_dictionary(self, name: str) -> "WordStream":
        """The stream with the words of one of `dictionaries` alone."""
        if name == FIRST and not self.further:
            return self
        column = self if name == FIRST else self.further[name]
        return WordStream(self.name, self.table, column.words, column.distances)

    def to_dict(self) -> dict[str, Sequence[str] | Floats]:
        """The columns of the token stream's file: `pandas.DataFrame(stream.to_dict())`, and so for polars."""
        columns: dict[str, Sequence[str] | Floats] = {"frame": self.frames, "time": self.times, "place": self.places}
        for name in self.dictionaries:
            own = self.in_dictionary(name)
            columns |= {column_of(name): own.words, f"{DISTANCE}{name}".rstrip("."): own.distances}
        return columns

    def renamed(self, name: str) -> "WordStream":
        """The stream as that of a sequence that is called `name`."""
        return replace(self, name=name, table=self.table.renamed(name))


def format_seconds(time: float) -> str:
    """Seconds as decimal text, "" for nan; to the microsecond, since stamps in epoch seconds hold noise beyond."""
    return "" if math.isnan(time) else np.format_float_positional(time, precision=6, trim="-")


def write_stream(stream: WordStream, path: Path | str) -> None:
    """Write a token stream file, whole or not at all."""
    write_text(Path(path), format_header(stream) + format_rows(stream))


def column_of(dictionary: str) -> str:
    """The column that holds the words of a dictionary."""
    return WORD + dictionary if dictionary else "word"


def dictionary_in(column: str) -> str:
    """The dictionary whose words a column holds."""
    return FIRST if column == "word" else column.removeprefix(WORD)


def format_header(stream: WordStream) -> str:
    """The first line of a token stream file."""
    more = (column + name for name in stream.further for column in (WORD, DISTANCE))
    return "\t".join((*COLUMNS, *more)) + "\n"


def format_rows(stream: WordStream) -> str:
    """The lines of a token stream file after its header; StreamError for a frame's name that a line cannot hold."""
    lines = []
    owners: tuple[WordStream | WordColumn, ...] = (stream, *stream.further.values())
    columns = (column for own in owners for column in _shown(own))
    for frame, time, place, *words in zip(stream.frames, stream.times, stream.places, *columns, strict=True):
        if set(frame) & set("\t\n\r"):
            raise StreamError(f"{stream.name}: the frame {frame!r} holds a tab or a line end; rename the image")
        lines.append("\t".join((frame, format_seconds(time), place, *words)) + "\n")
    return "".join(lines)


def _shown(column: WordStream | WordColumn) -> tuple[Sequence[str], Sequence[str]]:
    """Words and distances as text."""
    return column.words, ["" if math.isnan(distance) else f"{distance:.6g}" for distance in column.distances]


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

    def words_of(dictionary: str) -> WordColumn:
        title = f"distance{dictionary}"
        words = [check_word(path, i, word) for i, word in zip(line_numbers, column[f"word{dictionary}"], strict=True)]
        return WordColumn(tuple(words), _numbers(path, line_numbers, title, column.get(title, blank)))

    first = words_of("")
    stream = WordStream.of(
        name, first.words, column.get("place"), frames=column.get("frame"), times=times, distances=first.distances
    )
    _, *further = _dictionaries(path, header)
    return replace(stream, further={dictionary: words_of(f".{dictionary}") for dictionary in further})


def read_dictionaries(path: Path | str) -> tuple[str, ...]:
    """The names of the dictionaries whose words a token stream file has, of which its first line alone is read.

    Raises StreamError for a file that cannot be read and for a name that a dictionary cannot have.
    """
    path = Path(path)
    return _dictionaries(path, next(read_lines(path, StreamError), "").split("\t"))


def _dictionaries(path: Path, header: Sequence[str]) -> tuple[str, ...]:
    # A text of words has no header.
    further = [dictionary_in(title) for title in header if title.startswith(WORD)] if "word" in header else []
    for dictionary in further:
        if reason := "is taken" if dictionary in TAKEN else check_place(dictionary):
            raise StreamError(at(path, 1, f"the name {dictionary!r} of a dictionary {reason}; rename the column"))
    return FIRST, *further


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
