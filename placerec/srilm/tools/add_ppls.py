"""add-ppls: the sum of the totals of several `ngram -ppl` outputs (section 13 of our SRILM specification)."""

import math
import re
from collections.abc import Sequence

from placerec.lm.perplexity import Totals
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.assignments import HELP

TOOL = "add-ppls"
USAGE = "usage: {tool} [PPL ...]  (outputs of ngram -ppl; default: standard input)"
_NUMBER = r"(\S+)"
_FIRST = re.compile(rf"file .*: {_NUMBER} sentences, {_NUMBER} words, {_NUMBER} OOVs\s*$")
_SECOND = re.compile(rf"{_NUMBER} zeroprobs, logprob= {_NUMBER} ")


@exit_status
def add_ppls(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Add up the `file NAME:` blocks of all files and print their total; returns the exit status."""
    if arguments and arguments[0] in HELP:
        raise SrilmError(USAGE.format(tool=tool), 0)
    print_total(totals_of(arguments or ["-"], streams), streams)
    return 0


def totals_of(names: Sequence[str], streams: Streams) -> Totals:
    """The sum of the `file NAME:` blocks of files."""
    total = Totals()
    for name in names:
        inside = False
        for line in streams.lines(name):
            if match := _FIRST.match(line):
                total = total.plus(Totals(*map(_number, match.groups())))
            elif inside and (match := _SECOND.match(line)):
                total = total.plus(Totals(zeroprobs=_number(match[1]), log10_p=_number(match[2])))
            inside = line.startswith("file ")
    return total


def print_total(total: Totals, streams: Streams) -> None:
    """The block of a total, as scripts read it again."""
    sentences, words, unknown, zeroprobs, log10_p = total
    streams.print(f"file TOTAL: {_whole(sentences)} sentences, {_whole(words)} words, {_whole(unknown)} OOVs\n")
    if words + sentences > 0:
        scored = words - unknown - zeroprobs
        streams.print(
            f"{_whole(zeroprobs)} zeroprobs, logprob= {log10_p:g} ppl= {_perplexity(log10_p, scored + sentences)}\n"
        )


def _number(text: str) -> float:
    return leading_float(text) or 0.0


def _whole(value: float) -> str:
    """As C prints it with %d: cut at the point."""
    return f"{math.trunc(value)}" if math.isfinite(value) else f"{value}"


def _perplexity(log10_p: float, tokens: float) -> str:
    if tokens <= 0:
        return "undefined"
    exponent = -log10_p / tokens * math.log(10)
    return f"{math.exp(exponent):g}" if exponent < 709 else "inf"
