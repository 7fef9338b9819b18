"""ARPA files as SRILM reads them: tolerantly, with warnings; section 8 of our SRILM specification."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.lm.draft import Draft, Mask
from placerec.lm.gather import trie_of
from placerec.lm.trie import Ints
from placerec.srilm.arpa_block import LOG_ZERO, Block, parse_block
from placerec.srilm.context_order import NEVER, ContextTimes
from placerec.srilm.fields import NameTable
from placerec.srilm.options import leading_float
from placerec.srilm.streams import SPACES, Lines, SrilmError, Streams, tokens
from placerec.srilm.vocabulary import WordList

_MOST_ORDERS = 100
_BLOCK = 1 << 24
_COUNT = re.compile(r"ngram\s*([-+]?\d+)=\s*([-+]?\d+)")
_SECTION = re.compile(r"\\([-+]?\d+)-grams")
_DECIMAL = re.compile(r"-?\d*\.?\d*")


class _FormatError(Exception):
    """What is wrong with the line just read."""


def read_model(
    name: str,
    words: WordList,
    streams: Streams,
    *,
    order: int,
    debug: int = 0,
    limited: bool = False,
    what: str = "lm file",
) -> tuple[Draft, ContextTimes]:
    """Read an ARPA file up to `order`, adding its words to `words`, and say what is odd about it.

    `limited`: n-grams with other words than those of `words` are left out. Raises SrilmError, calling the file a
    `what`, if it cannot be used.
    """
    expected = len(words.index)
    reader = _Reader(name, words, streams, order, limited)
    failure = None
    try:
        reader.read()
    except _FormatError as error:
        failure = f"{reader.position}{error}"
        reader.keep_lines()
    draft, times = _assemble(reader, expected)
    for _, level, message in sorted(reader.said, key=lambda said: said[0]):
        if debug >= level:
            streams.say(message)
    if failure:
        streams.say(failure)
        raise SrilmError(f"format error in {what} {name}")
    return draft, times


@dataclass
class _Lines:
    """N-grams of one order, line by line."""

    lines: list[int] = field(default_factory=list)
    words: list[list[int]] = field(default_factory=list)
    log10_p: list[float] = field(default_factory=list)
    weighted: list[bool] = field(default_factory=list)
    backoff: list[float] = field(default_factory=list)

    def block(self, n: int) -> Block:
        return Block(
            np.array(self.lines, np.int64),
            np.array(self.words, np.int64).reshape(-1, n),
            np.array(self.log10_p, np.float32),
            np.array(self.weighted, bool),
            np.array(self.backoff, np.float32),
        )


class _Reader:
    """The state of reading one file; `said`: line, debug level and text of each message."""

    def __init__(self, name: str, words: WordList, streams: Streams, order: int, limited: bool) -> None:
        self.name = name
        self.words = words
        self.streams = streams
        self.order = order
        self.limited = limited
        self.number = 0
        self.said: list[tuple[int, int, str]] = []
        self.blocks: dict[int, list[Block]] = {}
        self.names: NameTable | None = None
        self.promised: dict[int, int] = {}
        self.read_so_far: dict[int, int] = {}
        self.state = "before"
        self.section = 0
        self.section_end = 0
        self.slow = _Lines()
        self.outside = 0

    @property
    def position(self) -> str:
        return f"{self.name}: line {self.number}: "

    @property
    def top(self) -> int:
        return max(self.promised, default=0)

    def say(self, message: str, level: int = 0) -> None:
        self.said.append((self.number, level, message))

    def read(self) -> None:
        """Read the file to `\\end\\`."""
        lines = self.streams.lines(self.name)
        data = lines.data
        if b"\0" in data:
            self.read_lines(lines)
        start = 0
        while start < len(data) and self.state != "done" and b"\0" not in data:
            if self.state in ("ngrams", "skip") and data[start : start + 1] != b"\\":
                start = self.read_section(data, start)
                continue
            end = data.find(b"\n", start) + 1 or len(data)
            self.number += 1
            self.take(data[start:end].decode("latin-1").removesuffix("\n"))
            start = end
        if self.state != "done":
            raise _FormatError("reached EOF before \\end\\")

    def read_lines(self, lines: Lines) -> None:
        """The same line by line, for files with NUL bytes, which join lines."""
        for line in lines:
            self.number = lines.number
            self.take(line)
            if self.state == "done":
                return
        self.number = lines.number

    def read_section(self, data: bytes, start: int) -> int:
        """Take the lines from `start` to the next one that starts with a backslash, or as many as go at a time."""
        if start >= self.section_end:
            self.section_end = data.find(b"\n\\", start) + 1 or len(data)
        end = self.section_end
        if self.state == "skip":
            self.number += data.count(b"\n", start, end) + (not data.endswith(b"\n", start, end))
            return end
        if end - start > _BLOCK:
            end = data.find(b"\n", start + _BLOCK) + 1
        chunk = data[start:end]
        block = self.quick_block(chunk) if self.section > 1 else None
        if block is not None:
            self.keep_lines()
            self.blocks.setdefault(self.section, []).append(block)
            self.read_so_far[self.section] += len(block.lines)
            self.number += chunk.count(b"\n") + (not chunk.endswith(b"\n"))
            return end
        for line in chunk.decode("latin-1").removesuffix("\n").split("\n"):
            self.number += 1
            self.take(line)
        return end

    def quick_block(self, chunk: bytes) -> Block | None:
        if self.names is None or self.names.size != len(self.words.index):
            self.names = NameTable(self.words.index)
        n = self.section
        weights = "zero" if n == self.top else "ignore" if n == self.order else "read"
        if self.words.lower and chunk != chunk.lower():
            return None
        return parse_block(chunk, n, self.number + 1, self.names, weights=weights)

    def take(self, line: str) -> None:
        """One line, in the state that the lines before have led to."""
        if not line.strip(SPACES) or line.startswith("##"):
            return
        if self.state == "before":
            if line.startswith("\\data\\"):
                self.state = "header"
        elif self.state != "header" and line.startswith("\\end\\"):
            self.end()
        elif match := _SECTION.match(line):
            self.begin(int(match[1]))
        elif self.state == "header":
            self.promise(line)
        elif self.state == "ngrams":
            self.ngram(line)

    def promise(self, line: str) -> None:
        """A line of the header."""
        match = _COUNT.match(line)
        if not match:
            raise _FormatError("unexpected input")
        n, size = int(match[1]), int(match[2])
        if not 1 <= n <= _MOST_ORDERS:
            raise _FormatError(f"ngram order {n} out of range")
        if size < 0:
            raise _FormatError(f"ngram number {size} out of range")
        self.promised[n] = size

    def begin(self, n: int) -> None:
        """The headline of a section."""
        self.close()
        if not 1 <= n <= self.top:
            raise _FormatError(f"invalid ngram order {n}")
        self.section = n
        self.read_so_far.setdefault(n, 0)
        skipped = n > self.order
        self.state = "skip" if skipped else "ngrams"
        self.say(f"{'skipping' if skipped else 'reading'} {self.promised.get(n, 0)} {n}-grams", 1)

    def keep_lines(self) -> None:
        """Keep what was read line by line."""
        if self.slow.lines:
            self.blocks.setdefault(self.section, []).append(self.slow.block(self.section))
            self.slow = _Lines()

    def close(self) -> None:
        """The end of a section."""
        self.keep_lines()
        if self.outside and self.limited:
            self.say(f"discarded {self.outside} OOV {self.section}-grams", 1)
        self.outside = 0

    def end(self) -> None:
        self.close()
        for n in range(1, min(self.order, self.top) + 1):
            found, expected = self.read_so_far.get(n, 0), self.promised.get(n, 0)
            if found != expected:
                self.say(f"{self.position}warning: {found} {n}-grams read, expected {expected}")
        self.state = "done"

    def ngram(self, line: str) -> None:
        """A line with an n-gram."""
        n = self.section
        fields = tokens(line)
        if len(fields) not in (n + 1, n + 2):
            raise _FormatError(f"ngram line has {min(len(fields), n + 3)} fields ({n + 2} expected)")
        log10_p = log_value(fields[0])
        if log10_p is None:
            raise _FormatError(f'bad prob "{fields[0]}"')
        if not log10_p <= 0:
            self.say(f'{self.position}warning: questionable prob "{fields[0]}"')
        weighted = len(fields) == n + 2
        backoff = self.weight(fields[-1]) if weighted else 0.0
        self.read_so_far[n] += 1
        names = [self.words.normal(word) for word in fields[1 : n + 1]]
        if self.limited and any(word not in self.words.index for word in names):
            self.outside += 1
            return
        self.slow.lines.append(self.number)
        self.slow.words.append([self.words.add(word) for word in names])
        self.slow.log10_p.append(log10_p)
        self.slow.weighted.append(weighted)
        self.slow.backoff.append(backoff)

    def weight(self, text: str) -> float:
        """The backoff weight at the end of a line."""
        if self.section == self.top:
            if text[0] != "0":
                self.say(f'{self.position}ignoring non-zero bow "{text}" for maximal ngram')
            return 0.0
        if self.section == self.order:
            return 0.0
        backoff = log_value(text)
        if backoff is None:
            raise _FormatError(f'bad bow "{text}"')
        if not backoff < np.inf:
            self.say(f'{self.position}warning: questionable bow "{text}"')
        return backoff


def log_value(text: str) -> float | None:
    """A log10 number as SRILM reads it: -inf for -99; None if there is no number."""
    if _DECIMAL.fullmatch(text):
        value: float | None = float(text) if any(c.isdigit() for c in text) else 0.0
    else:
        value = leading_float(text)
    return -np.inf if value is not None and np.float32(value) == LOG_ZERO else value


def _assemble(reader: _Reader, expected: int) -> tuple[Draft, ContextTimes]:
    """The model of what was read: n-grams whose context has no weight at that point of the file are dropped."""
    vocabulary, renumbered = reader.words.sorted()
    sorted_number = np.array(renumbered, np.int64)
    blocks = [(n, block) for n, its in sorted(reader.blocks.items()) for block in its]
    groups = [sorted_number[block.words] for _, block in blocks]
    trie, rows = trie_of(vocabulary, reader.order, groups)
    names = np.array(reader.words.names(vocabulary), np.int64)
    draft = Draft(trie, ~vocabulary.mask(reader.words.non_events), names)
    created = _weights(draft, blocks, rows)
    for (n, block), row in zip(blocks, rows, strict=False):
        kept = np.ones(len(block.lines), bool)
        if n > 1:
            kept = created[n - 2][row[n - 2]] <= block.lines
            for i in np.flatnonzero(~kept).tolist():
                ngram = " ".join(str(reader.words.words[word]) for word in block.words[i].tolist())
                line = int(block.lines[i])
                message = f'{reader.name}: line {line}: warning: no bow for prefix of ngram "{ngram}"'
                reader.said.append((line, 0, message))
        draft.stored[n - 1][row[-1][kept]] = True
        # Of several values for one row the last is kept: the file's last.
        draft.log10_p[n - 1][row[-1][kept]] = block.log10_p[kept]
    _warn_of_unknown(reader, blocks)
    draft.refresh_all()
    numbers = np.full(len(vocabulary), -1, np.int64)
    numbers[sorted_number[sorted_number >= 0]] = np.flatnonzero(sorted_number >= 0)
    return draft, ContextTimes(trie, created, numbers, expected)


def _weights(draft: Draft, blocks: Sequence[tuple[int, Block]], rows: Sequence[Sequence[Ints]]) -> list[Ints]:
    """Make contexts of the n-grams with weights; per order, the line at which each row became one, int64 (m_n,)."""
    trie = draft.trie
    created = [np.full(len(keys), NEVER) for keys in trie.keys]
    for (n, block), row in zip(blocks, rows, strict=False):
        if n < trie.order:
            its, lines = row[-1][block.weighted], block.lines[block.weighted]
            np.minimum.at(created[n - 1], its, lines)
            draft.backoff[n - 1][its] = block.backoff[block.weighted]
    for n in range(trie.order - 1, 0, -1):
        nodes = np.flatnonzero(created[n - 1] < NEVER)
        draft.node[n - 1][nodes] = True
        if n > 1:
            np.minimum.at(created[n - 2], trie.suffixes[n - 1][nodes], created[n - 1][nodes])
    return created


def _warn_of_unknown(reader: _Reader, blocks: Sequence[tuple[int, Block]]) -> None:
    """Once: the unknown word has a probability, though it should have none."""
    words = reader.words
    if words.unknown not in words.non_events:
        return
    number = words.index[words.unknown]
    predicted: list[int] = []
    for _, block in blocks:
        its: Mask = (block.words[:, -1] == number) & ~np.isneginf(block.log10_p)
        predicted += block.lines[its][:1].tolist()
    if predicted:
        line = min(predicted)
        message = f"warning: non-zero probability for {words.unknown} in closed-vocabulary LM"
        reader.said.append((line, 0, f"{reader.name}: line {line}: {message}"))
