"""Counts files: section 4.2 of our SRILM specification."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from placerec.srilm.text.numbers import bounded_int, leading_float
from placerec.srilm.text.streams import Lines, SrilmError, Streams, tokens

if TYPE_CHECKING:
    from placerec.lm.counts import NgramCounts
    from placerec.srilm.text.vocabulary import WordList

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


@dataclass
class Table:
    """N-grams as SRILM's word numbers, with their counts, in the order of the file."""

    ngrams: list[list[int]] = field(default_factory=list)
    counts: list[float] = field(default_factory=list)

    def add(self, ngram: list[int], count: float) -> None:
        """Append an n-gram and its count."""
        self.ngrams.append(ngram)
        self.counts.append(count)

    def emptied(self) -> "Table":
        """The n-grams of this table, each with count 0."""
        return Table(self.ngrams, [0.0] * len(self.ngrams))

    def within(self, other: "Table") -> "Table":
        """The n-grams that `other` holds too, as n-gram or as the beginning of one."""
        held = {tuple(ngram[:n]) for ngram in other.ngrams for n in range(1, len(ngram) + 1)}
        kept = [i for i, ngram in enumerate(self.ngrams) if tuple(ngram) in held]
        return Table([self.ngrams[i] for i in kept], [self.counts[i] for i in kept])

    def count(self, order: int, words: "WordList", *, fractional: bool) -> "NgramCounts":
        """The counts of the n-grams up to `order` over the sorted vocabulary; repeated n-grams add up."""
        # Not needed by ngram-merge, which starts much sooner without.
        import numpy as np

        from placerec.lm.counts import tabulate

        vocabulary, sorted_number = words.sorted()
        dtype = np.float64 if fractional else np.int64
        groups, values = [], []
        for n in range(1, order + 1):
            which = [i for i, ngram in enumerate(self.ngrams) if len(ngram) == n]
            numbers = np.array([self.ngrams[i] for i in which], np.int64).reshape(len(which), n)
            groups.append(sorted_number[numbers])
            values.append(np.array([self.counts[i] for i in which], dtype))
        return tabulate(vocabulary, order, groups, values)


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


def read_counts(
    name: str,
    order: int,
    words: "WordList",
    streams: Streams,
    *,
    fractional: bool,
    limited: bool = False,
    minima: Sequence[float] | None = None,
) -> Table:
    """The n-grams up to `order` of a counts file, those of `tabled`."""
    return tabled(count_lines(name, fractional, streams), order, words, limited=limited, minima=minima)


def tabled(
    counts: Iterable[tuple[list[str], float]],
    order: int,
    words: "WordList",
    *,
    limited: bool = False,
    minima: Sequence[float] | None = None,
) -> Table:
    """The table of n-grams up to `order` and their counts.

    `limited`: those with a word that is not listed are left out. `minima`: so are, instead, those seen more rarely than
    the minimum of their order, the last one repeats (-read-with-mincounts); with a meta tag, the counts of counts of
    what is left out after each prefix that is kept come last.
    """
    table = Table()
    dropped: dict[tuple[str, ...], Counter[int]] = {}
    for ngram, count in counts:
        if len(ngram) > order:
            continue
        if minima is not None:
            if count < minima[min(len(ngram), len(minima)) - 1]:
                dropped.setdefault(tuple(ngram[:-1]), Counter())[int(count)] += 1
                continue
        elif limited and any(
            words.normal(word) not in words.index and words.occurrences(words.normal(word)) < 0 for word in ngram
        ):
            continue
        table.add([words.number(word) for word in ngram], count)
    if words.meta_tag is not None:
        kept = {tuple(ngram[:-1]) for ngram in table.ngrams}
        for prefix, tally in dropped.items():
            numbers = [words.known(word) for word in prefix]
            if tuple(numbers) in kept:
                for k, times in sorted(tally.items()):
                    table.add([*numbers, words.add(f"{words.meta_tag}{k}")], times)
    return table
