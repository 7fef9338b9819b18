"""Classes files: lines `CLASS [P] w1 w2 ...`; section T1 of our specification of SRILM's tools."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from placerec.srilm.text.numbers import whole_float
from placerec.srilm.text.streams import Lines, Streams, tokens

NO_WORDS = "class expansion contains no words"


class Expansion(NamedTuple):
    """What a class stands for with some probability (None: none was given): one word or several."""

    name: str
    p: float | None
    words: tuple[str, ...]


def split_expansion(fields: Sequence[str]) -> Expansion:
    """The expansion that a line's fields tell of; a second field that is a number is the probability."""
    p = whole_float(fields[1]) if len(fields) > 1 else None
    return Expansion(fields[0], p, tuple(fields[1 if p is None else 2 :]))


def read_expansions(lines: Lines, streams: Streams) -> Iterator[Expansion]:
    """The expansions in a file's lines; a line without words is reported and left out."""
    for line in lines:
        expansion = split_expansion(tokens(line))
        if expansion.words:
            yield expansion
        else:
            streams.say(f"{lines.position}{NO_WORDS}")
