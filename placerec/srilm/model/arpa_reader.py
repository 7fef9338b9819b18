"""Reading ARPA files tolerantly, line by line or many lines at once; section 8 of our SRILM specification."""

import re
from collections.abc import Iterable
from io import BytesIO
from itertools import chain

import numpy as np

from placerec.arrays import Ints, Mask
from placerec.lm.logs import LOG_ZERO
from placerec.lm.score import Ngrams, ScoreTables, build_regular_tables
from placerec.srilm.model.arpa_lines import Block, parse_block
from placerec.srilm.text.fields import Fields, NameTable
from placerec.srilm.text.numbers import bounded_int, leading_float
from placerec.srilm.text.streams import SPACES, Lines, SrilmError, Streams, tokens
from placerec.srilm.text.vocabulary import WordList

_MOST_ORDERS = 100
_BLOCK = 1 << 19
_COUNT = re.compile(r"ngram\s*([-+]?\d+)=\s*([-+]?\d+)", re.ASCII)
_SECTION = re.compile(r"\\([-+]?\d+)-grams", re.ASCII)
_DECIMAL = re.compile(r"-?\d*\.?\d*", re.ASCII)


class _FormatError(Exception):
    """The line just read cannot be part of an ARPA file; the text says why."""


class Reader:
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
        self.slow: list[tuple[int, list[int], float, bool, float]] = []
        self.outside = 0
        self.failure = ""
        # N-grams by line as the file writes them, where they are read otherwise; None: nobody asks.
        self.cased: dict[int, str] | None = None

    @property
    def position(self) -> str:
        return f"{self.name}: line {self.number}: "

    @property
    def top(self) -> int:
        return max(self.promised, default=0)

    def say(self, message: str, level: int = 0) -> None:
        self.said.append((self.number, level, message))

    def finish(self, debug: int, what: str) -> None:
        """Say what is to be said at this debug level; SrilmError if the file could not be read."""
        for _, level, message in sorted(self.said, key=lambda said: said[0]):
            if debug >= level:
                self.streams.say(message)
        if self.failure:
            self.streams.say(self.failure)
            raise SrilmError(f"format error in {what} {self.name}")

    def read(self) -> None:
        """Read the file to `\\end\\`, or to what is wrong with it."""
        lines = self.streams.lines(self.name)
        blocks = lines.blocks(_BLOCK)
        try:
            for data in blocks:
                if b"\0" in data:
                    self.read_lines(lines, chain([data], blocks))
                    break
                start = 0
                while start < len(data) and self.state != "done":
                    start = self.read_some(data, start)
            if self.state != "done":
                raise _FormatError("reached EOF before \\end\\")
        except _FormatError as error:
            self.failure = f"{self.position}{error}"
            self.keep_lines()

    def read_lines(self, lines: Lines, blocks: Iterable[bytes]) -> None:
        """Take all lines that are left one by one: NUL bytes join them."""
        lines.number = self.number
        for line in lines.of(physical for block in blocks for physical in BytesIO(block)):
            if self.state != "done":
                self.number = lines.number
                self.take(line)
        if self.state != "done":
            self.number = lines.number

    def read_some(self, data: bytes, start: int) -> int:
        """Take the line at `start`; in a section, all lines to the next one that starts with a backslash."""
        if self.state not in ("ngrams", "skip") or data.startswith(b"\\", start):
            end = data.find(b"\n", start) + 1 or len(data)
            self.take_lines(data[start:end])
            return end
        end = _next_headline(data, start)
        if self.state == "skip":
            self.number += data.count(b"\n", start, end) + (not data.endswith(b"\n", start, end))
        elif block := self.quick_block(data[start:end]):
            self.keep_lines()
            self.keep(block._replace(lines=block.lines + self.number))
            self.read_so_far[self.section] += len(block.lines)
            self.number += block.size
        else:
            self.take_lines(data[start:end])
        return end

    def take_lines(self, data: bytes) -> None:
        """Take whole lines one by one."""
        for line in data.decode("latin-1").removesuffix("\n").split("\n"):
            self.number += 1
            self.take(line)

    def quick_block(self, chunk: bytes) -> Block | None:
        """The n-grams of whole lines, all at once; None if one of the lines is unusual."""
        n = self.section
        weights = "zero" if n == self.top else "ignore" if n == self.order else "read"
        if (n == 1 and self.limited) or (self.words.lower and chunk != chunk.lower()):
            return None
        return parse_block(chunk, n, self.numbered, weights=weights)

    def numbered(self, fields: Fields, at: Ints) -> Ints:
        """SRILM's numbers of the fields `at`; unigrams are added to the words, others are -1 where they are new."""
        if self.section == 1:
            return np.array([self.words.add(fields.text(i).decode("latin-1")) for i in at.tolist()], np.int64)
        if self.names is None or self.names.size != len(self.words.index):
            self.names = NameTable(self.words.index)
        return self.names.find(fields, at)

    def take(self, line: str) -> None:
        """Take one line in the state that the lines before have led to."""
        if not line.strip(SPACES) or line.startswith("##"):
            return
        if self.state == "before":
            if line.startswith("\\data\\"):
                self.state = "header"
        elif self.state != "header" and line.startswith("\\end\\"):
            self.end()
        elif match := _SECTION.match(line):
            self.begin(_signed(match[1]))
        elif self.state == "header":
            self.promise(line)
        elif self.state == "ngrams":
            self.ngram(line)

    def promise(self, line: str) -> None:
        """Take a line of the header, `ngram N=SIZE`."""
        match = _COUNT.match(line)
        if not match:
            raise _FormatError("unexpected input")
        n, size = _signed(match[1]), _signed(match[2])
        if not 1 <= n <= _MOST_ORDERS:
            raise _FormatError(f"ngram order {n} out of range")
        if size < 0:
            raise _FormatError(f"ngram number {size} out of range")
        self.promised[n] = size

    def begin(self, n: int) -> None:
        """Begin the section of the n-grams of order n."""
        self.close()
        if not 1 <= n <= self.top:
            raise _FormatError(f"invalid ngram order {n}")
        self.section = n
        self.read_so_far.setdefault(n, 0)
        skipped = n > self.order
        self.state = "skip" if skipped else "ngrams"
        self.say(f"{'skipping' if skipped else 'reading'} {self.promised.get(n, 0)} {n}-grams", 1)

    def keep(self, block: Block) -> None:
        """Keep n-grams of the present section."""
        if len(block.lines):
            # All of them are held until the file is read.
            narrow = block._replace(words=block.words.astype(np.int32))
            self.blocks.setdefault(self.section, []).append(narrow)

    def keep_lines(self) -> None:
        """Keep, as one block, the n-grams that were read line by line."""
        if self.slow:
            lines, words, log10_p, weighted, backoff = map(np.array, zip(*self.slow, strict=True))
            single = np.float32
            self.keep(Block(lines, words, log10_p.astype(single), weighted, backoff.astype(single)))
            self.slow = []

    def close(self) -> None:
        """End the present section."""
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
        """Take a line with an n-gram."""
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
        if self.cased is not None and names != fields[1 : n + 1]:
            self.cased[self.number] = " ".join(fields[1 : n + 1])
        self.slow.append((self.number, [self.words.add(word) for word in names], log10_p, weighted, backoff))

    def weight(self, text: str) -> float:
        """The backoff weight that the text at the end of a line is."""
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

    def warn_of_unknown(self) -> None:
        """Say, once, that the unknown word has a probability though the vocabulary is closed."""
        words = self.words
        if words.unknown not in words.non_events:
            return
        number = words.index[words.unknown]
        predicted: list[int] = []
        for block in (block for its in self.blocks.values() for block in its):
            found: Mask = (block.words[:, -1] == number) & ~np.isneginf(block.log10_p)
            predicted += block.lines[found][:1].tolist()
        if predicted:
            line = min(predicted)
            message = f"warning: non-zero probability for {words.unknown} in closed-vocabulary LM"
            self.said.append((line, 0, f"{self.name}: line {line}: {message}"))


