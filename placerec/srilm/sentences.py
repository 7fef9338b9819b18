"""The text that `ngram -ppl` scores: lines to word numbers, with the markers that belong around them (section 10.1)."""

from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from itertools import chain
from typing import NamedTuple

import numpy as np

from placerec.ahead import make_ahead
from placerec.arrays import Floats, Ints, Mask
from placerec.lm.score import TokenSequence
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.fields import NameTable, split_lines, usual_blocks, with_odd_bytes, without_comments
from placerec.srilm.options import leading_float
from placerec.srilm.streams import Lines, Streams, tokens
from placerec.srilm.vocabulary import WordList

LONGEST = 50000
# Bytes read at once where lines are as programs write them, and words where they are not.
_BLOCK, _BATCH = 1 << 19, 1 << 18


class Handling(NamedTuple):
    """What is done to sentences: which markers are put around them, words that are left out, and more.

    `weight`: where a line's weight stands (`first`, `last`, or nowhere); `escape`: the start of lines that are copied;
    `verbose`: keep the lines' words as they are; `noise`: numbers of words that are left out.
    """

    start: bool = True
    end: bool = True
    reverse: bool = False
    weight: str = ""
    escape: str | None = None
    verbose: bool = False
    noise: frozenset[int] = frozenset()


class Sentences(NamedTuple):
    """Lines as SRILM's word numbers (T,), lengths (S,), weights (S,); `shown`: their words, if `verbose`.

    `escapes`: the number of the sentence that comes next, and the line.
    """

    numbers: Ints
    lengths: Ints
    weights: Floats
    shown: Sequence[str] = ()
    escapes: Sequence[tuple[int, str]] = ()


def read_sentences(name: str, words: WordList, handling: Handling, streams: Streams) -> Iterator[Sentences]:
    """Read a text, many lines at a time; words that are not listed are the unknown word.

    Too long lines are reported and left out.
    """
    lines = streams.lines(name)
    blocks = lines.blocks(_BLOCK)
    if not (handling.weight or handling.escape is not None or handling.verbose):
        careful: list[bytes] = []
        # Nothing else is said meanwhile, so that messages keep their order.
        yield from make_ahead(_read_quickly(lines, usual_blocks(blocks, with_odd_bytes, careful), words, streams))
        if not careful:
            return
        blocks = chain(careful, blocks)
    yield from _read_carefully(lines, blocks, words, handling, streams)


def _read_quickly(lines: Lines, blocks: Iterable[bytes], words: WordList, streams: Streams) -> Iterator[Sentences]:
    names = NameTable(words.index)
    for block in blocks:
        fields, lengths = without_comments(*split_lines(block.lower() if words.lower else block))
        numbers = names.find(fields, slice(None))
        numbers[numbers < 0] = words.index[words.unknown]
        too_long = lengths > LONGEST
        if too_long.any():
            for number in np.flatnonzero(too_long).tolist():
                streams.say(f"{lines.name}: line {lines.number + number + 1}: too many words per sentence")
            numbers, lengths = numbers[~np.repeat(too_long, lengths)], np.where(too_long, 0, lengths)
        lines.number += len(lengths)
        used = lengths[lengths > 0]
        yield Sentences(numbers, used, np.ones(len(used)))


def _read_carefully(
    lines: Lines, blocks: Iterable[bytes], words: WordList, handling: Handling, streams: Streams
) -> Iterator[Sentences]:
    index, unknown = words.index, words.index[words.unknown]
    numbers: list[int] = []
    kept: list[tuple[int, float, str]] = []
    escapes: list[tuple[int, str]] = []
    for line in lines.of(physical for block in blocks for physical in BytesIO(block)):
        if len(numbers) + len(kept) >= _BATCH:
            yield _sentences(numbers, kept, escapes)
            numbers, kept, escapes = [], [], []
        if handling.escape is not None and line.startswith(handling.escape):
            escapes.append((len(kept), line))
            continue
        found = tokens(line)
        weight = leading_float(found.pop(0 if handling.weight == "first" else -1)) if handling.weight and found else 1.0
        if len(found) > LONGEST:
            streams.say(f"{lines.position}too many words per sentence")
        elif weight is None:
            streams.say(f"{lines.position}illegal count weight or line too long?")
        else:
            numbers += [index.get(words.normal(word), unknown) for word in found]
            mark = f"{weight:g}* " if handling.weight else ""
            kept.append((len(found), weight, mark + " ".join(found) if handling.verbose else ""))
    yield _sentences(numbers, kept, escapes)


