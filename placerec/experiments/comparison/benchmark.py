"""Every method on the same test frames: encoded, fitted, run on-line one frame after the other, and timed.

A method is added in COMPARED alone: how it is fitted and run, what it is made of, and what it needs.
"""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import EvaluationError, VisionError
from placerec.experiments.cost import FrontEndCost, front_end_cost
from placerec.experiments.several import SeveralDictionaries
from placerec.experiments.store import WordsJob, key_of
from placerec.frames.table import Labels
from placerec.hohmm import Beliefs, Recognizer, SequenceDecoder, learned_transition
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
from placerec.methods.descriptors import DescriptorTrainingSet, FitPoints, MakePointStepper, through_filter
from placerec.methods.margins import frame_by_frame, likelihoods
from placerec.methods.tables import PairEmissions
from placerec.model import Decoding, ModelOptions, PlaceModels, load_model, train_model, transition_of
from placerec.model.decoding import TransitionName
from placerec.model.record import record_streams
from placerec.vision import Dictionary
from placerec.vision.chunks import spooled
from placerec.vision.options import PROJECTIONS
from placerec.vision.pca import project
from placerec.vision.views import place_normalised, place_numbers
from placerec.words import Selection, WordStream, place_steps, sentences_per_place
from placerec.words.tokenize import tokens_of

# Each method is run so often over the test frames; the fastest run is told.
RUNS = 3
# What a method gets of a frame.
WORDS, TWO_WORDS, DESCRIPTORS = "words", "words, two dictionaries", "descriptors"
SEVERAL_WORDS = "words, several dictionaries"
# A frame's word (or two, or components) to its belief float64 (C,); and what begins a sequence.
StepFunction = Callable[[Any], Floats]
MakeStepper = Callable[[], StepFunction]
# Chooses the options of a method of descriptors by its training and a seed: what then fits it to a training set.
ChooseOptions = Callable[..., FitPoints]
# The views of `vision.views` that such methods are compared on.
PLAIN, NORMALISED = PROJECTIONS[:2]


@dataclass(frozen=True)
class EncodedSequences:
    """All sequences through one dictionary, those of the training first.

    `streams`: the words of each sequence; `points`: by projection the components float32 (T, k) of its T frames.
    """

    dictionary: Dictionary
    streams: tuple[WordStream, ...] = field(repr=False)
    points: Mapping[str, tuple[Singles, ...]] = field(repr=False)
    cost: FrontEndCost

    def units(self, sequence: int) -> Ints:
        """The words of a sequence as numbers of units, int64 (T,)."""
        number = {word: unit for unit, word in enumerate(self.dictionary.vocabulary)}
        return np.array([number[word] for word in self.streams[sequence].words], np.int64)


def encode(job: WordsJob, dictionary: Dictionary, views: Container[str]) -> EncodedSequences:
    """Give all frames of a job their words and their components: PLAIN, and of `views`.

    Raises VisionError or SourceError for images, and EvaluationError for labels that give no place-normalised view.
    """
    training = len(job.train)
    found = [one.load() for one in (*job.train, *job.test)]
    streams = tuple(stream for one in found for stream in tokens_of(one, dictionary))
    points = {PLAIN: tuple(project(one.values, dictionary.pca) for one in found)}
    if NORMALISED in views:
        places = Labels.concat([one.table.places for one in found[:training]])
        try:
            with spooled(np.concatenate(points[PLAIN][:training])) as codes:
                pca = place_normalised(dictionary.pca, codes, place_numbers(places, codes.rows))
        except VisionError as error:
            raise EvaluationError(f"no view for the methods @{NORMALISED}: {error}; leave them out") from error
        points[NORMALISED] = tuple(project(one.values, pca) for one in found)
    return EncodedSequences(dictionary, streams, points, front_end_cost(job, found[training:], dictionary))


