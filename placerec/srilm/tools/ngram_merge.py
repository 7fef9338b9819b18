"""ngram-merge: the sum of sorted counts files, a line of each in memory at a time; section 12 of our specification."""

import heapq
from collections.abc import Iterator, Sequence
from itertools import islice

from placerec.srilm.text.counts_file import count_lines
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.options import Option, parse

TOOL = "ngram-merge"
OPTIONS = {
    "write": Option("string", "-", "file for the merged counts"),
    "float-counts": Option("flag", False, "counts are real numbers"),
}
_MODULUS = 2**32
_BLOCK = 10_000

Heads = list[tuple[list[str], int, float]]


@exit_status
def ngram_merge(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Merge counts files that are sorted as by `ngram-count -sort`; returns the exit status."""
    parsed = parse(tool, OPTIONS, arguments, streams, stops=True)
    if len(parsed.rest) < 2:
        raise SrilmError("need at least two input files")
    fractional = parsed["float-counts"]
    files = [count_lines(name, fractional, streams, most=2**64 - 1) for name in parsed.rest]
    heads: Heads = []
    for i, file in enumerate(files):
        heads += [(words, i, count) for words, count in islice(file, 1)]
    with streams.output(parsed["write"]) as output:
        lines = _merged(heads, files, fractional)
        while block := "".join(islice(lines, _BLOCK)):
            output.write(block.encode("latin-1"))
    return 0


def _merged(heads: Heads, files: Sequence[Iterator[tuple[list[str], float]]], fractional: bool) -> Iterator[str]:
    """The lines of the n-grams of all files in order, each with its sum; `heads` holds each file's next n-gram."""
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
        shown = f"{total:.16g}" if fractional else f"{int(total) % _MODULUS}"
        yield f"{' '.join(words)}\t{shown}\n"
