"""The text that `ngram -ppl` scores: lines to word numbers, with the markers that belong around them (section 10.1)."""

from dataclasses import dataclass, field

import numpy as np

from placerec.lm.counts import SENTENCE_END, SENTENCE_START
from placerec.lm.draft import Floats, Mask
from placerec.lm.passage import Passage
from placerec.lm.trie import Ints
from placerec.srilm.fields import PADDING, NameTable, split_lines, unusual
from placerec.srilm.options import leading_float
from placerec.srilm.streams import Lines, Streams, tokens
from placerec.srilm.vocabulary import WordList

LONGEST = 50000
_NOTHING = -2
_BLOCK = 1 << 18


@dataclass(frozen=True)
class Handling:
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


@dataclass
class Sentences:
    """Lines as SRILM's word numbers (T,), lengths (S,), weights (S,); `shown`: their words, if `verbose`.

    `escapes`: the number of the sentence that comes next, and the line.
    """

    numbers: Ints
    lengths: Ints
    weights: Floats
    shown: list[str] = field(default_factory=list)
    escapes: list[tuple[int, str]] = field(default_factory=list)


def read_sentences(name: str, words: WordList, handling: Handling, streams: Streams) -> Sentences:
    """Read a text; words that are not listed are the unknown word. Too long lines are reported and left out."""
    lines = streams.lines(name)
    if handling.weight or handling.escape is not None or handling.verbose or unusual(lines.data):
        return _read_carefully(lines, words, handling, streams)
    numbers, lengths = _read_quickly(lines.data, words)
    used = (lengths > 0) & (lengths <= LONGEST)
    for line in np.flatnonzero(lengths > LONGEST).tolist():
        streams.say(f"{name}: line {line + 1}: too many words per sentence")
    kept = numbers if used.sum() == (lengths > 0).sum() else numbers[np.repeat(used, lengths)]
    return Sentences(kept, lengths[used], np.ones(int(used.sum())))


def _read_quickly(data: bytes, words: WordList) -> tuple[Ints, Ints]:
    """Word numbers (T,), and how many there are in each physical line."""
    names, unknown = NameTable(words.index), words.index[words.unknown]
    numbers, lengths = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    start = 0
    while start < len(data):
        end = data.find(b"\n", min(len(data) - 1, start + _BLOCK)) + 1 or len(data)
        block = data[start:end].lower() if words.lower else data[start:end]
        fields, counts = split_lines(block + PADDING, len(block))
        found = names.find(fields, np.arange(len(fields.starts)))
        numbers.append(np.where(found < 0, unknown, found))
        lengths.append(counts)
        start = end
    return np.concatenate(numbers), np.concatenate(lengths)


def _read_carefully(lines: Lines, words: WordList, handling: Handling, streams: Streams) -> Sentences:
    index, unknown = words.index, words.index[words.unknown]
    numbers: list[int] = []
    lengths: list[int] = []
    weights: list[float] = []
    shown: list[str] = []
    escapes: list[tuple[int, str]] = []
    for line in lines:
        if handling.escape is not None and line.startswith(handling.escape):
            escapes.append((len(lengths), line))
            continue
        found = tokens(line)
        weight = leading_float(found.pop(0 if handling.weight == "first" else -1)) if handling.weight and found else 1.0
        if len(found) > LONGEST:
            streams.say(f"{lines.position}too many words per sentence")
        elif weight is None:
            streams.say(f"{lines.position}illegal count weight or line too long?")
        else:
            numbers += [index.get(words.normal(word), unknown) for word in found]
            lengths.append(len(found))
            weights.append(weight)
            mark = f"{weight:g}* " if handling.weight else ""
            shown.append(mark + " ".join(found) if handling.verbose else "")
    return Sentences(
        np.array(numbers, np.int64), np.array(lengths, np.int64), np.array(weights, np.float64), shown, escapes
    )


def mark(sentences: Sentences, words: WordList, handling: Handling) -> tuple[Passage, Ints, Mask]:
    """The passage to score, the sentence of each of its words (T,), and whether each sentence ends in </s> (S,)."""
    start_number, end_number = words.index.get(SENTENCE_START, -1), words.index.get(SENTENCE_END, -1)
    numbers, size = sentences.numbers, len(sentences.lengths)
    stops = np.cumsum(sentences.lengths)
    some = sentences.lengths > 0
    padded = np.concatenate([numbers, [_NOTHING]])
    opened = some & (padded[np.where(some, stops - sentences.lengths, len(numbers))] == start_number)
    ended = some & (padded[np.where(some, stops - 1, len(numbers))] == end_number)
    sentence = np.repeat(np.arange(size), sentences.lengths)
    if handling.noise:
        kept = ~np.isin(numbers, list(handling.noise))
        numbers, sentence = numbers[kept], sentence[kept]
    lengths = np.bincount(sentence, minlength=size)
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
    return Passage(ids, first, scored), np.repeat(np.arange(size), whole), has_end


def _reversed(numbers: Ints, lengths: Ints, opened: Mask, ended: Mask) -> Ints:
    """The words of each sentence from last to first; markers at the ends stay where they are."""
    start = np.cumsum(lengths) - lengths + np.minimum(opened, lengths)
    stop = np.cumsum(lengths) - np.minimum(ended, lengths)
    position = np.arange(len(numbers))
    first, last = np.repeat(start, lengths), np.repeat(stop, lengths)
    return numbers[np.where((position >= first) & (position < last), first + last - 1 - position, position)]
