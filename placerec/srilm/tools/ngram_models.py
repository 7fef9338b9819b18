"""The models of `ngram` where more than scoring is asked for: mixed, changed, cached, written; section 11."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from io import BytesIO
from typing import NamedTuple, cast

import numpy as np

from placerec.lm.logs import LOG_ZERO, shown
from placerec.lm.mix import merge, merge_weight
from placerec.lm.mutable import MutableModel, reweigh, unite
from placerec.lm.prune import prune, prune_improbable
from placerec.lm.score import TokenSequence
from placerec.lm.trie import runs
from placerec.srilm.model.arpa import read_model, tables_of, write_model
from placerec.srilm.model.class_scorers import Definitions
from placerec.srilm.model.count_models import CountModel, format_count_model, read_count_model
from placerec.srilm.model.mixed_scorers import Cached, Lenient, LogLinear, Mixture
from placerec.srilm.model.scorers import Model, Null, Scorer
from placerec.srilm.order.contexts import ContextTimes, merged_times, message_order
from placerec.srilm.order.messages import Messages
from placerec.srilm.text.classes_file import format_expansions
from placerec.srilm.text.streams import SrilmError, Streams, tokens
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.ngram_classes import expand_classes, read_definitions, with_classes
from placerec.srilm.tools.options import Option, Parsed, parse

# Weights of a list are written with a few digits.
_ROUNDING = 0.01
_COMPONENT_OPTIONS = {
    "weight": Option("float", -1.0),
    "order": Option("unsigned", 0),
    "type": Option("string", "ARPA"),
}


class Component(NamedTuple):
    """A model of a mixture: its file, its weight, and the largest n-gram length that is used of it."""

    name: str
    weight: float
    order: int


def read_components(name: str, order: int, streams: Streams) -> list[Component]:
    """The models that a list names (-read-mix-lms): lines `FILE -weight W [-order N] [-type ARPA]`.

    Raises SrilmError for a line without a weight, of which the manual does not say what it means, and for weights that
    do not sum to 1.
    """
    components = []
    lines = streams.lines(name)
    for line in lines:
        file, *settings = tokens(line)
        complaints = BytesIO()
        parsed = parse(name, _COMPONENT_OPTIONS, settings, Streams(streams.stdin, streams.stdout, complaints))
        weight = parsed["weight"]
        if complaints.getvalue() or parsed.rest or parsed["type"] != "ARPA" or not 0 <= weight <= 1:
            raise SrilmError(
                f"{lines.position}{line!r} is no line `FILE -weight W [-order N] [-type ARPA]`, W from 0 to 1"
            )
        components.append(Component(file, weight, max(1, parsed["order"] or order)))
    total = sum(component.weight for component in components)
    if abs(total - 1) > _ROUNDING:
        raise SrilmError(f"{name}: the weights of {len(components)} models sum to {total:g}, not to 1")
    return components


class Models:
    """The options, the words, and the model that can be written (None: there is none)."""

    def __init__(self, options: Parsed, words: WordList, streams: Streams) -> None:
        self.options = options
        self.streams = streams
        self.order = max(1, options["order"])
        self.debug = options["debug"]
        self.words = words
        self.mutable: MutableModel | None = None
        # When the model's contexts were made: worth finding only where the order of messages asks for it.
        self.times: Callable[[], ContextTimes] | None = None
        self.counted: CountModel | None = None
        self.definitions: Definitions | None = None

    def scorer(self) -> Scorer:
        """What scores: sections 9.2 to 9.6, in this order."""
        if self.options["null"]:
            scorer: Scorer = partial(Null, self.words)
        else:
            scorer = self.counting() if self.options["count-lm"] else self.backing_off()
            if self.options["cache"]:
                self.mutable = None
                weight, recent = self.options["cache-lambda"], list[int]()
                self.check_priors([1 - weight, weight])
                scorer = partial(Cached, scorer, self.words, self.options["cache"], weight, self.debug, recent)
        scorer = self.lenient(scorer)
        return self.rescored(scorer) if self.options["rescore-ngram"] else scorer

    def backing_off(self) -> Scorer:
        """The back-off model of -lm, and what is mixed with it."""
        components = self.components()
        self.mutable, times = self.read_component(components[0], "lm file")
        self.times = lambda: times
        if self.options["classes"]:
            self.definitions = read_definitions(self.options, self.words, self.streams)
        return self.mixed(components)

    def counting(self) -> Scorer:
        """The count model of -lm (-count-lm)."""
        options, name = self.options, self.options["lm"]
        for other in ("mix-lm", "read-mix-lms", "classes", "renorm", "prune", "prune-lowprobs", "skipoovs"):
            if options[other]:
                raise SrilmError(f"-{other} needs a back-off model; leave it or -count-lm out", 2)
        failure, limited = f"format error in count-lm file{name}", options["limit-vocab"]
        self.counted = read_count_model(name, self.words, self.streams, self.order, failure, limited=limited)
        return self.counted

    def read(
        self, name: str, what: str, *, order: int | None = None, words: WordList | None = None, cased: bool = False
    ) -> tuple[MutableModel, ContextTimes]:
        """Read a model; `cased`: messages show words as they are in the file."""
        return read_model(
            name,
            words or self.words,
            self.streams,
            order=order or self.order,
            debug=self.debug,
            limited=self.options["limit-vocab"] and words is None,
            what=what,
            cased=cased,
        )

    def together(self, *mutables: MutableModel) -> list[MutableModel]:
        """The models over one trie and all words known by now."""
        vocabulary, _ = self.words.sorted()
        if len(mutables) == 1 and mutables[0].trie.vocabulary.words == vocabulary.words:
            return [*mutables]
        names = np.array(self.words.names(vocabulary), np.int64)
        return unite(mutables, vocabulary, ~vocabulary.mask(self.words.non_events), names)

    def messages(self, mutable: MutableModel) -> Messages:
        """Who says what happens to a model."""
        numbers, times = self.words.numbers(mutable.trie.vocabulary), self.times
        order = message_order(mutable.trie, times) if times else None
        return Messages(mutable.trie, self.streams, self.debug, numbers=numbers, weighed=order)

    def components(self) -> list[Component]:
        """The models that are mixed, -lm's first."""
        options = self.options
        if options["read-mix-lms"]:
            return read_components(options["lm"], self.order, self.streams)
        if not options["mix-lm"]:
            return [Component(options["lm"], 1.0, self.order)]
        rest = 1.0 - options["lambda"] - sum(options[f"mix-lambda{k}"] for k in range(2, 10))
        first = [
            Component(options["lm"], options["lambda"], self.order),
            Component(options["mix-lm"], rest, self.order),
        ]
        more = [k for k in range(2, 10) if options[f"mix-lm{k}"]]
        return first + [Component(options[f"mix-lm{k}"], options[f"mix-lambda{k}"], self.order) for k in more]

    def read_component(self, component: Component, what: str) -> tuple[MutableModel, ContextTimes]:
        """Read one of the models that are mixed."""
        return self.read(component.name, what, order=component.order)

    def mixed(self, components: Sequence[Component]) -> Scorer:
        """Static and dynamic mixtures, and what changes the model between them."""
        options = self.options
        others, weights = components[1:], [component.weight for component in components]
        dynamic = options["bayes"] is not None or options["loglinear-mix"]
        if not dynamic:
            for k, component in enumerate(others, start=1):
                self.merge(component, merge_weight(weights, k))
        self.change()
        # SRILM's dynamic mixtures do not hand -skipoovs down.
        back = min(2, self.order - 1) if options["skipoovs"] and not (dynamic and others) else None
        model = self.classed(Model(partial(tables_of, self.model(), self.words), self.words, back))
        if not dynamic or not others:
            return model
        mutables = [self.read_component(component, "mix-lm file")[0] for component in others]
        more = [self.classed(Model(partial(tables_of, mutable, self.words), self.words)) for mutable in mutables]
        if self.definitions is not None and (options["loglinear-mix"] or options["bayes"] > 0):
            raise SrilmError("with -classes only -bayes 0 mixes models while scoring", 2)
        models = cast(list[Model], [model, *more])
        self.mutable = None
        if options["loglinear-mix"]:
            return partial(LogLinear, models, weights, self.words, self.debug, {})
        self.check_priors(weights)
        return partial(Mixture, models, weights, options["bayes"], options["bayes-scale"], self.debug >= 3)

    def merge(self, component: Component, weight: float) -> None:
        """Mix a component into the model, whose share is `weight`."""
        read, its = self.read_component(component, "mix-lm file")
        self.mutable, other = self.together(self.model(), read)
        del read
        self.times = self.times_merged(self.mutable, other, its)
        merge(self.mutable, other, weight, self.messages(self.mutable))

    def check_priors(self, weights: Sequence[float]) -> None:
        """Say which weights of a mixture are none."""
        for weight in weights:
            if not 0 <= weight <= 1:
                self.streams.say(f"warning: mixture prior out of range: {shown(weight)}")

    def times_merged(self, model: MutableModel, other: MutableModel, its: ContextTimes) -> Callable[[], ContextTimes]:
        """When the contexts of the model will have been made once another one is merged into it."""
        times, numbers = self.times, self.words.numbers(model.trie.vocabulary)
        new = [theirs & ~own for theirs, own in zip(other.stored, model.stored, strict=True)]

        def found() -> ContextTimes:
            assert times is not None
            added = [runs(model.trie.prefix(n)[mask])[0] for n, mask in enumerate(new[1:], start=2)]
            return merged_times(times(), its, model, [np.zeros(0, np.int64), *added], numbers)

        return cache(found)

    def classed(self, model: Model) -> Scorer:
        """A model over the classes that -classes defines, or the model itself if there are none."""
        return model if self.definitions is None else with_classes(model, self.definitions, self.options)

    def model(self) -> MutableModel:
        """The model that was read; there is one wherever this is called."""
        assert self.mutable is not None
        return self.mutable

    def change(self) -> None:
        """`-renorm`, `-prune` and `-prune-lowprobs`."""
        options = self.options
        if options["renorm"]:
            (mutable,) = self.together(self.model())
            least = options["minbackoff"]
            reweigh(mutable, self.messages(mutable), minimum=least if least is not None and 0 <= least <= 1 else None)
            self.mutable = mutable
        if self.definitions is not None and options["expand-classes"] is not None:
            self.times = None
            self.mutable = expand_classes(self.model(), self.definitions, options, self.words, self.messages)
            self.definitions = None
        if options["prune"] > 0:
            history = None
            if options["prune-history-lm"]:
                name, shorter = options["prune-history-lm"], max(1, self.order - 1)
                history, _ = self.read(name, "history LM file", order=shorter, cased=True)
                mutable, history = self.together(self.model(), history)
            else:
                (mutable,) = self.together(self.model())
            trace = self.messages(mutable)
            prune(mutable, options["prune"], shortest=options["minprune"], history=history, trace=trace)
            self.mutable = mutable
        if options["prune-lowprobs"]:
            (mutable,) = self.together(self.model())
            prune_improbable(mutable, shortest=options["minprune"], trace=self.messages(mutable))
            self.mutable = mutable

    def lenient(self, scorer: Scorer) -> Scorer:
        """`-zeroprob-word` and `-unk-prob`."""
        unknown_p, stand_in = self.options["unk-prob"], self.options["zeroprob-word"]
        if unknown_p is None and stand_in is None:
            return scorer
        self.mutable = self.counted = None
        if unknown_p == LOG_ZERO:
            unknown_p = -np.inf
        number = None if stand_in is None else self.words.add(stand_in)
        return partial(Lenient, scorer, self.words.index[self.words.unknown], unknown_p, number)

    def rescored(self, scorer: Scorer) -> Scorer:
        """`-rescore-ngram` (section 11.6): another model's n-grams with the probabilities that `scorer` gives them."""
        options = self.options
        own = WordList(lower=options["tolower"], open_unknown=options["unk"])
        mutable, times = self.read(options["rescore-ngram"], "lm file", words=own)
        self.times = lambda: times
        index, unknown = self.words.index, self.words.index[self.words.unknown]
        numbers = np.array([index.get(word, unknown) for word in mutable.trie.vocabulary.words], np.int64)
        for n in range(mutable.order, 0, -1):
            rows = np.flatnonzero(mutable.stored[n - 1])
            sequence = TokenSequence.of_rows(numbers[mutable.trie.matrix(n)[rows]])
            mutable.log10_p[n - 1][rows] = scorer(sequence).score().log10_p[n - 1 :: n]
        self.mutable, self.words, self.definitions = mutable, own, None
        reweigh(mutable, self.messages(mutable))
        return Model(partial(tables_of, mutable, own), own)

    def write(self, name: str) -> None:
        """`-write-lm`."""
        mutable = self.mutable
        if self.counted and not self.options["rescore-ngram"]:
            with self.streams.output(name) as file:
                file.writelines(text.encode("latin-1") for text in format_count_model(self.counted, whole=True))
            return
        if mutable is None:
            self.streams.write(name, "")
            self.streams.say("write() method not implemented")
            self.streams.say(f"error writing {name}")
            return
        behind = ""
        if self.definitions is not None:
            behind = f"\n{format_expansions(self.definitions.expansions(self.words))}\n"
        write_model(mutable, name, self.streams, self.debug, behind=behind)
