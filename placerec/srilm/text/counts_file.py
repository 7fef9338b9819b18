"""Counts files: section 4.2 of our SRILM specification."""

import re
from collections.abc import Iterable, Iterator

from placerec.srilm.text.numbers import bounded_int, leading_float
from placerec.srilm.text.streams import Lines, SrilmError, Streams, tokens

MOST_TOKENS = 100
TOO_MANY = f"{{}} is above {2**63 - 1}, the most that can be counted; divide the counts, or use -float-counts"
MALFORMED = "malformed N-gram count or more than 100 words per line"


# SRILM's integers end at 2^64 - 1, numpy's here.
MOST = 2**63 - 1


def parse_count(text: str, fractional: bool, *, most: int | None = None) -> float | None:
    """The count at the start of a text, as C's scanf reads it (%lu or %lf), `most` if it is greater.

    None if there is none. Without `most`, SrilmError for a count above MOST.
    """
    if fractional:
        return leading_float(text)
    match = re.match(r"\+?([0-9]+)", text)
    count = bounded_int(match[1], most=2**64 if most is None else most) if match else None
    if count is not None and most is None and count > MOST:
        raise SrilmError(TOO_MANY.format(f"the count {text}"))
    return count


def split_count(line: str, fractional: bool, *, most: int | None = None) -> tuple[list[str], float | None]:
    """The words of an n-gram and the count behind them; None for the count of a malformed line."""
    *ngram, text = tokens(line)
    return ngram, parse_count(text, fractional, most=most) if 0 < len(ngram) < MOST_TOKENS else None


def count_lines(
    name: str, fractional: bool, streams: Streams, *, most: int | None = None
) -> Iterator[tuple[list[str], float]]:
    """The n-grams of a counts file and their counts, at most `most`; a malformed line is reported and ends the file."""
    lines = streams.lines(name)
    yield from counted(lines, lines, fractional, most=most)


def counted(
    lines: Lines, rest: Iterable[str], fractional: bool, *, most: int | None = None
) -> Iterator[tuple[list[str], float]]:
    """What `count_lines` has of a file, from the lines that are left of one."""
    for line in rest:
        ngram, count = split_count(line, fractional, most=most)
        if count is None:
            lines.streams.say(f"{lines.position}{MALFORMED}")
            return
        yield ngram, count
