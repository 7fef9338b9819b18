"""Text to word numbers: section 4.1 of our SRILM specification."""

import io
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from placerec.lm.counts import SENTENCE_END, SENTENCE_START, NgramCounts, count_ids
from placerec.lm.trie import Ints
from placerec.srilm.counts_file import parse_count
from placerec.srilm.numbering import Cut, Numbering, cut_words
from placerec.srilm.streams import Lines, Streams, tokens
from placerec.srilm.vocabulary import WordList

LONGEST_LINE = 50000
_BLOCK = 1 << 18
_AHEAD = 4


@dataclass(frozen=True)
class Marking:
    """Which markers are put around sentences, and where a line's weight stands (`first`, `last`, or nowhere)."""

    start: bool = True
    end: bool = True
    weight: str = ""
    fractional: bool = False


@dataclass(frozen=True)
class Text:
    """The sentences of a text with their markers: SRILM's word numbers (T,), lengths (S,), weights (S,) or None.

    `lines`: physical lines; `words`: tokens other than markers at the ends; `unknown`: those that are the unknown word.
    """

    numbers: Ints = field(repr=False)
    lengths: Ints = field(repr=False)
    weights: NDArray[np.float64] | None = field(repr=False)
    lines: int
    words: int
    unknown: int

    def count(self, order: int, words: WordList, *, fractional: bool) -> NgramCounts:
        """The counts of the n-grams of the text over the sorted vocabulary."""
        vocabulary, renumbered = words.sorted()
        weights = None
        if self.weights is not None:
            weights = np.repeat(self.weights if fractional else self.weights.astype(np.int64), self.lengths)
        elif fractional:
            weights = np.ones(len(self.numbers))
        ids = np.array(renumbered, np.int64)
        return count_ids(self.numbers, self.lengths, order, vocabulary, weights=weights, renumbered=ids)


def read_text(name: str, words: WordList, marking: Marking, streams: Streams) -> Text:
    """Read a text; words are added to an open vocabulary. Lines that cannot be used are reported and skipped."""
    data = streams.read(name)
    weights: list[float] | None = None
    if marking.weight or data.startswith(_SPECIAL) or any(special in data for special in _SPECIALS):
        lines = Lines(name, io.BytesIO(data), streams)
        numbers, lengths, line_of, weights = _read_carefully(lines, words, marking, streams)
        last = lines.number
    else:
        numbers, lengths = _read_quickly(data, words)
        last = len(lengths)
        line_of = np.arange(1, last + 1)
    for line in line_of[lengths > LONGEST_LINE].tolist():
        streams.say(f"{name}: line {line}: line too long?")
    used = ((lengths > 0) | (weights is not None)) & (lengths <= LONGEST_LINE)
    given = None if weights is None else np.array(weights, np.float64)[used]
    if not used.all():
        numbers, lengths = numbers[np.repeat(used, lengths)], lengths[used]
    return _marked(numbers, lengths, given, last, words, marking)


def _read_quickly(data: bytes, words: WordList) -> tuple[Ints, Ints]:
    """The word numbers of all lines (T,), and how many each physical line holds (L,)."""
    if data and not data.endswith(b"\n"):
        data += b"\n"
    numbering = Numbering(words)
    numbers, lengths = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    # Words are cut beside, and numbered here in their order.
    with ThreadPoolExecutor(2) as pool:
        waiting: deque[Future[Cut]] = deque()
        blocks = _blocks(data)
        while True:
            waiting.extend(pool.submit(cut_words, block) for block in islice(blocks, _AHEAD - len(waiting)))
            if not waiting:
                break
            cut = waiting.popleft().result()
            numbers.append(numbering.numbers_of(cut))
            lengths.append(cut.per_line)
    return np.concatenate(numbers), np.concatenate(lengths)


def _blocks(data: bytes) -> Iterator[bytes]:
    """Whole lines."""
    start = 0
    while start < len(data):
        end = data.find(b"\n", min(len(data) - 1, start + _BLOCK)) + 1
        yield data[start:end]
        start = end


# What only the careful reader understands: comments, byte-order marks; NUL, vertical tabs and form feeds.
_SPECIAL = (b"##", b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")
_SPECIALS = (b"\n##", b"\0", b"\v", b"\f")


def _read_carefully(
    lines: Lines, words: WordList, marking: Marking, streams: Streams
) -> tuple[Ints, Ints, Ints, list[float] | None]:
    """The same line by line, with the lines' numbers and weights."""
    numbers: list[int] = []
    lengths: list[int] = []
    line_of: list[int] = []
    weights: list[float] = []
    for found, weight in _weighted(lines, marking, streams):
        numbers += [words.number(word) for word in found]
        lengths.append(len(found))
        line_of.append(lines.number)
        weights.append(weight)
    arrays = [np.array(values, np.int64) for values in (numbers, lengths, line_of)]
    return arrays[0], arrays[1], arrays[2], weights if marking.weight else None


def _weighted(lines: Lines, marking: Marking, streams: Streams) -> Iterator[tuple[list[str], float]]:
    for line in lines:
        words = tokens(line)
        weight: float | None = 1.0
        if marking.weight and words:
            weight = parse_count(words.pop(0 if marking.weight == "first" else -1), marking.fractional)
        if weight is None:
            streams.say(f"{lines.position}illegal count weight or line too long?")
        else:
            yield words, weight


def _marked(
    numbers: Ints,
    lengths: Ints,
    weights: NDArray[np.float64] | None,
    lines: int,
    words: WordList,
    marking: Marking,
) -> Text:
    """The sentences with the markers that they lack."""
    begin, end = words.index.get(SENTENCE_START, -1), words.index.get(SENTENCE_END, -1)
    stops = np.cumsum(lengths)
    filled = lengths > 0
    opened, ended = np.zeros(len(lengths), bool), np.zeros(len(lengths), bool)
    opened[filled] = numbers[(stops - lengths)[filled]] == begin
    ended[filled] = numbers[(stops - 1)[filled]] == end
    before, after = ~opened & marking.start, ~ended & marking.end
    whole = lengths + before + after
    if (before | after).any():
        ends = np.cumsum(whole)
        marked = np.empty(int(whole.sum()), np.int64)
        first, last = (ends - whole)[before], (ends - 1)[after]
        given = np.ones(len(marked), bool)
        given[first] = given[last] = False
        marked[given] = numbers
        marked[first], marked[last] = begin, end
        plain, numbers = numbers, marked
    else:
        plain = numbers
    unknown = int((plain == words.index.get(words.unknown, -1)).sum())
    return Text(numbers, whole, weights, lines, int((lengths - opened - ended).sum()), unknown)
