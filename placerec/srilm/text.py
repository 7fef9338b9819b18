"""Text to word numbers: section 4.1 of our SRILM specification."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from itertools import chain

import numpy as np

from placerec.ahead import work_ahead
from placerec.arrays import Ints
from placerec.lm.counts import NgramCounts, count_text
from placerec.lm.stored_text import BLOCK, Numbers, StoredText
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.counts_file import parse_count
from placerec.srilm.fields import unusual, usual_blocks
from placerec.srilm.numbering import Numbering, cut_words
from placerec.srilm.streams import Lines, Streams, tokens
from placerec.srilm.vocabulary import WordList

LONGEST_LINE = 50000
# Bytes that are taken apart at once.
_BYTES = 1 << 18


@dataclass(frozen=True)
class Marking:
    """Which markers are put around sentences, and where a line's weight stands (`first`, `last`, or nowhere)."""

    start: bool = True
    end: bool = True
    weight: str = ""
    fractional: bool = False


@dataclass
class Text:
    """The sentences of a text with their markers, as SRILM's word numbers.

    `lines`: physical lines; `words`: tokens other than markers at the ends; `unknown`: those that are the unknown word.
    """

    stored: StoredText = field(default_factory=StoredText)
    lines: int = 0
    sentences: int = 0
    words: int = 0
    unknown: int = 0

    def count(self, order: int, words: WordList, *, fractional: bool) -> NgramCounts:
        """The counts of the n-grams of the text over the sorted vocabulary."""
        vocabulary, renumbered = words.sorted()
        ids = np.array(renumbered, np.int64)
        return count_text(self.stored, order, vocabulary, renumbered=ids, fractional=fractional)


@dataclass(frozen=True)
class _Part:
    """Some sentences of a text without their markers: word numbers (T,), lengths (S,) and weights (S,) or None."""

    numbers: Ints
    lengths: Ints
    weights: Numbers | None = None


def read_text(name: str, words: WordList, marking: Marking, streams: Streams) -> Text:
    """Read a text; words are added to an open vocabulary. Lines that cannot be used are reported and skipped."""
    lines = streams.lines(name)
    text = Text()
    for part in _parts(lines, words, marking, streams):
        _add_marked(text, part, words, marking)
    text.lines = lines.number
    return text


def _parts(lines: Lines, words: WordList, marking: Marking, streams: Streams) -> Iterator[_Part]:
    """A text part by part: quickly, and carefully from where the first comment, NUL, VT or FF is."""
    blocks = lines.blocks(_BYTES)
    if not marking.weight:
        careful: list[bytes] = []
        numbering = Numbering(words)
        # Words are cut beside, and numbered here in their order.
        for cut in work_ahead(cut_words, usual_blocks(blocks, unusual, careful)):
            if (cut.per_line > LONGEST_LINE).any():
                yield from _read_carefully(lines, [cut.data], words, marking, streams)
            else:
                lines.number += len(cut.per_line)
                yield _Part(numbering.numbers_of(cut), cut.per_line[cut.per_line > 0])
        blocks = chain(careful, blocks)
    yield from _read_carefully(lines, blocks, words, marking, streams)


def _read_carefully(
    lines: Lines, blocks: Iterable[bytes], words: WordList, marking: Marking, streams: Streams
) -> Iterator[_Part]:
    numbers: list[int] = []
    lengths: list[int] = []
    weights: list[float] = []

    def part() -> _Part:
        weight = np.array(weights, np.float64 if marking.fractional else np.int64) if marking.weight else None
        return _Part(np.array(numbers, np.int64), np.array(lengths, np.int64), weight)

    for found, weight in _sentences(lines, blocks, marking, streams):
        numbers += [words.number(word) for word in found]
        lengths.append(len(found))
        weights.append(weight)
        if len(numbers) + len(lengths) > BLOCK:
            yield part()
            numbers, lengths, weights = [], [], []
    yield part()


def _sentences(
    lines: Lines, blocks: Iterable[bytes], marking: Marking, streams: Streams
) -> Iterator[tuple[list[str], float]]:
    """The words and weights of the lines that can be used; the others are reported."""
    for line in lines.of(physical for block in blocks for physical in BytesIO(block)):
        words = tokens(line)
        weight: float | None = 1
        if marking.weight:
            weight = parse_count(words.pop(0 if marking.weight == "first" else -1), marking.fractional)
        if weight is None:
            streams.say(f"{lines.position}illegal count weight or line too long?")
        elif len(words) > LONGEST_LINE:
            streams.say(f"{lines.position}line too long?")
        else:
            yield words, weight


def _add_marked(text: Text, part: _Part, words: WordList, marking: Marking) -> None:
    """Add sentences to the text, with the markers that they lack."""
    numbers, lengths = part.numbers, part.lengths
    begin, end = words.index.get(SENTENCE_START, -1), words.index.get(SENTENCE_END, -1)
    stops = np.cumsum(lengths)
    filled = lengths > 0
    opened, ended = np.zeros(len(lengths), bool), np.zeros(len(lengths), bool)
    opened[filled] = numbers[(stops - lengths)[filled]] == begin
    ended[filled] = numbers[(stops - 1)[filled]] == end
    text.sentences += len(lengths)
    text.words += int((lengths - opened - ended).sum())
    text.unknown += int((numbers == words.index.get(words.unknown, -1)).sum())
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
        numbers = marked
    text.stored.add(numbers, whole, part.weights)
