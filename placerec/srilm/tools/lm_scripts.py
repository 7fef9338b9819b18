"""sort-lm, make-sub-lm and get-unigram-probs: ARPA files line by line (SRILM's manual page lm-scripts)."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from placerec.lm.logs import ABOUT_LOG_ZERO
from placerec.srilm.text.numbers import leading_float, leading_int
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.tools.assignments import records, split_assignments

# Beyond it p does not fit into a float64.
_MOST_LOG10 = 308.0
_HEADER = re.compile(r"ngram\s*(\d{1,9})\s*=", re.ASCII)
_SECTION = re.compile(r"\\(\d{1,9})-grams:", re.ASCII)


class _Line(NamedTuple):
    """A line of an ARPA file; `order`: of the n-grams around it, 0 outside of them; `ngram`: its words."""

    text: str
    order: int = 0
    ngram: tuple[str, ...] = ()


def _lines(name: str, streams: Streams, tool: str) -> Iterator[_Line]:
    """The lines of an ARPA file; SrilmError if it has no end, or an n-gram lacks words."""
    order = 0
    for number, text in enumerate(records(name, streams), start=1):
        fields = tokens(text)
        if text.startswith("\\"):
            match = _SECTION.match(text)
            order = int(match[1]) if match else 0
            yield _Line(text, order)
            if text.startswith("\\end\\"):
                return
        elif order and fields:
            if len(fields) not in (order + 1, order + 2):
                raise SrilmError(f"{tool}: {name}: line {number}: {text!r} is no {order}-gram with its probability")
            yield _Line(text, order, tuple(fields[1 : order + 1]))
        else:
            yield _Line(text, order)
    raise SrilmError(f"{tool}: {name}: no \\end\\; is it a whole ARPA file?")


def _only(files: Sequence[str], usage: str) -> str:
    if len(files) > 1:
        raise SrilmError(usage, 2)
    return files[0]


@exit_status
def sort_lm(arguments: Sequence[str], streams: Streams, tool: str = "sort-lm") -> int:
    """Print a model with the n-grams of each order sorted by their words, the first word first."""
    usage = f"usage: {tool} [MODEL]  (default: standard input)"
    _, files = split_assignments(arguments, usage)
    waiting: list[_Line] = []
    shown = []
    for line in _lines(_only(files, usage), streams, tool):
        if line.ngram:
            waiting.append(line)
            continue
        shown += [ngram.text for ngram in sorted(waiting, key=lambda waits: waits.ngram)]
        waiting = []
        shown.append(line.text)
    streams.print("".join(f"{text}\n" for text in shown))
    return 0


@exit_status
def make_sub_lm(arguments: Sequence[str], streams: Streams, tool: str = "make-sub-lm") -> int:
    """Print a model without the n-grams that are longer than `maxorder`."""
    usage = f"usage: {tool} maxorder=N [MODEL]  (default: standard input)"
    values, files = split_assignments(arguments, usage)
    most = leading_int(values.get("maxorder", ""))
    if most is None or most < 1:
        raise SrilmError(f"{tool}: maxorder={values.get('maxorder', '')}: a number above 0 is needed\n{usage}", 2)
    shown = []
    for line in _lines(_only(files, usage), streams, tool):
        header = _HEADER.match(line.text) if not line.order else None
        if line.order > most or (header and int(header[1]) > most):
            continue
        text = line.text
        if line.order == most and line.ngram:
            # Of the longest n-grams nothing is backed off to.
            text = "\t".join((tokens(text)[0], " ".join(line.ngram)))
        shown.append(text)
    streams.print("".join(f"{text}\n" for text in shown))
    return 0


@exit_status
def get_unigram_probs(arguments: Sequence[str], streams: Streams, tool: str = "get-unigram-probs") -> int:
    """Print `WORD LOG10P` for each unigram of a model, probabilities themselves with `linear=1`."""
    usage = f"usage: {tool} [linear=1] [MODEL]  (default: standard input)"
    values, files = split_assignments(arguments, usage)
    linear = bool(leading_float(values.get("linear", "")))
    shown = []
    for line in _lines(_only(files, usage), streams, tool):
        if line.order == 1 and line.ngram:
            text = tokens(line.text)[0]
            value = leading_float(text)
            if value is None or not value <= _MOST_LOG10:
                raise SrilmError(f"{tool}: {text!r} of {line.ngram[0]!r} is no log probability")
            p = 0.0 if value <= ABOUT_LOG_ZERO else 10**value
            shown.append(f"{line.ngram[0]} {p:g}\n" if linear else f"{line.ngram[0]} {text}\n")
    streams.print("".join(shown))
    return 0