@dataclass(frozen=True)
class Benchmark:
    """The sequences through one dictionary, the first `training` of them to learn from, and the models of these.

    `second`: the sequences through a second dictionary, where a method asks for it, and `several`: what `learn` makes
    of them, and `several_cost`: what a frame's words cost there. `seed`: of what a method draws.
    """

    encoded: EncodedSequences
    training: int
    models: PlaceModels
    seed: int
    second: EncodedSequences | None = None
    several: SeveralDictionaries | None = None
    several_cost: FrontEndCost | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the training."""
        return tuple(self.models.models)

    @property
    def tests(self) -> range:
        """The numbers of the test sequences."""
        return range(self.training, len(self.encoded.streams))

    def points(self, view: str) -> DescriptorTrainingSet:
        """The labelled training frames as points of a view."""
        streams = self.encoded.streams[: self.training]
        truth = np.concatenate([stream.table.places.codes(self.places) for stream in streams])
        sequences = np.repeat(np.arange(len(streams)), [len(stream) for stream in streams])
        points = np.concatenate(self.encoded.points[view][: self.training]).astype(np.float64)
        steps = np.sum([place_steps(stream, self.places) for stream in streams], axis=0)
        known = truth >= 0
        return DescriptorTrainingSet(points[known], truth[known], sequences[known], self.places, steps)

    def chosen(self, choose: ChooseOptions, view: str) -> FitPoints:
        """What fits a method with the options that the training asks for, which are chosen once for all its forms."""
        if (choose, view) not in self._chosen:
            self._chosen[choose, view] = choose(self.points(view), seed=self.seed)
        return self._chosen[choose, view]

    @cached_property
    def _chosen(self) -> dict[tuple[ChooseOptions, str], FitPoints]:
        return {}

    @cached_property
    def key(self) -> str:
        """A digest of all that beliefs depend on, but for the method and the second dictionary."""
        parts: list[object] = [self.training, self.seed, self.encoded.dictionary.fingerprint]
        for stream, points in zip(self.encoded.streams, self.encoded.points[PLAIN], strict=True):
            parts += [stream.name, stream.frames, stream.places, stream.words, stream.times, points]
        return key_of(*parts)


@dataclass(frozen=True)
class MethodRun:
    """Beliefs on the test sequences; `microseconds` a frame, and the share that asked the second cue, if there is one.

    The time is that of the method alone, from the word (or the descriptor's components) to the belief, the mean over
    all test frames one after the other; a second cue comes with what its frames take up to their second word.
    """

    beliefs: list[Beliefs] = field(repr=False)
    microseconds: float
    consulted: float | None = None


@dataclass(frozen=True)
class ComparedMethod:
    """How a method is fitted and run, what it gets of each frame, in which view, and a package that it needs."""

    run: Callable[[Benchmark], MethodRun]
    kind: str = WORDS
    package: str | None = None
    view: str = PLAIN


def train_models(encoded: EncodedSequences, training: int, cache: Path) -> PlaceModels:
    """The n-gram models of the first `training` sequences, with the default options, in a MODEL/ folder in `cache`."""
    streams, dictionary = encoded.streams[:training], encoded.dictionary
    content = [(one.name, one.places, one.words, one.times, one.distances) for one in streams]
    path = cache / "models" / key_of(dictionary.fingerprint, *chain(*content))
    if not path.exists():
        sentences = [sentences_per_place([stream], Selection()) for stream in streams]
        record = record_streams(zip(streams, sentences, strict=True), dictionary.fingerprint)
        together = sentences_per_place(streams, Selection())
        train_model(together, dictionary.vocabulary, path, options=ModelOptions(), record=record)
    return load_model(path)


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
    return _timed(_started(decoder), benchmark, [benchmark.encoded.streams[i].words for i in benchmark.tests])


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
    run = _timed(_started(make_decoder(HOHMM, several.models)), benchmark, words)
    one, all_ = benchmark.encoded.cost, benchmark.several_cost
    more = max(all_.word - one.word, 0.0)
    if not math.isnan(one.descriptor):
        more += max(all_.descriptor - one.descriptor, 0.0)
    return MethodRun(run.beliefs, run.microseconds + more)


def _run_points(fit: Callable[[Benchmark], MakePointStepper], view: str, benchmark: Benchmark) -> MethodRun:
    """A method of descriptors, which learns from the labelled training frames as points of a view."""
    tests = [benchmark.encoded.points[view][i].astype(np.float64) for i in benchmark.tests]
    return _timed(fit(benchmark), benchmark, tests)


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
    run = _timed(lambda: step, benchmark, pairs)
    share = asked / (RUNS * sum(map(len, pairs)))
    cost = benchmark.second.cost
    return MethodRun(run.beliefs, run.microseconds + share * (cost.descriptor + cost.word), share)


def _timed(start: MakeStepper, benchmark: Benchmark, inputs: Sequence[Any]) -> MethodRun:
    """The beliefs over each sequence of inputs, and the time of the fastest of some runs."""
    found: list[list[Floats]] = []
    fastest = np.inf
    for _ in range(RUNS):
        found, spent = [], 0.0
        for sequence in inputs:
            step = start()
            started = perf_counter()
            rows = [step(one) for one in sequence]
            spent += perf_counter() - started
            found.append(rows)
        fastest = min(fastest, spent)
    streams = [benchmark.encoded.streams[i] for i in benchmark.tests]
    beliefs = [Beliefs.of(one, benchmark.places, np.array(rows)) for one, rows in zip(streams, found, strict=True)]
    return MethodRun(beliefs, 1e6 * fastest / sum(map(len, inputs)))


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