def _sentences(
    numbers: Sequence[int], kept: Sequence[tuple[int, float, str]], escapes: Sequence[tuple[int, str]]
) -> Sentences:
    lengths, weights, shown = zip(*kept, strict=True) if kept else ((), (), ())
    return Sentences(
        np.array(numbers, np.int64), np.array(lengths, np.int64), np.array(weights, np.float64), shown, escapes
    )


def joined(parts: Sequence[Sentences]) -> Sentences:
    """All sentences in one."""
    parts = [_sentences([], [], []), *parts]
    before = np.cumsum([0, *(len(part.lengths) for part in parts)]).tolist()
    numbers, lengths, weights = (np.concatenate(column) for column in zip(*(part[:3] for part in parts), strict=True))
    shown = [text for part in parts for text in part.shown]
    escapes = [(b + number, line) for b, part in zip(before, parts, strict=False) for number, line in part.escapes]
    return Sentences(numbers, lengths, weights, shown, escapes)


def mark(sentences: Sentences, words: WordList, handling: Handling) -> tuple[TokenSequence, Ints, Mask]:
    """The token sequence to score, the lengths of its sentences (S,), and whether each of them ends in </s> (S,)."""
    start_number, end_number = words.index.get(SENTENCE_START, -1), words.index.get(SENTENCE_END, -1)
    numbers, size = sentences.numbers, len(sentences.lengths)
    stops = np.cumsum(sentences.lengths)
    some = sentences.lengths > 0
    opened, ended = np.zeros(size, bool), np.zeros(size, bool)
    opened[some] = numbers[(stops - sentences.lengths)[some]] == start_number
    ended[some] = numbers[(stops - 1)[some]] == end_number
    lengths = sentences.lengths
    if handling.noise and (noise := np.isin(numbers, list(handling.noise))).any():
        lengths = np.bincount(np.repeat(np.arange(size), lengths)[~noise], minlength=size)
        numbers = numbers[~noise]
    if handling.reverse:
        numbers = _reversed(numbers, lengths, opened, ended)
    before, after = (~opened & handling.start).astype(np.int64), (~ended & handling.end).astype(np.int64)
    whole = lengths + before + after
    begin = np.cumsum(whole) - whole
    ids = np.empty(int(whole.sum()), np.int64)
    inner = np.ones(len(ids), bool)
    inner[begin[before > 0]] = False
    inner[(begin + whole - 1)[after > 0]] = False
    ids[begin[before > 0]] = start_number
    ids[(begin + whole - 1)[after > 0]] = end_number
    ids[inner] = numbers
    first, scored = np.zeros(len(ids), bool), np.ones(len(ids), bool)
    first[begin[whole > 0]] = True
    scored[begin[(whole > 0) & (opened | (before > 0))]] = False
    has_end = np.zeros(size, bool)
    predicted = whole - (opened | (before > 0)) > 0
    has_end[predicted] = ids[(begin + whole - 1)[predicted]] == end_number
    return TokenSequence(ids, first, scored), whole, has_end


def _reversed(numbers: Ints, lengths: Ints, opened: Mask, ended: Mask) -> Ints:
    """The words of each sentence from last to first; markers at the ends stay where they are."""
    start = np.cumsum(lengths) - lengths + np.minimum(opened, lengths)
    stop = np.cumsum(lengths) - np.minimum(ended, lengths)
    position = np.arange(len(numbers))
    first, last = np.repeat(start, lengths), np.repeat(stop, lengths)
    return numbers[np.where((position >= first) & (position < last), first + last - 1 - position, position)]
