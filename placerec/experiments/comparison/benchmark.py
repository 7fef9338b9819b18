"""Every method on the same test frames: encoded, fitted, run on-line one frame after the other, and timed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.experiments.comparison.views import PLAIN, SeenView
from placerec.experiments.cost import FrontEndCost, front_end_cost
from placerec.experiments.several import SeveralDictionaries
from placerec.experiments.store import WordsJob, key_of
from placerec.hohmm import Beliefs
from placerec.methods.descriptors import DescriptorTrainingSet, FitPoints
from placerec.model import ModelOptions, PlaceModels, load_model, train_model
from placerec.model.record import record_streams
from placerec.vision import Dictionary
from placerec.words import Selection, WordStream, place_steps, sentences_per_place
from placerec.words.tokenize import tokens_of

# Each method is run so often over the test frames; the fastest run is told.
RUNS = 3
# A frame's word (or two, or components) to its belief float64 (C,); and what begins a sequence.
StepFunction = Callable[[Any], Floats]
MakeStepper = Callable[[], StepFunction]
# Chooses the options of a method of descriptors by its training and a seed: what then fits it to a training set.
ChooseOptions = Callable[..., FitPoints]


@dataclass(frozen=True)
class EncodedSequences:
    """The words of all sequences through one dictionary, those of the training first."""

    dictionary: Dictionary
    streams: tuple[WordStream, ...] = field(repr=False)
    cost: FrontEndCost

    def units(self, sequence: int) -> Ints:
        """The words of a sequence as numbers of units, int64 (T,)."""
        number = {word: unit for unit, word in enumerate(self.dictionary.vocabulary)}
        return np.array([number[word] for word in self.streams[sequence].words], np.int64)


def encode(job: WordsJob, dictionary: Dictionary) -> EncodedSequences:
    """Give all frames of a job their words; raises VisionError or SourceError for images."""
    found = [one.load() for one in (*job.train, *job.test)]
    streams = tuple(stream for one in found for stream in tokens_of(one, dictionary))
    return EncodedSequences(dictionary, streams, front_end_cost(job, found[len(job.train) :], dictionary))


@dataclass(frozen=True)
class Benchmark:
    """The sequences through one dictionary, the first `training` of them to learn from, and the models of these.

    `views`: by name, what methods of descriptors see of the sequences. `second`: the sequences through a second
    dictionary, where a method asks for it, and `several`: what `learn` makes of them, and `several_cost`: what a
    frame's words cost there. `seed`: of what a method draws.
    """

    encoded: EncodedSequences
    training: int
    models: PlaceModels
    seed: int
    views: Mapping[str, SeenView]
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
        points = np.concatenate(self.views[view].points[: self.training]).astype(np.float64)
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
        """A digest of all that beliefs depend on, but for the method, other views and other dictionaries."""
        parts: list[object] = [self.training, self.seed, self.encoded.dictionary.fingerprint]
        for stream, points in zip(self.encoded.streams, self.views[PLAIN].points, strict=True):
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


def timed(start: MakeStepper, benchmark: Benchmark, inputs: Sequence[Any]) -> MethodRun:
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
