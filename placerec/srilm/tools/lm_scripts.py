"""sort-lm, make-sub-lm, get-unigram-probs and reverse-lm: ARPA files line by line (SRILM's manual page lm-scripts)."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from placerec.lm.logs import ABOUT_LOG_ZERO, LOG_ZERO
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.text.numbers import leading_float, leading_int
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.tools.assignments import records, split_assignments

# Beyond it p does not fit into a float64.
_MOST_LOG10 = 308.0
_REVERSED = 2
_HEADER = re.compile(r"ngram\s*(\d{1,9})\s*=", re.ASCII)
_SECTION = re.compile(r"\\(\d{1,9})-grams:", re.ASCII)


class _Line(NamedTuple):
    """A line of an ARPA file; `order`: of the n-grams around it, 0 outside of them; `ngram`: its words."""

    text: str
    order: int = 0
    ngram: tuple[str, ...] = ()


def arpa_lines(lines: Iterable[tuple[int, str]], name: str, tool: str) -> Iterator[_Line]:
    """What numbered lines of an ARPA file are; SrilmError if it has no end, or an n-gram lacks words."""
    order = 0
    for number, text in lines:
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


def p_of_line(line: _Line, tool: str) -> float:
    """The probability of an n-gram, 0 for the stand-ins of log 0; SrilmError where there is no logarithm of one."""
    value = _log10_in(line, 0, tool)
    return 0.0 if value <= ABOUT_LOG_ZERO else float(10**value)


def _model_lines(files: Sequence[str], usage: str, streams: Streams, tool: str) -> Iterator[_Line]:
    """The lines of the one model that a script reads."""
    if len(files) > 1:
        raise SrilmError(usage, 2)
    return arpa_lines(enumerate(records(files[0], streams), start=1), files[0], tool)


@exit_status
def sort_lm(arguments: Sequence[str], streams: Streams, tool: str = "sort-lm") -> int:
    """Print a model with the n-grams of each order sorted by their words, the first word first."""
    usage = f"usage: {tool} [MODEL]  (default: standard input)"
    _, files = split_assignments(arguments, usage)
    waiting: list[_Line] = []
    shown = []
    for line in _model_lines(files, usage, streams, tool):
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
    for line in _model_lines(files, usage, streams, tool):
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
    for line in _model_lines(files, usage, streams, tool):
        if line.order == 1 and line.ngram:
            p = p_of_line(line, tool)
            shown.append(f"{line.ngram[0]} {p:g}\n" if linear else f"{line.ngram[0]} {tokens(line.text)[0]}\n")
    streams.print("".join(shown))
    return 0


@exit_status
def reverse_lm(arguments: Sequence[str], streams: Streams, tool: str = "reverse-lm") -> int:
    """Print the bigram model that gives a sentence read backwards what the model gives the sentence.

    By Bayes' rule p(v | w) is p(v) p(w | v) / p(w), where </s> and <s> change places: along a sentence the p of single
    words cancel. Bigrams that are not listed are backed off to p(v) bow(v), which depends on v alone. The marginals
    need not be those that the bigrams imply: contexts of the result may not sum to 1 (by the manual, a known fault).
    """
    usage = f"usage: {tool} [MODEL]  (default: standard input)"
    _, files = split_assignments(arguments, usage)
    listed = [line for line in _model_lines(files, usage, streams, tool) if line.ngram]
    if any(line.order > _REVERSED for line in listed):
        raise SrilmError(f"{tool}: only bigram models are reversed; see make-sub-lm maxorder=2")
    log10_p = {line.ngram: _log10_in(line, 0, tool) for line in listed}
    least = min((p for ngram, p in log10_p.items() if len(ngram) == 1 and p > ABOUT_LOG_ZERO), default=0.0)
    # Whatever stands for a word's own p cancels along a sentence: words of p 0 get some, and both ends the same.
    own = {word: max(p, least) for (word, *more), p in log10_p.items() if not more}
    own[SENTENCE_START] = own.setdefault(SENTENCE_END, least)
    words = {}
    for line in listed:
        if line.order == 1:
            (word,) = line.ngram
            words[_mirrored(word)] = LOG_ZERO if word == SENTENCE_END else own[word] + _log10_in(line, 2, tool)
    pairs = {}
    for ngram, p in log10_p.items():
        if len(ngram) > 1:
            before, behind = ngram
            if not own.keys() >= {before, behind}:
                raise SrilmError(f"{tool}: {' '.join(ngram)!r} has a word that is not among the 1-grams")
            reverse = p + own[before] - own[behind] if p > ABOUT_LOG_ZERO else LOG_ZERO
            pairs[_mirrored(behind), _mirrored(before)] = reverse
    contexts = {first for first, _ in pairs}
    shown = ["", "\\data\\", f"ngram 1={len(words)}", f"ngram 2={len(pairs)}", "", "\\1-grams:"]
    shown += [f"{words[word]:.7g}\t{word}" + ("\t0" if word in contexts else "") for word in sorted(words)]
    shown += ["", "\\2-grams:", *(f"{pairs[pair]:.7g}\t{' '.join(pair)}" for pair in sorted(pairs)), "", "\\end\\"]
    streams.print("".join(f"{text}\n" for text in shown))
    return 0


def _mirrored(word: str) -> str:
    """A word as it is called in a sentence that is read backwards."""
    return {SENTENCE_START: SENTENCE_END, SENTENCE_END: SENTENCE_START}.get(word, word)


def _log10_in(line: _Line, place: int, tool: str) -> float:
    """The number in front of an n-gram (place 0) or behind it; 0 where none stands behind it, -308 for -inf."""
    fields = tokens(line.text)
    value = leading_float(fields[place]) if place < len(fields) else 0.0
    if value is None or not value <= _MOST_LOG10:
        raise SrilmError(f"{tool}: {fields[place]!r} of {' '.join(line.ngram)!r} is no log probability")
    return max(value, -_MOST_LOG10)
