"""`disambig`: the hidden words behind the words of a text, by a map and a language model."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.vocabulary import SENTENCE_END
from placerec.srilm.model.histories import Histories
from placerec.srilm.model.trellis import Step, best_path, forward, numbered_states
from placerec.srilm.model.word_map import Choices, Observed, WordMap, in_table_order, read_positions
from placerec.srilm.text.sentences import Handling
from placerec.srilm.text.streams import Streams, exit_status
from placerec.srilm.text.vocabulary import WordList, format_words, read_aliases
from placerec.srilm.tools import decoding
from placerec.srilm.tools.decoding import (
    Printed,
    StepCache,
    costs_of,
    decode_all,
    language_model,
    observed_text,
    shares_of,
)
from placerec.srilm.tools.options import Option, Options, Parsed, parse

TOOL = "disambig"
OPTIONS: Options = {
    "order": Option("unsigned", 2, "largest n-gram length that is read and used"),
    "map": Option("string", None, "which hidden words a word may stand for"),
    "classes": Option("string", None, "classes of single words, for a map"),
    "scale": Option("flag", False, "divide the map's probabilities by those of the hidden words"),
    "no-eos": Option("flag", False, "do not put </s> behind sentences"),
    "tolower1": Option("flag", False, "A to Z become a to z in the text and in the map"),
    "tolower2": Option("flag", False, "A to Z become a to z in hidden words and in the model"),
    "write-map": Option("string", None, "write the map"),
    "write-vocab1": Option("string", None, "write the words of the map"),
    "write-vocab2": Option("string", None, "write the hidden words"),
    **decoding.OPTIONS,
}
# What a transition of probability 0 costs.
_NEVER = np.float32(-100)


@exit_status
def disambig(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `disambig` with these arguments; returns the exit status."""
    options = parse(tool, OPTIONS, arguments, streams)
    # Log 0 is infinite.
    with np.errstate(all="ignore"):
        _Run(options, streams).run()
    return 0


