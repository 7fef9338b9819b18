"""Discounts from counts of counts, in steps: get-gt-counts, then make-gt-discounts, make-kn-discounts or
make-abs-discount (SRILM's manual page training-scripts).

Files of counts of counts have lines `K N`: N n-grams occur K times.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints
from placerec.errors import LanguageModelError
from placerec.lm.discounts import good_turing_factors, kneser_ney_discount, modified_kneser_ney_discounts
from placerec.lm.vocabulary import SENTENCE_START
from placerec.srilm.text.counts_file import count_lines
from placerec.srilm.text.numbers import leading_int
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.tools.assignments import split_assignments
from placerec.srilm.tools.discounting import format_good_turing, format_kneser_ney

_MOST = 1_000_000


def _number(values: dict[str, str], name: str, default: int, tool: str) -> int:
    number = leading_int(values.get(name, str(default)))
    if number is None or not 0 <= number <= _MOST:
        raise SrilmError(f"{tool}: {name}={values[name]}: a number from 0 to {_MOST} is needed", 2)
    return number


@exit_status
def get_gt_counts(arguments: Sequence[str], streams: Streams, tool: str = "get-gt-counts") -> int:
    """Write how many n-grams of each order n occur 1 to `max` times, to OUT.gtNcounts."""
    usage = f"usage: {tool} [max=K] out=NAME [COUNTS ...]  (default: max=10, standard input)"
    values, files = split_assignments(arguments, usage)
    most = _number(values, "max", 10, tool)
    if not values.get("out"):
        raise SrilmError(f"{tool}: needs out=NAME\n{usage}", 2)
    tally: defaultdict[int, Counter[int]] = defaultdict(Counter)
    for name in files:
        for ngram, count in count_lines(name, False, streams):
            # What is never predicted does not count.
            if ngram[-1] != SENTENCE_START and 0 < count <= most:
                tally[len(ngram)][int(count)] += 1
    for n, counts in sorted(tally.items()):
        lines = "".join(f"{k} {counts[k]}\n" for k in range(1, most + 1))
        streams.write(f"{values['out']}.gt{n}counts", lines)
    return 0


def _tally(files: Sequence[str], streams: Streams, tool: str, *, least: int) -> Ints:
    """The counts of counts in one file, by count, at least up to `least`."""
    if len(files) != 1:
        raise SrilmError(f"{tool}: needs one file of get-gt-counts", 2)
    found = {}
    lines = streams.lines(files[0])
    for line in lines:
        numbers = [leading_int(text) for text in tokens(line)]
        match numbers:
            case [int(k), int(n)] if 0 <= k <= _MOST and 0 <= n < 2**62:
                found[k] = n
            case _:
                raise SrilmError(f"{tool}: {lines.position}{line!r} is no line of get-gt-counts, `K N`")
    tally = np.zeros(max([least, *found]) + 1, np.int64)
    for k, n in found.items():
        tally[k] = n
    return tally


@exit_status
def make_gt_discounts(arguments: Sequence[str], streams: Streams, tool: str = "make-gt-discounts") -> int:
    """Print the parameter file for `ngram-count -gtN` that counts of counts give."""
    values, files = split_assignments(arguments, f"usage: {tool} [min=MIN] [max=MAX] GTCOUNTS  (default: min=1 max=5)")
    least, most = _number(values, "min", 1, tool), _number(values, "max", 5, tool)
    factors, warnings = good_turing_factors(_tally(files, streams, tool, least=most + 1), most)
    for warning in warnings:
        streams.say(warning)
    streams.print(format_good_turing(least, factors))
    return 0


@exit_status
def make_kn_discounts(arguments: Sequence[str], streams: Streams, tool: str = "make-kn-discounts") -> int:
    """Print the parameter file for `ngram-count -knN` that counts of counts give."""
    values, files = split_assignments(arguments, f"usage: {tool} [min=MIN] GTCOUNTS  (default: min=1)")
    least = _number(values, "min", 1, tool)
    tally = _tally(files, streams, tool, least=4)
    try:
        discounts = modified_kneser_ney_discounts(*tally[1:5].tolist())
    except LanguageModelError as error:
        raise SrilmError(f"{tool}: {files[0]}: {error}") from error
    streams.print(format_kneser_ney(least, discounts))
    return 0


@exit_status
def make_abs_discount(arguments: Sequence[str], streams: Streams, tool: str = "make-abs-discount") -> int:
    """Print the discount for `ngram-count -cdiscountN` that counts of counts give: n1 / (n1 + 2 n2)."""
    _, files = split_assignments(arguments, f"usage: {tool} GTCOUNTS")
    tally = _tally(files, streams, tool, least=2)
    if tally[1] == 0:
        raise SrilmError(f"{tool}: {files[0]}: no n-gram occurs once, so that nothing is known of those never seen")
    n1, n2 = map(int, tally[1:3])
    streams.print(f"{kneser_ney_discount(n1, n2) if n2 else 1.0:g}\n")
    return 0
