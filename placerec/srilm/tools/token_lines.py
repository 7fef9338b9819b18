"""ppl-from-log and compare-ppls: the lines of single tokens in `ngram -debug 2 -ppl` outputs (manual page ppl-scripts).

The manual says what is counted, not how it is printed: ppl-from-log prints the block of totals that `ngram -ppl`
prints, compare-ppls a line that names its numbers.
"""

import math
import re
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple

from placerec.lm.perplexity import Totals
from placerec.lm.vocabulary import SENTENCE_END, UNKNOWN
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.assignments import split_assignments
from placerec.srilm.tools.compute_best_mix import TOKEN_LINE
from placerec.srilm.tools.reports import totals_block

# The tag in front of p.
_UNKNOWN_TAG = re.compile(r"\[OOV\](?: \S*)?$")


class Token(NamedTuple):
    """A token that was scored: the word, log10 p, whether it is unknown to the model, and how often it counts."""

    word: str
    log10_p: float
    unknown: bool
    times: float


def tokens_in(name: str, streams: Streams, tool: str) -> Iterator[Token]:
    """The tokens of an output; other lines are passed over. SrilmError for a token whose p is no number."""
    lines = streams.lines(name)
    for line in lines:
        if match := TOKEN_LINE.match(line):
            word, unknown = match[1], match[1] == UNKNOWN or _UNKNOWN_TAG.search(match[2]) is not None
            log10_p, times = leading_float(match[3]), leading_float(match[4] or "1")
            if log10_p is None or math.isnan(log10_p) or log10_p == math.inf or times is None:
                raise SrilmError(f"{tool}: {lines.position}{line.strip()!r} has no log probability")
            yield Token(word, log10_p, unknown, times)


@exit_status
def ppl_from_log(arguments: Sequence[str], streams: Streams, tool: str = "ppl-from-log") -> int:
    """Print the totals of the tokens that are listed, of which some may have been left out."""
    _, files = split_assignments(arguments, f"usage: {tool} [PPL ...]  (outputs of ngram -debug 2 -ppl)")
    total = Totals()
    for name in files:
        for token in tokens_in(name, streams, tool):
            total = total.plus(_totals(token))
    streams.print(totals_block(total))
    return 0


def _totals(token: Token) -> Totals:
    zero = token.log10_p == -math.inf
    end = token.word == SENTENCE_END
    one = Totals(
        sentences=end,
        words=not end,
        oovs=zero and token.unknown,
        zeroprobs=zero and not token.unknown,
        log10_p=0.0 if zero else token.log10_p,
    )
    return one.times(token.times)


@exit_status
def compare_ppls(arguments: Sequence[str], streams: Streams, tool: str = "compare-ppls") -> int:
    """Print for how many tokens the second model's p is that of the first, higher, or lower."""
    usage = f"usage: {tool} [mindelta=D] PPL1 PPL2  (outputs of ngram -debug 2 -ppl for one text)"
    values, files = split_assignments(arguments, usage)
    least = leading_float(values.get("mindelta", "0"))
    if least is None or not 0 <= least < math.inf:
        raise SrilmError(f"{tool}: mindelta={values['mindelta']}: a number of at least 0 is needed", 2)
    if len(files) != 2:
        raise SrilmError(usage, 2)
    total = equal = higher = 0
    for one, other in zip_longest(*(tokens_in(name, streams, tool) for name in files)):
        total += 1
        if one is None or other is None or not _may_be_one(one, other):
            where = (
                f"token {total}: {'none' if one is None else one.word} and {'none' if other is None else other.word}"
            )
            raise SrilmError(f"{tool}: {' and '.join(files)} are not of one text ({where})")
        # Of two zeros the difference is no number.
        same = one.log10_p == other.log10_p or abs(other.log10_p - one.log10_p) < least
        equal += same
        higher += not same and other.log10_p > one.log10_p
    streams.print(f"total {total}, equal {equal}, higher {higher}, lower {total - equal - higher}\n")
    return 0


def _may_be_one(one: Token, other: Token) -> bool:
    """Whether tokens can be of one word, which may be unknown to a model."""
    return one.word == other.word or one.unknown or other.unknown
