"""Running text: lines to word numbers, and the markers around sentences (sections 4.1 and 10.1 of our specification).

Lines are taken many at a time; line by line from where the first NUL, VT or FF is, and where more than words is asked.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from io import BytesIO
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from placerec.ahead import make_ahead
from placerec.arrays import Ints, Mask, Numbers
from placerec.lm.vocabulary import add_markers, find_markers
from placerec.srilm.text.fields import comments, split_lines, usual_blocks, without_lines
from placerec.srilm.text.numbering import Numbering
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import Lines, tokens
from placerec.srilm.text.vocabulary import WordList

LONGEST = 50000
# Bytes read at once where lines are as programs write them, and words where they are not.
_BLOCK, _BATCH = 1 << 19, 1 << 18


class Handling(NamedTuple):
    """What is done to sentences: which markers are put around them, words that are left out, and more.

    `adding`: words that are not listed are added to the word list; otherwise they are the unknown word. `weight`: where
    a line's weight stands (`first`, `last`, or nowhere), which `parse_weight` reads, giving None for what is none, of
    which `bad_weight` is said; `too_long`: what is said of a line of more than LONGEST words. `escape`: the start of
    lines that are copied; `verbose`: keep the lines' words as they are; `noise`: numbers of words that are left out.
    """

    start: bool = True
    end: bool = True
    adding: bool = False
    weight: str = ""
    parse_weight: Callable[[str], float | None] = leading_float
    bad_weight: str = "illegal count weight or line too long?"
    too_long: str = "too many words per sentence"
    escape: str | None = None
    verbose: bool = False
    reverse: bool = False
    noise: frozenset[int] = frozenset()


def handling_of(options: Mapping[str, Any], **others: Any) -> Handling:
    """What the options for text that several commands have ask for, and `others` that one command adds."""
    weight = "last" if options.get("text-has-weights-last") else "first" if options["text-has-weights"] else ""
    return Handling(not options["no-sos"], not options["no-eos"], weight=weight, **others)


class Sentences(NamedTuple):
    """Lines as SRILM's word numbers (T,), lengths (S,), weights (S,); `shown`: their words, if `verbose`.

    `escapes`: the number of the sentence that comes next, and the line with its end. `places`: line numbers, if
    `verbose`.
    """

    numbers: Ints
    lengths: Ints
    weights: "Numbers"
    shown: Sequence[str] = ()
    escapes: Sequence[tuple[int, str]] = ()
    places: Sequence[int] = ()


def read_sentences(lines: Lines, words: WordList, handling: Handling) -> Iterator[Sentences]:
    """The sentences of a text, many at a time; lines that cannot be used are reported and left out."""
    blocks = lines.blocks(_BLOCK)
    # Names that stand for nothing are met one by one.
    if not (handling.weight or handling.escape is not None or handling.verbose or words.nameless):
        odd: list[bytes] = []
        # Nothing else is said meanwhile, so that messages keep their order.
        yield from make_ahead(_read_quickly(lines, usual_blocks(blocks, odd), words, handling))
        if not odd:
            return
        blocks = chain(odd, blocks)
    yield from _read_carefully(lines, blocks, words, handling)


def _read_quickly(lines: Lines, blocks: Iterable[bytes], words: WordList, handling: Handling) -> Iterator[Sentences]:
    numbering = Numbering(words, handling.adding)
    for block in blocks:
        fields, lengths = split_lines(block.lower() if words.lower else block)
        comment = comments(fields, lengths)
        too_long = (lengths > LONGEST) & ~comment
        for number in np.flatnonzero(too_long).tolist():
            lines.streams.say(f"{lines.name}: line {lines.number + number + 1}: {handling.too_long}")
        fields, lengths = without_lines(fields, lengths, comment | too_long)
        lines.number += len(lengths)
        used = lengths[lengths > 0]
        yield Sentences(numbering.numbers(fields), used, np.ones(len(used)))


def _read_carefully(lines: Lines, blocks: Iterable[bytes], words: WordList, handling: Handling) -> Iterator[Sentences]:
    number = words.number if handling.adding else words.known
    numbers: list[int] = []
    kept: list[tuple[int, float, str, int]] = []
    escapes: list[tuple[int, str]] = []
    for line in lines.of(physical for block in blocks for physical in BytesIO(block)):
        if len(numbers) + len(kept) >= _BATCH:
            yield _sentences(numbers, kept, escapes)
            numbers, kept, escapes = [], [], []
        if handling.escape is not None and line.startswith(handling.escape):
            escapes.append((len(kept), line + lines.end))
            continue
        found = tokens(line)
        weight: float | None = 1.0
        text = ""
        if handling.weight:
            text = found.pop(0 if handling.weight == "first" else -1)
            weight = handling.parse_weight(text)
        # A line that gives no n-gram at all is none to ngram-count.
        useless = handling.adding and bool(handling.weight) and not (found or handling.start or handling.end)
        if weight is None or useless or len(found) > LONGEST:
            # What is said of the lines before comes first.
            yield _sentences(numbers, kept, escapes)
            numbers, kept, escapes = [], [], []
            wrong = handling.too_long if weight is not None and not useless else handling.bad_weight.format(text)
            lines.streams.say(f"{lines.position}{wrong}")
        else:
            numbers += map(number, found)
            mark = f"{weight:g}* " if handling.weight else ""
            kept.append((len(found), weight, mark + " ".join(found) if handling.verbose else "", lines.number))
    yield _sentences(numbers, kept, escapes)


def _sentences(
    numbers: Sequence[int], kept: Sequence[tuple[int, float, str, int]], escapes: Sequence[tuple[int, str]]
) -> Sentences:
    lengths, weights, shown, places = zip(*kept, strict=True) if kept else ((), (), (), ())
    columns = np.array(numbers, np.int64), np.array(lengths, np.int64), np.array(weights)
    return Sentences(*columns, shown, escapes, places)


class Marked(NamedTuple):
    """Sentences with their markers: word numbers (T,), lengths (S,); which begin with <s>, and end with </s>, (S,)."""

    numbers: Ints
    lengths: Ints
    opened: Mask
    ended: Mask


def mark(sentences: Sentences, words: WordList, handling: Handling) -> Marked:
    """Turn the sentences around, if asked for, and put the markers around them that they lack.

    Words that are noise go, after the markers are looked for.
    """
    start, end = words.start, words.end
    numbers, lengths, size = sentences.numbers, sentences.lengths, len(sentences.lengths)
    if handling.reverse:
        last = np.repeat(2 * np.cumsum(lengths) - lengths - 1, lengths)
        numbers = numbers[last - np.arange(len(numbers))]
    opened, ended = find_markers(numbers, lengths, start, end)
    if handling.noise and (noise := np.isin(numbers, list(handling.noise))).any():
        lengths = np.bincount(np.repeat(np.arange(size), lengths)[~noise], minlength=size)
        numbers = numbers[~noise]
    before, after = ~opened & (handling.start and start >= 0), ~ended & (handling.end and end >= 0)
    numbers, lengths = add_markers(numbers, lengths, start, end, before, after)
    return Marked(numbers, lengths, opened | before, ended | after)
