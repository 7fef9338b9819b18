"""`hidden-ngram`: the events between the words of a text, by a language model of words and events."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.vocabulary import SENTENCE_END
from placerec.srilm.model.histories import Histories
from placerec.srilm.model.trellis import Step, numbered_states
from placerec.srilm.model.word_map import Choices, Observed, WordMap, read_positions
from placerec.srilm.text.sentences import Handling
from placerec.srilm.text.streams import Streams, exit_status, tokens
from placerec.srilm.text.vocabulary import WordList, read_aliases, read_words
from placerec.srilm.tools import decoding, ngram
from placerec.srilm.tools.decoding import (
    Printed,
    StepCache,
    costs_of,
    decode_all,
    language_model,
    observed_text,
    p_of,
    state_shares,
)
from placerec.srilm.tools.options import Option, Options, Parsed, parse

TOOL = "hidden-ngram"
OPTIONS: Options = {
    "order": Option("unsigned", 3, "largest n-gram length that is read and used"),
    "hidden-vocab": Option("string", None, "the events"),
    **{name: ngram.OPTIONS[name] for name in ("vocab", "limit-vocab", "tolower", "classes", "simple-classes")},
    "force-event": Option("flag", False, "there is an event behind every word"),
    "unk-prob": Option("float", -100.0, "log10 of what words of probability 0 cost"),
    "fw-only": Option("flag", False, "position by position what is most probable, by what came before"),
    **decoding.OPTIONS,
}
NO_EVENT = "*noevent*"
# The label of no event: before those of all events, which are word numbers.
_NOTHING = -1


@exit_status
def hidden_ngram(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `hidden-ngram` with these arguments; returns the exit status."""
    options = parse(tool, OPTIONS, arguments, streams)
    # Log 0 is infinite.
    with np.errstate(all="ignore"):
        _Run(options, streams).run()
    return 0


