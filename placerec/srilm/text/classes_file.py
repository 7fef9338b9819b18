"""Classes files: lines `CLASS [P] w1 w2 ...`; section T1 of our specification of SRILM's tools."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import dropwhile, islice
from typing import NamedTuple

from placerec.srilm.text.numbers import whole_float
from placerec.srilm.text.streams import Lines, SrilmError, Streams, tokens

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


def read_expansions(lines: Lines, streams: Streams, *, behind_model: bool = False) -> Iterator[Expansion]:
    """The expansions in a file's lines; one without words is reported, and ends the file.

    `behind_model`: they follow an ARPA model's `\\end\\`. Raises SrilmError for what is no probability.
    """
    found: Iterable[str] = lines
    if behind_model:
        found = islice(dropwhile(lambda line: not line.startswith("\\end\\"), lines), 1, None)
    for line in found:
        expansion = split_expansion(tokens(line))
        if not expansion.words:
            streams.say(f"{lines.position}{NO_WORDS}")
            return
        if expansion.p is not None and not 0 <= expansion.p < math.inf:
            raise SrilmError(f"{lines.position}class probability {expansion.p:g}: a number of at least 0 is needed")
        yield expansion


def format_expansions(expansions: Iterable[Expansion]) -> str:
    """Lines `CLASS P words`, sorted by their bytes."""
    ordered = sorted(expansions, key=lambda expansion: (expansion.name, " ".join(expansion.words)))
    return "".join(f"{name} {1.0 if p is None else p:.16f} {' '.join(words)}\n" for name, p, words in ordered)
