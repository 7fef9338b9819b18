"""What `disambig` and `hidden-ngram` have in common: options, the model, sequences to decode, and what is printed."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, cast

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.logs import LN10
from placerec.srilm.model.scorers import SightedScorer
from placerec.srilm.model.trellis import (
    Step,
    backward,
    best_path,
    best_paths,
    forward,
    joint_log10_p,
    label_shares,
    total_log10_p,
)
from placerec.srilm.model.word_map import Choices, Observed, joined
from placerec.srilm.text.sentences import Handling, mark, read_sentences
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools import ngram
from placerec.srilm.tools.ngram_models import Models
from placerec.srilm.tools.options import Option, Options, Parsed

_MOST_KEPT = 4096
_MODEL = ("lm", "mix-lm", "lambda", *(f"mix-{what}{k}" for k in range(2, 10) for what in ("lm", "lambda")))
OPTIONS: Options = {
    "text": Option("string", None, "the text to decode"),
    "text-map": Option("string", None, "what to decode, a position a line, with what it may stand for"),
    **{name: ngram.OPTIONS[name] for name in (*_MODEL, "bayes-scale", "vocab-aliases", "debug")},
    "bayes": Option("unsigned", None, "weigh mixed models by this many of the last words (default: all in use)"),
    "lmw": Option("float", 1.0, "the weight of the model"),
    "mapw": Option("float", 1.0, "the weight of the map"),
    "logmap": Option("flag", False, "maps hold logarithms to the base of 10"),
    "keep-unk": Option("flag", False, "print unknown words as they are; <unk> is a word like others"),
    "continuous": Option("flag", False, "the whole text is one sequence, without <s> and </s>"),
    "fb": Option("flag", False, "position by position what is most probable, by forward-backward"),
    "totals": Option("flag", False, "print log10 of the best sequence's probability; with -fb, of all"),
    "posteriors": Option("flag", False, "print how probable is what, position by position"),
    "nbest": Option("unsigned", 1, "print so many sequences, the best first"),
    "escape": Option("string", None, "the start of lines to copy"),
    "write-counts": Option("string", None, "write how often what was found"),
}


def language_model(
    options: Parsed, words: WordList, streams: Streams, *, kept: Sequence[str] = ()
) -> SightedScorer | None:
    """The model that -lm and its sisters name; None without -lm. Mixtures are always mixed while scoring.

    `kept`: options that mean something else to the decoder than to `ngram`.
    """
    if options["lm"] is None:
        return None
    defaults = {name: option.default for name, option in ngram.OPTIONS.items()}
    own = {name: value for name, value in options.values.items() if name in defaults and name not in kept}
    length = options["bayes"] if options["bayes"] is not None else max(1, options["order"])
    # What stands around models is no option of decoders.
    return cast(SightedScorer, Models(Parsed({**defaults, **own, "bayes": length}), words, streams).scorer())


def observed_text(
    name: str, words: WordList, choices: Callable[[int], Choices], streams: Streams, handling: Handling
) -> Iterator[Observed]:
    """The sentences of a text; `choices`: what the word of a number may stand for."""
    for sentences in read_sentences(streams.lines(name), words, handling._replace(verbose=True)):
        marked = mark(sentences, words, handling)
        unknown, stop, done = words.index[words.unknown], 0, 0
        for place, line in (*sentences.escapes, (len(marked.lengths), None)):
            for i in range(done, place):
                numbers = marked.numbers[stop : stop + int(marked.lengths[i])].tolist()
                stop += len(numbers)
                # Unknown words have lost their names, not their order.
                lost = iter(word for word in sentences.shown[i].split(" ") if words.known(word) == unknown)
                shown = [next(lost) if number == unknown else str(words.words[number]) for number in numbers]
                yield Observed(shown, list(map(choices, numbers)), f"{name}: line {sentences.places[i]}: ")
            done = place
            if line is not None:
                yield Observed([], [], "", line.removesuffix("\n"))


class Printed(NamedTuple):
    """How a decoder prints: `path` the labels of a sequence, `place` a word and the shares of labels behind it."""

    path: Callable[[Observed, Sequence[int]], str]
    place: Callable[[str, dict[int, float]], str]
    counted: Callable[[Observed, Sequence[Step]], None] | None = None


def decode_all(
    options: Parsed,
    sources: Iterable[Observed],
    steps: Callable[[Observed], list[Step]],
    printed: Printed,
    streams: Streams,
) -> None:
    """Decode sequence after sequence and print what the options ask for; escaped lines are copied."""
    if options["continuous"]:
        sources = [joined(_without_escapes(sources, streams))]
    for observed in sources:
        if observed.words:
            _decode(options, observed, steps(observed), printed, streams)
        if observed.escaped is not None:
            streams.print(observed.escaped + "\n")


def _without_escapes(sources: Iterable[Observed], streams: Streams) -> Iterator[Observed]:
    for observed in sources:
        if observed.escaped is not None:
            streams.print(observed.escaped + "\n")
        yield observed


def _decode(options: Parsed, observed: Observed, steps: list[Step], printed: Printed, streams: Streams) -> None:
    summed = bool(options["fb"])
    scores = forward(steps, summed=summed)
    total = total_log10_p(scores[-1]) if summed else float(np.max(scores[-1], initial=-np.inf))
    if total == -np.inf:
        streams.say(f"{observed.place}Disambiguation failed")
        return
    if printed.counted:
        printed.counted(observed, steps)
    if options["posteriors"]:
        for word, shares in zip(observed.words, shares_of(steps, options, scores), strict=True):
            shown = shares if options["logmap"] else {label: p_of(share) for label, share in shares.items()}
            streams.print(printed.place(word, shown))
    elif options["totals"]:
        streams.print(f"{total:g}\n")
    elif options["nbest"] > 1 and not summed:
        for k, path in enumerate(best_paths(steps, options["nbest"])):
            streams.print(f"NBEST_{k} {path.log10_p:g} {printed.path(observed, path.labels)}\n")
    else:
        alone = by_share(options)
        labels = decided(shares_of(steps, options, scores)) if alone else best_path(steps, scores).labels
        start = f"NBEST_0 {total:g} " if options["nbest"] > 1 else ""
        streams.print(f"{start}{printed.path(observed, labels)}\n")


def costs_of(paid: Floats, weight: float, local: Floats) -> Singles:
    """The costs float32 (A, S): what the model asks (A, S), and the weighted log10 p of a map (A,); never nan."""
    costs = (paid + weight * local[:, None]).astype(np.float32)
    # A weight of 0 does not make possible what is not.
    costs[np.isnan(costs)] = -np.inf
    return costs


def by_share(options: Parsed) -> bool:
    """Whether each position is decided on its own."""
    return bool(options["fb"] or options.values.get("fw-only"))


def decided(shares: Sequence[dict[int, float]]) -> list[int]:
    """The most probable label of each position."""
    return [max(share, key=share.__getitem__) for share in shares]


def shares_of(
    steps: Sequence[Step], options: Parsed, scores: Sequence[Singles] | None = None
) -> list[dict[int, float]]:
    """log10 of how probable each label is, position by position: over all paths with -fb, else over the best ones.

    `scores`: what `forward` gives for these options, if it is there already.
    """
    return [label_shares(joint, step.labels) for joint, step in zip(joints(steps, options, scores), steps, strict=True)]


def state_shares(steps: Sequence[Step], options: Parsed) -> list[Floats]:
    """log10 of how probable each state is, position by position."""
    return [joint - total_log10_p(joint) for joint in joints(steps, options)]


def joints(steps: Sequence[Step], options: Parsed, scores: Sequence[Singles] | None = None) -> list[Floats]:
    """log10 p of the ways through each state, position by position."""
    summed, alone = by_share(options), bool(options.values.get("fw-only"))
    before = scores if scores is not None and not alone else forward(steps, summed=summed)
    behind = [np.zeros_like(its) for its in before] if alone else backward(steps, summed=summed)
    return [joint_log10_p(a, b, summed=summed) for a, b in zip(before[1:], behind[1:], strict=True)]


class StepCache:
    """The steps of a text that were made before, by what leads to them: streams of frames repeat themselves."""

    def __init__(self, options: Parsed) -> None:
        # Maps of single positions do not repeat, and what is told of a step is told each time.
        self.used = not options["text-map"] and options["debug"] < 2
        self.kept: dict[tuple[int, bytes, bool], tuple[Step, Ints]] = {}

    def step(self, word: int, contexts: Ints, first: bool, make: Callable[[], tuple[Step, Ints]]) -> tuple[Step, Ints]:
        """The step of a word (by a number) behind contexts (S,), and the contexts of the states there."""
        if not self.used:
            return make()
        key = word, contexts.tobytes(), first
        if key not in self.kept:
            if len(self.kept) >= _MOST_KEPT:
                self.kept.clear()
            self.kept[key] = make()
        return self.kept[key]


def p_of(log10_p: float) -> float:
    """The number that log10_p is the logarithm of."""
    return math.exp(log10_p * LN10)
