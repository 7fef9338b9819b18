"""The methods that are compared, and their names.

A method is added in one of two tables: OF_WORDS, or OF_DESCRIPTORS, whose methods run on any view (`comparison.views`).
A name of theirs is `NAME`, `NAME@VIEW`, and where there is a filter whose evidence gets a weight and that forgets
(`methods.evidence_weight`) `NAME@tuned`, `NAME@VIEW-tuned`: `rbf-svm`, `knn@lbp:pn`, `rbf-svm-hmm@views-tuned`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from placerec.arrays import Floats
from placerec.errors import EvaluationError, VisionError
from placerec.experiments.comparison.benchmark import (
    RUNS,
    Benchmark,
    ChooseOptions,
    MakeStepper,
    MethodRun,
    StepFunction,
    timed,
)
from placerec.experiments.comparison.views import ALL, NORMALISED, PLAIN
from placerec.hohmm import Recognizer, SequenceDecoder, learned_transition
from placerec.hohmm.weights import shares_of
from placerec.lm.backoff import unite_models
from placerec.methods import (
    HOHMM,
    METHODS,
    evidence_weight,
    knn,
    logistic,
    make_decoder,
    pronobis2007,
    rbf_svm,
    torralba2003,
    ullah2008,
)
from placerec.methods.descriptors import FitPoints, MakePointStepper, through_filter
from placerec.methods.margins import frame_by_frame, likelihoods
from placerec.methods.tables import PairEmissions
from placerec.model import Decoding, transition_of
from placerec.model.decoding import TransitionName
from placerec.vision.options import View

# What a method gets of a frame.
WORDS, SEVERAL_WORDS = "words", "words, several dictionaries"
TWO_WORDS, DESCRIPTORS = "words, two dictionaries", "descriptors"
# How a method of descriptors is fitted to the training frames as points of a view.
FitView = Callable[[Benchmark, str], MakePointStepper]


@dataclass(frozen=True)
class ComparedMethod:
    """How a method is fitted and run, what it gets of each frame, in which view, and a package that it needs."""

    run: Callable[[Benchmark], MethodRun]
    kind: str = WORDS
    package: str | None = None
    view: str = PLAIN


def _words(name: str, transition: TransitionName = "fixed") -> ComparedMethod:
    """A method of `placerec decode`."""
    options = Decoding(transition=transition)
    return ComparedMethod(lambda benchmark: _decoded(make_decoder(name, benchmark.models, options=options), benchmark))


def _run_weighed(name: str, benchmark: Benchmark) -> MethodRun:
    """A method of `placerec decode` that has a filter, whose evidence has a weight (`evidence_weight`)."""
    emissions, streams = METHODS[name].emissions, benchmark.encoded.streams[: benchmark.training]
    if emissions is None:
        raise ValueError(f"{name} has no filter of ours")
    found = evidence_weight.best_word_weights(streams, benchmark.encoded.dictionary.vocabulary, emissions)
    decoder = make_decoder(
        name, benchmark.models, options=Decoding(transition="learned", alpha=found.alpha, memory=0.0)
    )
    shares = shares_of(np.bincount(benchmark.points(PLAIN).truth, minlength=len(benchmark.places)))
    transition = learned_transition(benchmark.points(PLAIN).steps, found.memory, shares)
    return _decoded(decoder.changed(transition=transition), benchmark)


def _run_order1(benchmark: Benchmark) -> MethodRun:
    """`hohmm` without the words before: the unigrams, smoothing and transitions of the models."""
    models = benchmark.models
    union, words = unite_models(list(models.models.values())), next(iter(models.models.values())).words
    log10_p = np.concatenate([union.score([word]) for word in words])
    emissions = PairEmissions(words, 1, lambda ids, _: log10_p[ids])
    transition = transition_of(models, Decoding(transition="learned"))
    return _decoded(Recognizer(models.models, transition=transition, emissions=emissions), benchmark)


def _decoded(decoder: SequenceDecoder, benchmark: Benchmark) -> MethodRun:
    return timed(_started(decoder), benchmark, [benchmark.encoded.streams[i].words for i in benchmark.tests])


def _started(decoder: SequenceDecoder) -> MakeStepper:
    def start() -> StepFunction:
        decoder.reset()
        return lambda words: decoder.update(words).probability

    return start


def _run_several(benchmark: Benchmark) -> MethodRun:
    """The words of all dictionaries, with what training learned; the cost of other descriptors and words is added."""
    several = benchmark.several
    if several is None or benchmark.several_cost is None:
        raise ValueError("hohmm needs several dictionaries")
    words = [
        list(zip(*(stream.in_dictionary(name).words for name in stream.dictionaries), strict=True))
        for stream in several.tests
    ]
    run = timed(_started(make_decoder(HOHMM, several.models)), benchmark, words)
    one, all_ = benchmark.encoded.cost, benchmark.several_cost
    more = max(all_.word - one.word, 0.0)
    if not math.isnan(one.descriptor):
        more += max(all_.descriptor - one.descriptor, 0.0)
    return MethodRun(run.beliefs, run.microseconds + more)


def _run_points(fit: FitView, view: str, benchmark: Benchmark) -> MethodRun:
    """A method of descriptors on the points of a view; what describing a frame takes more for it is added."""
    seen = benchmark.views[view]
    tests = [seen.points[i].astype(np.float64) for i in benchmark.tests]
    run = timed(fit(benchmark, view), benchmark, tests)
    return MethodRun(run.beliefs, run.microseconds + seen.microseconds)


def _run_cascade(benchmark: Benchmark) -> MethodRun:
    """The words of both dictionaries; what a second word costs is added for the frames that ask for it."""
    if benchmark.second is None:
        raise ValueError("the cascade needs a second dictionary")
    both, training, known = (benchmark.encoded, benchmark.second), range(benchmark.training), set(benchmark.places)
    labelled = np.array([place in known for i in training for place in benchmark.encoded.streams[i].places], bool)
    units = [np.concatenate([one.units(i) for i in training])[labelled] for one in both]
    words = [len(one.dictionary.vocabulary) for one in both]
    points = benchmark.points(PLAIN)
    answer = pronobis2007.fit(units, points.truth, points.sequences, words, len(benchmark.places))
    asked = 0

    def step(pair: tuple[int, int]) -> Floats:
        nonlocal asked
        belief, consulted = answer(pair[0], lambda: pair[1])
        asked += consulted
        return belief

    pairs = [list(zip(*(one.units(i).tolist() for one in both), strict=True)) for i in benchmark.tests]
    run = timed(lambda: step, benchmark, pairs)
    share = asked / (RUNS * sum(map(len, pairs)))
    cost = benchmark.second.cost
    return MethodRun(run.beliefs, run.microseconds + share * (cost.descriptor + cost.word), share)


@dataclass(frozen=True)
class _OfDescriptors:
    """A method of descriptors: how it is fitted, with a weight of its evidence if it has a filter, and its package."""

    fit: FitView
    tuned: FitView | None = None
    package: str | None = "sklearn"


def _in_filter(fit: Callable[[Benchmark, str], FitPoints], package: str | None = "sklearn") -> _OfDescriptors:
    """The filter over the likelihoods that `fit` says how to fit."""
    return _OfDescriptors(
        lambda one, view: through_filter(one.points(view), fit(one, view)),
        lambda one, view: evidence_weight.fit(one.points(view), fit(one, view)),
        package,
    )


def _machine(name: str, choose: ChooseOptions) -> dict[str, _OfDescriptors]:
    """A machine that gives margins, frame by frame and through the filter."""
    return {
        name: _OfDescriptors(lambda one, view: frame_by_frame(one.chosen(choose, view)(one.points(view)))),
        f"{name}-hmm": _in_filter(lambda one, view: partial(likelihoods, one.chosen(choose, view))),
    }


# Both in the order of the table. The paper's transitions where a method has a filter, unless its source learns them, or
# it stands beside `hohmm`.
OF_WORDS: dict[str, ComparedMethod] = {
    HOHMM: ComparedMethod(_run_several, SEVERAL_WORDS),
    f"{HOHMM}-single": _words(HOHMM, "learned"),
    f"{HOHMM}-paper": _words(HOHMM),
    f"{HOHMM}-order1": ComparedMethod(_run_order1),
    **{name: _words(name, "learned" if name == "mtd" else "fixed") for name in METHODS if name != HOHMM},
    **{f"{name}@tuned": ComparedMethod(partial(_run_weighed, name)) for name, own in METHODS.items() if own.emissions},
    "pronobis2007": ComparedMethod(_run_cascade, TWO_WORDS),
}
OF_DESCRIPTORS: dict[str, _OfDescriptors] = {
    "torralba2003": _in_filter(lambda one, view: one.chosen(torralba2003.choose, view), None),
    **_machine("ullah2008", ullah2008.choose),
    "knn": _OfDescriptors(lambda one, view: knn.fit(one.points(view))),
    **_machine("logistic", logistic.choose),
    **_machine("rbf-svm", rbf_svm.choose),
}


def _on(view: str) -> list[str]:
    """The names of all methods of descriptors on a view, each that has a filter also with its evidence weighed."""
    seen = "" if view == PLAIN else view
    forms = [(name, tuned) for name, own in OF_DESCRIPTORS.items() for tuned in ("", "tuned")[: 1 + bool(own.tuned)]]
    return ["@".join(filter(None, (name, "-".join(filter(None, (seen, tuned)))))) for name, tuned in forms]


# What is compared where no methods are named: linear machines, which cost little, also on all that `hohmm` sees.
DEFAULT: tuple[str, ...] = (
    *(*OF_WORDS, *_on(PLAIN), *_on(NORMALISED)),
    *(f"{name}{mark}" for name in ("ullah2008", "logistic") for mark in (f"@{ALL}", f"-hmm@{ALL}-tuned")),
)
# What a message says of the names.
CHOICES = (
    f"choose from {', '.join((*OF_WORDS, *OF_DESCRIPTORS))}; all from {next(iter(OF_DESCRIPTORS))} on also on a view: "
    f"knn@lbp:pn, rbf-svm-hmm@{ALL}-tuned"
)


def method_of(name: str) -> ComparedMethod:
    """The method of a name; EvaluationError for an unknown one, and for a view that cannot be."""
    if name in OF_WORDS:
        return OF_WORDS[name]
    base, at, mark = name.partition("@")
    view, _, last = mark.rpartition("-")
    own, tuned = OF_DESCRIPTORS.get(base), last == "tuned"
    fit = None if own is None else own.tuned if tuned else own.fit
    if own is None or fit is None or (at and not mark):
        raise EvaluationError(f"no method is called {name!r}; {CHOICES}")
    view = (view if tuned else mark) or PLAIN
    try:
        if view != ALL:
            View.parse(view)
    except VisionError as error:
        raise EvaluationError(f"{name}: {error}; {ALL} are all of {HOHMM} together") from error
    return ComparedMethod(partial(_run_points, fit, view), DESCRIPTORS, own.package, view)