def read_tables(
    name: str, words: WordList, streams: Streams, *, order: int, debug: int = 0, limited: bool = False
) -> ScoreTables:
    """Read an ARPA file up to `order` for scoring only, adding its words to `words`, and say what is odd about it.

    `limited`: n-grams with other words than those of `words` are left out. Raises SrilmError if the file is of no use.
    """
    reader = Reader(name, words, streams, order, limited)
    reader.read()
    tables = _regular_tables(reader)
    if tables is None:
        from placerec.srilm.model.arpa import assemble, tables_of

        tables = tables_of(assemble(reader)[0], words)
    else:
        reader.warn_of_unknown()
    reader.finish(debug, "lm file")
    return tables


def _regular_tables(reader: Reader) -> ScoreTables | None:
    """The tables of what was read; None after a failure, and where the orders do not follow each other."""
    ends = [line for _, its in sorted(reader.blocks.items()) for block in its for line in block.lines[[0, -1]].tolist()]
    if reader.failure or not reader.blocks or ends != sorted(ends):
        return None
    orders = [reader.blocks.get(n, []) for n in range(1, min(reader.order, reader.top) + 1)]
    columns = [[Ngrams(block.words, block.log10_p, block.backoff, block.weighted) for block in its] for its in orders]
    return build_regular_tables(len(reader.words.words), columns)


def _signed(text: str) -> int:
    size = bounded_int(text.lstrip("+-"))
    return -size if text.startswith("-") else size


def _next_headline(data: bytes, start: int) -> int:
    """Where the next line starts that begins with a backslash, or the end."""
    # One byte is found much faster than two.
    place = data.find(b"\\", start)
    while place > 0 and data[place - 1] != ord("\n"):
        place = data.find(b"\\", place + 1)
    return place if place >= 0 else len(data)


def log_value(text: str) -> float | None:
    """A log10 number as SRILM reads it: -inf for -99; None if there is no number."""
    if _DECIMAL.fullmatch(text):
        nothing = -0.0 if text.startswith("-") else 0.0
        value: float | None = float(text) if any(c.isdigit() for c in text) else nothing
    else:
        value = leading_float(text)
    return -np.inf if value is not None and np.float32(value) == LOG_ZERO else value
