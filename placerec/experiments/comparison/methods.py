"""The methods that are compared.

A method is added in COMPARED alone: how it is fitted and run, what it is made of, and what it needs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from placerec.arrays import Floats
from placerec.experiments.comparison.benchmark import (
    NORMALISED,
    PLAIN,
    RUNS,
    Benchmark,
    ChooseOptions,
    MakeStepper,
    MethodRun,
    StepFunction,
    timed,
)
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

# What a method gets of a frame.
WORDS, TWO_WORDS, DESCRIPTORS = "words", "words, two dictionaries", "descriptors"
SEVERAL_WORDS = "words, several dictionaries"


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


def _run_points(fit: Callable[[Benchmark], MakePointStepper], view: str, benchmark: Benchmark) -> MethodRun:
    """A method of descriptors, which learns from the labelled training frames as points of a view."""
    tests = [benchmark.encoded.points[view][i].astype(np.float64) for i in benchmark.tests]
    return timed(fit(benchmark), benchmark, tests)


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


def _of_descriptors(view: str) -> dict[str, ComparedMethod]:
    """The methods of descriptors, on the components of a view, which marks all but those of the view `plain`.

    A filter whose evidence has a weight, and that forgets (`evidence_weight`), is marked as tuned.
    """
    mark, tuned = ("", "@tuned") if view == PLAIN else (f"@{view}", f"@{view}-tuned")

    def method(fit: Callable[[Benchmark], MakePointStepper], package: str | None = "sklearn") -> ComparedMethod:
        return ComparedMethod(partial(_run_points, fit, view), DESCRIPTORS, package, view)

    def in_filter(
        name: str, fit: Callable[[Benchmark], FitPoints], package: str | None = "sklearn"
    ) -> dict[str, ComparedMethod]:
        return {
            f"{name}{mark}": method(lambda one: through_filter(one.points(view), fit(one)), package),
            f"{name}{tuned}": method(lambda one: evidence_weight.fit(one.points(view), fit(one)), package),
        }

    def machine(name: str, choose: ChooseOptions) -> dict[str, ComparedMethod]:
        return {
            f"{name}{mark}": method(lambda one: frame_by_frame(one.chosen(choose, view)(one.points(view)))),
            **in_filter(f"{name}-hmm", lambda one: partial(likelihoods, one.chosen(choose, view))),
        }

    return {
        **in_filter("torralba2003", lambda one: one.chosen(torralba2003.choose, view), None),
        **machine("ullah2008", ullah2008.choose),
        f"knn{mark}": method(lambda one: knn.fit(one.points(view))),
        **machine("logistic", logistic.choose),
        **machine("rbf-svm", rbf_svm.choose),
    }


# In the order of the table. The paper's transitions where a method has a filter, unless its source learns them, or it
# stands beside `hohmm`.
COMPARED: dict[str, ComparedMethod] = {
    HOHMM: ComparedMethod(_run_several, SEVERAL_WORDS),
    f"{HOHMM}-single": _words(HOHMM, "learned"),
    f"{HOHMM}-paper": _words(HOHMM),
    f"{HOHMM}-order1": ComparedMethod(_run_order1),
    **{name: _words(name, "learned" if name == "mtd" else "fixed") for name in METHODS if name != HOHMM},
    **{f"{name}@tuned": ComparedMethod(partial(_run_weighed, name)) for name, own in METHODS.items() if own.emissions},
    "pronobis2007": ComparedMethod(_run_cascade, TWO_WORDS),
    **_of_descriptors(PLAIN),
    **_of_descriptors(NORMALISED),
}