class _Run:
    """One run: the words, the events, the model, and the expected counts."""

    def __init__(self, options: Parsed, streams: Streams) -> None:
        self.options, self.streams = options, streams
        self.words = WordList(lower=options["tolower"], open_unknown=options["keep-unk"])
        if options["vocab"]:
            read_words(self.words, options["vocab"], streams)
        if options["vocab-aliases"]:
            read_aliases(self.words, options["vocab-aliases"], streams)
        self.sure = 0.0 if options["logmap"] else 1.0
        self.events: Choices = {}
        if options["hidden-vocab"]:
            lines = streams.lines(options["hidden-vocab"])
            self.events = {self.words.add(tokens(line)[0]): self.sure for line in lines if tokens(line)}
        if not options["force-event"] or not self.events:
            self.events[_NOTHING] = self.sure
        scorer = language_model(options, self.words, streams, kept=("unk-prob",))
        self.histories = Histories(scorer, max(1, options["order"]), -np.inf)
        self.cache = StepCache(options)
        self.costly = np.float32(options["unk-prob"])
        self.counts: dict[tuple[int, ...], float] = {}

    def run(self) -> None:
        """Decode, then write what is to be written."""
        options = self.options
        counted = self.count if options["write-counts"] else None
        printed = Printed(self.shown_path, self.shown_place, counted)
        decode_all(options, self.sources(), self.steps, printed, self.streams)
        if options["write-counts"]:
            self.streams.write(options["write-counts"], self.format_counts())

    def sources(self) -> Iterator[Observed]:
        """The sequences of -text and of -text-map."""
        options = self.options
        if options["text"]:
            handling = Handling(False, False, escape=options["escape"])
            yield from observed_text(options["text"], self.words, lambda word: self.events, self.streams, handling)
        if options["text-map"]:
            lines = self.streams.lines(options["text-map"])
            yield from read_positions(lines, self.likelihoods, SENTENCE_END, options["escape"])

    def likelihoods(self, fields: Sequence[str], position: str) -> Choices:
        """What a line of -text-map gives the events; only those that it lists are possible."""
        listed = WordMap.numbers_in(fields, position, logarithmic=self.options["logmap"])
        given = {_NOTHING if name == NO_EVENT else self.words.add(name): value for name, value in listed.items()}
        if self.options["force-event"]:
            given.pop(_NOTHING, None)
        # *noevent* comes last where events are gone through.
        return {event: given[event] for event in sorted(given, key=lambda event: (event == _NOTHING, event))}

    def steps(self, observed: Observed) -> list[Step]:
        """The trellis of a sequence: a state is an event, or none, and the context behind it."""
        steps: list[Step] = []
        self.states: list[list[int]] = []
        contexts: Ints = np.zeros(1, np.int64)
        names = [""]
        for i, (name, events) in enumerate(zip(observed.words, observed.choices, strict=True)):
            word = self.words.known(name)
            make = partial(self.step, i, word, events, contexts, names)
            step, contexts = self.cache.step(word, contexts, not i, make)
            steps.append(step)
            self.states.append(contexts.tolist())
            if self.options["debug"] >= 2:
                names = list(map(self.shown, step.labels.tolist(), contexts.tolist()))
        return steps

    def step(self, i: int, word: int, events: Choices, contexts: Ints, names: Sequence[str]) -> tuple[Step, Ints]:
        """Position number i behind states with contexts (S,), called `names`; and the contexts of the states there."""
        word_p, event_p, behind = self.transitions(contexts, word, events, first=not i)
        local = self.local(events)
        paid = self.options["lmw"] * (word_p.astype(np.float64) + event_p.astype(np.float64))
        costs = costs_of(paid, self.options["mapw"], local)
        # Without an event the context alone does not tell that there was none.
        keys = 2 * behind + (np.array(list(events), np.int64) == _NOTHING)[:, None]
        targets, found = numbered_states(keys.T)
        after: Ints = found // 2
        last = np.array([self.histories.contexts[context][-1] for context in after.tolist()], np.int64)
        step = Step(costs, targets.T, np.where(found % 2, _NOTHING, last))
        if self.options["debug"] >= 2:
            shown = list(map(self.shown, step.labels.tolist(), after.tolist()))
            self.tell(i, names, shown, step.targets, self.name(word), (word_p, event_p, local))
        return step, after

    def transitions(self, contexts: Ints, word: int, events: Choices, *, first: bool) -> tuple[Singles, Singles, Ints]:
        """log10 p of a word after contexts (S,), of the events behind it (A, S), and the contexts then (A, S)."""
        log10_p, after = self.histories.after(contexts, [word])
        word_p = np.zeros_like(log10_p[0]) if first else self.at_cost(log10_p[0])
        event_p = np.zeros((len(events), len(contexts)), np.float32)
        behind = np.tile(after, (len(events), 1))
        real = [event for event in events if event != _NOTHING]
        rows = np.flatnonzero(np.array(list(events)) != _NOTHING)
        if real:
            # Mixtures weigh the models by what stands before an event, however much of it the models use.
            known = self.histories.contexts
            whole = [self.histories.number((*known[context], word)) for context in contexts.tolist()]
            its_p, behind[rows] = self.histories.after(np.array(whole, np.int64), real)
            event_p[rows] = self.at_cost(its_p)
        return word_p, event_p, behind

    def at_cost(self, log10_p: Singles) -> Singles:
        """log10 p, with what words of probability 0 cost."""
        return np.where(np.isneginf(log10_p), self.costly, log10_p)

    def local(self, events: Choices) -> Floats:
        """log10 of what the map gives the events, float64 of float32 values (A,)."""
        values = np.array(list(events.values()), np.float64)
        local = values if self.options["logmap"] else np.log10(values)
        return local.astype(np.float32).astype(np.float64)

    def name(self, number: int) -> str:
        """What a word or an event is called."""
        return NO_EVENT if number == _NOTHING else str(self.words.words[number])

    def shown(self, label: int, context: int) -> str:
        """A state: the words of the context, the most recent first, behind the word for no event if there is none."""
        words = [self.name(word) for word in self.histories.contexts[context][::-1]]
        return " ".join([NO_EVENT, *words] if label == _NOTHING else words)

    def tell(
        self,
        i: int,
        before: Sequence[str],
        after: Sequence[str],
        targets: Ints,
        word: str,
        values: tuple[Singles, Singles, Floats],
    ) -> None:
        """The transitions into a position (-debug 2)."""
        word_p, event_p, local = (value.tolist() for value in values)
        for s, name in enumerate(before):
            for row, its_p, value in zip(targets.tolist(), event_p, local, strict=True):
                self.streams.say(
                    f"POSITION = {i} FROM: {name} TO: {after[row[s]]} WORD = {word} WORDPROB = {word_p[s]:g}"
                    f" EVENTPROB = {its_p[s]:g} LOCALPROB = {value:g}"
                )

    def shown_path(self, observed: Observed, labels: Sequence[int]) -> str:
        """A sequence with its events."""
        shown = []
        for word, label in zip(observed.words, labels, strict=True):
            shown.append(self.shown_word(word))
            if label != _NOTHING:
                shown.append(self.name(label))
        return " ".join(shown) + (" " if self.options["continuous"] or self.options["text-map"] else "")

    def shown_word(self, word: str) -> str:
        """A word of the text; an unknown one only with -keep-unk."""
        known = self.options["keep-unk"] or self.words.normal(word) in self.words.index
        return word if known else self.words.unknown

    def shown_place(self, word: str, shares: Mapping[int, float]) -> str:
        """A word and how probable are the events behind it."""
        shown = "".join(f" {self.name(label)} {shares[label]:g}" for label in sorted(shares))
        return f"{self.shown_word(word)}\t{shown}\n"

    def count(self, observed: Observed, steps: Sequence[Step]) -> None:
        """Add up how often n-grams are expected: each word behind the states before it, each event behind the word."""
        contexts: list[tuple[int, ...]] = [()]
        shares = [1.0]
        for name, step, log10_p, states in zip(
            observed.words, steps, state_shares(steps, self.options), self.states, strict=True
        ):
            word = self.words.known(name)
            for context, share in zip(contexts, shares, strict=True):
                for k in range(len(context) + 1):
                    self.add((*context[k:], word), share)
            shares = [p_of(value) for value in log10_p.tolist()]
            for label, share in zip(step.labels.tolist(), shares, strict=True):
                if label != _NOTHING:
                    self.add((label,), share)
                    if self.options["order"] > 1:
                        self.add((word, label), share)
            contexts = [() if state in self.histories.useless else self.histories.contexts[state] for state in states]

    def add(self, words: tuple[int, ...], share: float) -> None:
        """Count an n-gram."""
        self.counts[words] = self.counts.get(words, 0.0) + share

    def format_counts(self) -> str:
        """The expected counts as a counts file, sorted."""
        named = {tuple(map(self.name, words)): count for words, count in self.counts.items()}
        return "".join(f"{' '.join(words)}\t{named[words]:.16g}\n" for words in sorted(named))