class _Run:
    """One run: the words, the map, the model, and the counts of what was found."""

    def __init__(self, options: Parsed, streams: Streams) -> None:
        self.options, self.streams = options, streams
        words = WordList(lower=options["tolower1"])
        self.hidden = WordList(lower=options["tolower2"], open_unknown=options["keep-unk"])
        if options["vocab-aliases"]:
            read_aliases(self.hidden, options["vocab-aliases"], streams)
        self.map = WordMap(words, self.hidden, logarithmic=options["logmap"])
        if options["map"]:
            self.map.read(options["map"], streams)
        if options["classes"]:
            self.map.read_classes(options["classes"], streams)
        scorer = language_model(options, self.hidden, streams, kept=("classes",))
        self.histories = Histories(scorer, max(1, options["order"]))
        self.cache = StepCache(options)
        self.counts: dict[int, dict[int, int]] = {}

    def run(self) -> None:
        """Decode, then write what is to be written."""
        options = self.options
        counted = self.count if options["write-counts"] else None
        printed = Printed(self.shown_path, self.shown_place, counted)
        decode_all(options, self.sources(), self.steps, printed, self.streams)
        if options["write-counts"]:
            self.streams.write(options["write-counts"], self.format_counts())
        if options["write-vocab1"]:
            self.streams.write(options["write-vocab1"], format_words(self.map.words))
        if options["write-vocab2"]:
            self.streams.write(options["write-vocab2"], format_words(self.hidden))
        if options["write-map"]:
            self.streams.write(options["write-map"], self.map.format())

    def sources(self) -> Iterator[Observed]:
        """The sequences of -text and of -text-map."""
        options, words = self.options, self.map.words
        if options["text"]:
            marked = not options["continuous"]
            handling = Handling(marked, marked and not options["no-eos"], escape=options["escape"])
            yield from observed_text(options["text"], words, self.choices, self.streams, handling)
        if options["text-map"]:
            lines = self.streams.lines(options["text-map"])
            yield from read_positions(lines, self.map.choices, SENTENCE_END, options["escape"])

    def choices(self, word: int) -> Choices:
        """What a word of the text may stand for."""
        entries = self.map.entries
        return entries[word] if word in entries else entries[self.map.words.index[self.map.words.unknown]]

    def steps(self, observed: Observed) -> list[Step]:
        """The trellis of a sequence; of the first position the model says nothing."""
        steps: list[Step] = []
        contexts: Ints = np.zeros(1, np.int64)
        for i, choices in enumerate(observed.choices):
            step, contexts = self.cache.step(id(choices), contexts, not i, partial(self.step, i, choices, contexts))
            steps.append(step)
        return steps

    def step(self, i: int, choices: Choices, contexts: Ints) -> tuple[Step, Ints]:
        """Position number i behind contexts (S,), and the contexts of the states there, which end in hidden words."""
        log10_p, behind = self.histories.after(contexts, list(choices))
        log10_p = np.where(np.isneginf(log10_p), _NEVER, log10_p)
        local = self.local(choices)
        if i and self.options["debug"] >= 2:
            self.tell(i, contexts, behind, log10_p, local)
        paid = self.options["lmw"] * log10_p.astype(np.float64) if i else np.zeros(log10_p.shape)
        costs = costs_of(paid, self.options["mapw"], local)
        targets, found = numbered_states(behind)
        labels = np.array([self.histories.contexts[context][-1] for context in found.tolist()], np.int64)
        return Step(costs, targets, labels), found

    def local(self, choices: Choices) -> Floats:
        """log10 of what the map gives the choices, float64 of float32 values (A,)."""
        values = np.array(list(choices.values()), np.float64)
        local = values if self.options["logmap"] else np.log10(values)
        local = local.astype(np.float32)
        if self.options["scale"]:
            single, _ = self.histories.after(np.zeros(1, np.int64), list(choices))
            local = np.where(np.isneginf(single[:, 0]), local, local - single[:, 0])
        return local.astype(np.float64)

    def tell(self, i: int, contexts: Ints, behind: Ints, log10_p: Singles, local: Floats) -> None:
        """The transitions into a position (-debug 2)."""
        for row, its_p, value in zip(behind.tolist(), log10_p.tolist(), local.tolist(), strict=True):
            for before, after, p in zip(contexts.tolist(), row, its_p, strict=True):
                self.streams.say(
                    f"position = {i} from: {self.shown(before)} to: {self.shown(after)} trans = {p:g} local = {value:g}"
                )

    def shown(self, context: int) -> str:
        """The words of a context, the most recent first."""
        return " ".join(str(self.hidden.words[word]) for word in self.histories.contexts[context][::-1])

    def shown_path(self, observed: Observed, labels: Sequence[int]) -> str:
        """A decoded sequence."""
        unknown = self.hidden.index[self.hidden.unknown]
        keep = self.options["keep-unk"]
        words = [
            word if keep and label == unknown else str(self.hidden.words[label])
            for word, label in zip(observed.words, labels, strict=True)
        ]
        return " ".join(words) + (" " if self.options["continuous"] or self.options["text-map"] else "")

    def shown_place(self, word: str, shares: dict[int, float]) -> str:
        """A word and how probable is what it stands for."""
        known = self.options["text-map"] or self.map.words.normal(word) in self.map.words.index
        shown = "".join(f" {self.hidden.words[label]} {share:g}" for label, share in shares.items())
        return f"{word if known else self.map.words.unknown}\t{shown}\n"

    def count(self, observed: Observed, steps: Sequence[Step]) -> None:
        """Count the best of each position; with -fb, whatever is possible there."""
        if self.options["fb"]:
            found = [
                [label for label, share in its.items() if share > -np.inf] for its in shares_of(steps, self.options)
            ]
        else:
            found = [[label] for label in best_path(steps, forward(steps, summed=False)).labels]
        for word, labels in zip(observed.words, found, strict=True):
            table = self.counts.setdefault(self.map.words.known(word), {})
            for label in labels:
                table[label] = table.get(label, 0) + 1

    def format_counts(self) -> str:
        """The counts, in the order of the map."""
        lines = []
        for word in in_table_order(list(self.map.entries)):
            table = self.counts.get(word, {})
            for label in self.map.entries[word]:
                if label in table:
                    lines.append(f"{self.hidden.words[label]} {self.map.words.words[word]}\t{table[label]}\n")
        return "".join(lines)
