"""Models over classes of words: sections T4.1 and T4.2 of our specification of SRILM's tools.

Words and classes have SRILM's numbers. A word is explained by itself or as (the start of) what a class stands for.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.logs import LN10, log10, p_of
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import Model, Scored
from placerec.srilm.text.classes_file import Expansion
from placerec.srilm.text.vocabulary import WordList

Ngram = tuple[int, ...]


class Definitions:
    """What classes stand for: `of` by class the expansions with their log10 P, `starting` by first word their classes.

    Of equal expansions of a class the last one counts. `longest`: how many words the longest one has.
    """

    def __init__(self, expansions: Iterable[Expansion], words: WordList) -> None:
        self.of: dict[int, dict[Ngram, float]] = {}
        self.p: dict[tuple[int, Ngram], float] = {}
        for name, p, expanded in expansions:
            number = words.add(name)
            ngram = tuple(map(words.add, expanded))
            value = 1.0 if p is None else p
            self.of.setdefault(number, {})[ngram] = math.log10(value) if value > 0 else -math.inf
            self.p[number, ngram] = value
        self.longest = max((len(ngram) for _, ngram in self.p), default=1)
        self.starting: dict[int, list[tuple[int, float, Ngram]]] = {}
        for number, ngrams in self.of.items():
            for ngram, log10_p in ngrams.items():
                self.starting.setdefault(ngram[0], []).append((number, log10_p, ngram[1:]))

    def expansions(self, words: WordList) -> list[Expansion]:
        """The definitions by name."""
        return [
            Expansion(str(words.words[number]), p, tuple(str(words.words[word]) for word in ngram))
            for (number, ngram), p in self.p.items()
        ]


class SimpleClasses:
    """A token sequence where each word is of the first class that starts with it, or of none (-simple-classes)."""

    def __init__(self, model: Model, definitions: Definitions, sequence: TokenSequence) -> None:
        size = len(model.words.words)
        self.class_of, self.log10_p = np.arange(size), np.zeros(size, np.float32)
        for word, classes in definitions.starting.items():
            self.class_of[word], self.log10_p[word] = classes[0][:2]
        self.ids = sequence.ids
        self.view = model(sequence._replace(ids=self.class_of[sequence.ids]))

    @property
    def used(self) -> Ints:
        """How many words before each word the model can use, int64 (T,)."""
        return self.view.used

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        ids = self.ids if words is None else words
        below = self.view.score(self.class_of[ids])
        return Scored(below.log10_p + self.log10_p[ids], below.tag)

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        return self.view.distribution(t)[self.class_of] + self.log10_p


class Step(NamedTuple):
    """A token behind a context: its log10 p, what is printed before it, and the context that it leads to."""

    log10_p: float
    tag: str
    context: Ngram


class ClassModel:
    """A model in which the ways of explaining words by classes are summed up; what it was asked for is remembered."""

    def __init__(self, model: Model, definitions: Definitions) -> None:
        self.model, self.words, self.definitions = model, model.words, definitions
        self.steps: dict[tuple[Ngram, int], Step] = {}
        self.distributions: dict[Ngram, Floats] = {}

    def __call__(self, sequence: TokenSequence) -> "ClassView":
        return ClassView(self, sequence)

    def prepare(self, asked: Iterable[tuple[Ngram, int]]) -> None:
        """Look up what is not known yet, all at once."""
        wanted = [key for key in dict.fromkeys(asked) if key not in self.steps]
        if not wanted:
            return
        behind = self.words.index[self.words.unknown]
        rows = [(*context, token, behind) for context, token in wanted]
        lengths = np.array([len(row) for row in rows], np.int64)
        stops = np.cumsum(lengths)
        first = np.zeros(int(stops[-1]), bool)
        first[stops - lengths] = True
        view = self.model(TokenSequence(np.array([i for row in rows for i in row], np.int64), first, ~first))
        scored = view.score()
        for key, stop in zip(wanted, stops.tolist(), strict=True):
            used = int(view.used[stop - 1])
            context = (*key[0], key[1])
            self.steps[key] = Step(
                float(scored.log10_p[stop - 2]), scored.tag(stop - 2), context[len(context) - used :]
            )

    def start(self, word: int) -> "States":
        """Where a sentence stands behind a first word that is taken as given."""
        self.prepare([((), word)])
        return States({(self.steps[(), word].context, ()): 0.0}, 0.0)

    def advance(self, states: "States", word: int) -> tuple["States", float, list[str]]:
        """Where a sentence stands after one more word, the sum of all ways there, and what is printed before it."""
        classes = self.definitions.starting.get(word, [])
        self.prepare(
            (context, token)
            for context, rest in states.of
            if not rest
            for token in (word, *(number for number, _, _ in classes))
        )
        # What is looked back at is rounded in another order than what is looked at first: found from printed values.
        after: dict[tuple[Ngram, Ngram], float] = {}
        ahead: dict[tuple[Ngram, Ngram], float] = {}
        tags = []
        for (context, rest), log10_p in states.of.items():
            if rest:
                if rest[0] == word:
                    _add(after, (context, rest[1:]), log10_p)
                    _add(ahead, (context, rest[1:]), log10_p)
                continue
            for token, share, left in ((word, 0.0, ()), *classes):
                step = self.steps[context, token]
                tags.append(step.tag)
                _add(after, (step.context, left), single(log10_p + single(step.log10_p + share)))
                _add(ahead, (step.context, left), single(single(log10_p + step.log10_p) + share))
        return States(after, _total(after)), _total(ahead), tags

    def score(self, states: "States", word: int) -> tuple["States", float, str]:
        """Where a sentence stands after one more word, the word's log10 p, and what is printed before it."""
        after, total, tags = self.advance(states, word)
        if after.total == -math.inf:
            # Nothing explains the words so far: what comes is taken as if they had been explained up to here.
            context = next((context for context, rest in after.of if not rest), ())
            return States({(context, ()): states.total}, states.total), -math.inf, "".join(tags)
        return after, single(total - states.total), "".join(tags)

    def spread(self, context: Ngram) -> Floats:
        """p of every token behind a context, float64 by SRILM's number."""
        if context not in self.distributions:
            ids = np.array([*context, self.words.index[self.words.unknown]], np.int64)
            place = np.arange(len(ids))
            view = self.model(TokenSequence(ids, place == 0, place == len(context)))
            self.distributions[context] = p_of(view.distribution(len(context)))
        return self.distributions[context]


