"""Which hidden words a word may stand for, and how probably: maps, from files or line by line (SRILM's -map)."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.order.hashing import table_order
from placerec.srilm.text.classes_file import split_expansion
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import Lines, SrilmError, Streams, tokens
from placerec.srilm.text.vocabulary import WordList

# A hidden word -> the number that a map gives it: a probability, or log10 of one.
Choices = dict[int, float]


class WordMap:
    """Words of one list to choices among the words of another. `logarithmic`: the numbers are log10, held in float32.

    The markers and the unknown word stand for themselves.
    """

    def __init__(self, words: WordList, hidden: WordList, *, logarithmic: bool = False) -> None:
        self.words, self.hidden, self.logarithmic = words, hidden, logarithmic
        self.sure = 0.0 if logarithmic else 1.0
        self.entries: dict[int, Choices] = {}
        for one, other in (
            (SENTENCE_START, SENTENCE_START),
            (SENTENCE_END, SENTENCE_END),
            (words.unknown, hidden.unknown),
        ):
            self.entries[words.add(one)] = {hidden.add(other): self.sure}

    def choices(self, fields: Sequence[str], position: str) -> Choices:
        """The hidden words that fields `v1 [p1] v2 [p2] ...` name; SrilmError, after `position`, for a bad number."""
        listed = self.numbers_in(fields, position, logarithmic=self.logarithmic)
        found = {self.hidden.add(name): value for name, value in listed.items()}
        return {number: found[number] for number in in_table_order(list(found))}

    @staticmethod
    def numbers_in(fields: Sequence[str], position: str, *, logarithmic: bool) -> dict[str, float]:
        """The names in fields `v1 [p1] v2 [p2] ...` and their numbers, 1 or log 1 for those without."""
        found: dict[str, float] = {}
        queue = list(fields)[::-1]
        while queue:
            name = queue.pop()
            value = leading_float(queue[-1]) if queue else None
            if value is None:
                found[name] = 0.0 if logarithmic else 1.0
                continue
            text = queue.pop()
            if not value < np.inf or (value < 0 and not logarithmic):
                kind = "a log10 probability" if logarithmic else "a probability"
                raise SrilmError(f"{position}{text} is not {kind} for {name}")
            found[name] = float(np.float32(value)) if logarithmic else value
        return found

    def read(self, name: str, streams: Streams) -> None:
        """Read a map file, `w v1 [p1] v2 [p2] ...` a line (-map)."""
        lines = streams.lines(name)
        for line in lines:
            word, *others = tokens(line)
            number = self.words.add(word)
            if number in self.entries:
                streams.say(f"{lines.position}warning: map redefining entry {self.words.normal(word)}")
                # It moves to the end.
                del self.entries[number]
            self.entries[number] = self.choices(others, lines.position)

    def read_classes(self, name: str, streams: Streams) -> None:
        """Read classes of single words, `CLASS [P] w` a line: a word stands for the classes that have it (-classes)."""
        lines = streams.lines(name)
        for line in lines:
            hidden, value, words = split_expansion(tokens(line))
            if len(words) != 1:
                streams.say(f"{lines.position}class definition must have exactly one word")
                raise SrilmError("format error in classes file")
            (choice,) = self.choices([hidden, *([] if value is None else [f"{value!r}"])], lines.position).items()
            entry = self.entries.setdefault(self.words.add(words[0]), {})
            entry[choice[0]] = choice[1]

    def format(self) -> str:
        """The map as a file (-write-map)."""
        return "".join(
            f"{self.words.words[word]}\t{' '.join(map(self._shown, self.entries[word].items()))}\n"
            for word in in_table_order(list(self.entries))
        )

    def _shown(self, choice: tuple[int, float]) -> str:
        name, value = str(self.hidden.words[choice[0]]), choice[1]
        return name if value == self.sure else f"{name} {value:.15g}"


class Observed(NamedTuple):
    """A sequence of words and what each may stand for; where in the file it ended; and the line to copy behind it."""

    words: list[str]
    choices: list[Choices]
    place: str
    escaped: str | None = None


def read_positions(
    lines: Lines, choices: Callable[[Sequence[str], str], Choices], end: str, escape: str | None
) -> Iterator[Observed]:
    """The sequences of a file `w v1 [p1] v2 [p2] ...`, a position a line (-text-map).

    One ends behind the word `end`, before a line that starts with `escape`, and with the file.
    """
    words: list[str] = []
    found: list[Choices] = []
    for line in lines:
        if escape is not None and line.startswith(escape):
            yield Observed(words, found, lines.position, line)
            words, found = [], []
            continue
        word, *others = tokens(line)
        words.append(word)
        found.append(choices(others, lines.position))
        if word == end:
            yield Observed(words, found, lines.position)
            words, found = [], []
    if words:
        yield Observed(words, found, lines.position)


def joined(sequences: Iterable[Observed]) -> Observed:
    """All sequences in one."""
    parts = list(sequences)
    words = [word for part in parts for word in part.words]
    return Observed(words, [choices for part in parts for choices in part.choices], parts[-1].place if parts else "")


def in_table_order(numbers: Sequence[int]) -> list[int]:
    """Word numbers as SRILM's tables give them back that were put in so."""
    keys = np.array(numbers, np.uint64)
    return [numbers[i] for i in table_order(np.zeros(len(keys), np.int64), keys).tolist()]
