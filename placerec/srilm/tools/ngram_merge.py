"""ngram-merge: the sum of sorted counts files, a part of each in memory at a time; section 12 of our specification."""

import heapq
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cached_property
from io import BytesIO
from itertools import chain, islice

from placerec.srilm.text.counts_file import count_lines, counted
from placerec.srilm.text.plain_counts import MODULUS, plain_counts
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.options import Option, parse

TOOL = "ngram-merge"
OPTIONS = {
    "write": Option("string", "-", "file for the merged counts"),
    "float-counts": Option("flag", False, "counts are real numbers"),
}
_MOST = 2**64 - 1
_BATCH = 10_000
# Bytes read at once: of a file, at least of a file, and of all files.
_BLOCK, _LEAST, _OF_ALL = 1 << 14, 1 << 12, 1 << 18

Counted = Iterator[tuple[list[str], float]]


@exit_status
def ngram_merge(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Merge counts files that are sorted as by `ngram-count -sort`; returns the exit status."""
    parsed = parse(tool, OPTIONS, arguments, streams, stops=True)
    if len(parsed.rest) < 2:
        raise SrilmError("need at least two input files")
    fractional, size = parsed["float-counts"], max(_LEAST, min(_BLOCK, _OF_ALL // len(parsed.rest)))
    if parsed.rest.count("-") > 1:
        # They take the lines of standard input in turn.
        turns = [count_lines(name, fractional, streams, most=_MOST) for name in parsed.rest]
        merged = _merged_lines([[*islice(file, 1)] for file in turns], turns, fractional)
    else:
        merged = _merged_blocks([_File(name, fractional, size, streams) for name in parsed.rest], fractional)
    with streams.output(parsed["write"]) as output:
        output.writelines(block.encode("latin-1") for block in merged)
    return 0


class _File:
    """A counts file: many of its n-grams at once, with the texts of their counts, as long as all its lines are plain.

    `plain`: they were, so far. `ngrams` and `counts` were read last; those before `place` have been taken.
    """

    def __init__(self, name: str, fractional: bool, size: int, streams: Streams) -> None:
        self.lines = streams.lines(name)
        self.blocks = self.lines.blocks(size)
        self.fractional = fractional
        self.plain = True
        self.ngrams: list[str] = []
        self.counts: list[str] = []
        self.place = 0
        self.fill()

    def fill(self) -> None:
        """Read on if all was taken; nothing is left to take at the end of the file, and where lines are not plain."""
        if self.place < len(self.ngrams) or not self.plain:
            return
        last, block = self.ngrams[-1:], next(self.blocks, b"")
        read = plain_counts(block, self.fractional) if block else ([], [])
        self.plain = read is not None and (not block or last < read[0][:1])
        self.ngrams, self.counts = read if read and self.plain else ([], [])
        self.place = 0
        if not self.plain:
            self.blocks = chain([block], self.blocks)
            # What is to be said of a line is said when it comes after those that were taken.
            self.head = [*islice(self.rest, 1)]

    def take(self, last: str) -> dict[str, str]:
        """The n-grams up to `last`, and their counts."""
        part = slice(self.place, bisect_right(self.ngrams, last, self.place))
        self.lines.number += part.stop - part.start
        self.place = part.stop
        return dict(zip(self.ngrams[part], self.counts[part], strict=True))

    @cached_property
    def rest(self) -> Counted:
        """What has not been taken, line by line."""
        left = zip(self.ngrams[self.place :], self.counts[self.place :], strict=True)
        lines = "".join(f"{ngram}\t{count}\n" for ngram, count in left).encode("latin-1")
        physical = (line for block in chain([lines], self.blocks) for line in BytesIO(block))
        return counted(self.lines, self.lines.of(physical), self.fractional, most=_MOST)

    @cached_property
    def head(self) -> list[tuple[list[str], float]]:
        """The first n-gram of `rest`, if there is one."""
        return [*islice(self.rest, 1)]


def _merged_blocks(files: Sequence[_File], fractional: bool) -> Iterator[str]:
    """The lines of the n-grams of all files in order, each with its sum, many at once."""
    while all(file.plain for file in files):
        ends = [file.ngrams[-1] for file in files if file.ngrams]
        if not ends:
            return
        # Of these n-grams no file holds more.
        yield _summed([file.take(min(ends)) for file in files], fractional)
        for file in files:
            file.fill()
    yield from _merged_lines([file.head for file in files], [file.rest for file in files], fractional)


def _summed(parts: Sequence[dict[str, str]], fractional: bool) -> str:
    total = parts[0]
    for part in parts[1:]:
        for ngram in total.keys() & part.keys():
            one, other = total[ngram], part[ngram]
            part[ngram] = repr(float(one) + float(other)) if fractional else str((int(one) + int(other)) % MODULUS)
        total.update(part)
    ngrams = sorted(total)
    counts = map(total.__getitem__, ngrams)
    pieces = ["\t"] * (4 * len(ngrams))
    pieces[::4], pieces[3::4] = ngrams, ["\n"] * len(ngrams)
    pieces[2::4] = map(_shown, map(float, counts)) if fractional else counts
    return "".join(pieces)


def _shown(count: float) -> str:
    return f"{count:.16g}"


def _merged_lines(
    first: Sequence[Sequence[tuple[list[str], float]]], files: Sequence[Counted], fractional: bool
) -> Iterator[str]:
    """The lines of the n-grams of files, in order, each with its sum; `first` holds each file's next n-gram."""
    heads = [(words, i, count) for i, head in enumerate(first) for words, count in head]
    lines = _merged(heads, files, fractional)
    while block := "".join(islice(lines, _BATCH)):
        yield block


def _merged(heads: list[tuple[list[str], int, float]], files: Sequence[Counted], fractional: bool) -> Iterator[str]:
    heapq.heapify(heads)
    while heads:
        words, i, total = heapq.heappop(heads)
        emptied = [i]
        # A file's next line waits until the n-gram is written: what an unsorted file repeats stays apart.
        while heads and heads[0][0] == words:
            _, i, count = heapq.heappop(heads)
            total += count
            emptied.append(i)
        for i in emptied:
            for following, count in islice(files[i], 1):
                heapq.heappush(heads, (following, i, count))
        shown = _shown(total) if fractional else f"{int(total) % MODULUS}"
        yield f"{' '.join(words)}\t{shown}\n"