class States(NamedTuple):
    """The ways to have come here: log10 p by context and what is left of an expansion; and the sum of all."""

    of: Mapping[tuple[Ngram, Ngram], float]
    total: float


def single(value: float) -> float:
    """The nearest float32."""
    return float(np.float32(value))


def add_logs(a: float, b: float) -> float:
    """log10 of the sum of two probabilities, rounded to float32."""
    high, low = max(a, b), min(a, b)
    if low == -math.inf:
        return high
    return single(high + math.log10(1 + math.exp((low - high) * LN10)))


def _total(states: Mapping[tuple[Ngram, Ngram], float]) -> float:
    total = -math.inf
    for log10_p in states.values():
        total = add_logs(total, log10_p)
    return total


def _add(states: dict[tuple[Ngram, Ngram], float], state: tuple[Ngram, Ngram], log10_p: float) -> None:
    states[state] = add_logs(states[state], log10_p) if state in states else log10_p


class ClassView:
    """A token sequence, read by a ClassModel."""

    def __init__(self, model: ClassModel, sequence: TokenSequence) -> None:
        self.model, self.sequence = model, sequence
        self.before: list[States] = []
        self.log10_p = np.zeros(len(sequence.ids), np.float32)
        self.tags: list[str] = []
        states = States({}, 0.0)
        for t, word in enumerate(sequence.ids.tolist()):
            if sequence.first[t]:
                states = States({((), ()): 0.0}, 0.0)
            self.before.append(states)
            if sequence.first[t] and not sequence.scored[t]:
                states = model.start(word) if word == self._start else model.score(states, word)[0]
                self.tags.append("")
                continue
            states, self.log10_p[t], tag = model.score(states, word)
            self.tags.append(tag)

    @property
    def _start(self) -> int:
        return self.model.words.index.get("<s>", -1)

    @property
    def used(self) -> Ints:
        """How many words before each word count for it, int64 (T,): those that a context's classes may stand for.

        That is exact where words tell their classes; else what stands further back would say more of a context.
        """
        most = len(self.model.model.tables.tables) * self.model.definitions.longest - 1
        furthest: Ints = np.minimum(self.sequence.place, most)
        return furthest

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        if words is None:
            return Scored(self.log10_p, self.tags.__getitem__)
        found = [self.model.score(states, word) for states, word in zip(self.before, words.tolist(), strict=True)]
        return Scored(np.array([log10_p for _, log10_p, _ in found], np.float32), lambda t: found[t][2])

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        states, size = self.before[t], len(self.model.words.words)
        p = np.zeros(size)
        for (context, rest), log10_p in states.of.items():
            share = math.exp((log10_p - states.total) * LN10)
            if rest:
                p[rest[0]] += share
                continue
            tokens = self.model.spread(context)
            p[: len(tokens)] += share * tokens
            for word, classes in self.model.definitions.starting.items():
                p[word] += share * sum(tokens[number] * 10**inner for number, inner, _ in classes)
        return log10(p)
