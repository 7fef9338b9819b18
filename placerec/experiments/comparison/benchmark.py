"""Every method on the same test frames: fitted, run on-line one frame after the other, and timed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.experiments.comparison.material import Look, digest
from placerec.hohmm import Beliefs, Recognizer
from placerec.lm.union import unite_models
from placerec.methods import HOHMM, METHODS, knn, make_decoder, pronobis2007, torralba2003, ullah2008
from placerec.methods.descriptors import DescriptorTrainingSet, MakePointStepper
from placerec.model import Decoder, Decoding, Options, PlaceModels, load_model, train_model, transition_of
from placerec.model.record import record_streams
from placerec.version import __version__
from placerec.words import Selection, place_steps, sentences_per_place

FIXED = f"{HOHMM}-fixed"
# What `hohmm` is without the words before: its models' unigrams, its smoothing and transitions.
MEMORYLESS = f"{HOHMM}-order1"
CASCADE = "pronobis2007"
# The paper's transitions where a system has a filter, unless its source learns them, or it stands beside `hohmm`.
LEARNED = (HOHMM, MEMORYLESS, "mtd")
# Each method is run so often over the test frames; the fastest run is told.
RUNS = 3
Floats = NDArray[np.float64]
Step = Callable[[Any], Floats]
Follow = Callable[[], Step]

POINT_METHODS: dict[str, Callable[[DescriptorTrainingSet, int], MakePointStepper]] = {
    "torralba2003": lambda training, seed: torralba2003.fit(training, seed=seed),
    "ullah2008": lambda training, seed: ullah2008.fit(training, seed=seed),
    "ullah2008-hmm": lambda training, seed: ullah2008.fit_filtered(training, seed=seed),
    "knn": lambda training, seed: knn.fit(training),
}
# In the order of the table.
ALL = (HOHMM, FIXED, MEMORYLESS, *(name for name in METHODS if name != HOHMM), CASCADE, *POINT_METHODS)


@dataclass(frozen=True)
class Contest:
    """The sequences through one dictionary, the first `training` of them to learn from, and the models of these.

    `again`: the same through the second dictionary, where a method asks for it.
    """

    look: Look
    training: int
    models: PlaceModels
    seed: int
    again: Look | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the training."""
        return tuple(self.models.models)

    @property
    def tests(self) -> range:
        """The numbers of the test sequences."""
        return range(self.training, len(self.look.streams))

    @cached_property
    def key(self) -> str:
        """A digest of all that beliefs depend on, but for the method."""
        parts: list[object] = [self.training, self.seed, self.look.dictionary.fingerprint]
        for stream, points in zip(self.look.streams, self.look.points, strict=True):
            parts += [stream.name, stream.frames, stream.places, stream.words, stream.times, points]
        return digest(*parts)


@dataclass(frozen=True)
class Run:
    """Beliefs on the test sequences; `microseconds` a frame, and the share that asked the second cue, if there is one.

    The time is that of the method alone, from the word (or the descriptor's components) to the belief, the mean over
    all test frames one after the other; a second cue comes with what its frames take up to their second word.
    """

    beliefs: list[Beliefs] = field(repr=False)
    microseconds: float
    consulted: float | None = None


def train_models(look: Look, training: int, folder: Path) -> PlaceModels:
    """The n-gram models of the training sequences, with the default options, in a MODEL/ folder."""
    streams = look.streams[:training]
    content = [part for s in streams for part in (s.name, s.places, s.words, s.times, s.distances)]
    path = folder / f"model-{digest(look.dictionary.fingerprint, __version__, *content)}"
    if not path.exists():
        sentences = [sentences_per_place([stream], Selection()) for stream in streams]
        record = record_streams(zip(streams, sentences, strict=True), look.dictionary.fingerprint)
        train_model(
            sentences_per_place(streams, Selection()),
            look.dictionary.vocabulary,
            path,
            options=Options(),
            record=record,
        )
    return load_model(path)


def run_method(name: str, contest: Contest) -> Run:
    """Fit one of the methods `ALL` and follow every test sequence with it."""
    if name == CASCADE:
        return _run_cascade(contest)
    if name in POINT_METHODS:
        follow: Follow = POINT_METHODS[name](_descriptor_training_set(contest), contest.seed)
        return _timed(follow, contest, [contest.look.points[i].astype(np.float64) for i in contest.tests])
    return _timed(_decoder(name, contest.models), contest, [contest.look.streams[i].words for i in contest.tests])


class _Unigrams:
    """Emissions of the same models for words without those before them."""

    def __init__(self, models: PlaceModels) -> None:
        self._emissions = unite_models(list(models.models.values()))

    def score(self, words: Sequence[str]) -> Floats:
        """As `Emissions` has it."""
        return np.concatenate([self._emissions.score([word]) for word in words])

    def follow(self) -> Callable[[str], Sequence[float]]:
        """As `Emissions` has it."""
        return lambda word: self._emissions.follow()(word)


def _decoder(name: str, models: PlaceModels) -> Follow:
    options = Decoding(transition="learned" if name in LEARNED else "fixed")
    decoder: Decoder
    if name == MEMORYLESS:
        transition = transition_of(models, options)
        decoder = Recognizer(models.models, transition=transition, emissions=_Unigrams(models))
    else:
        decoder = make_decoder(HOHMM if name == FIXED else name, models, options=options)

    def follow() -> Step:
        decoder.reset()
        return lambda word: decoder.update(word).probability

    return follow


def _descriptor_training_set(contest: Contest) -> DescriptorTrainingSet:
    """The labelled training frames as points."""
    places = contest.places
    streams = contest.look.streams[: contest.training]
    truth = np.concatenate([stream.table.places.codes(places) for stream in streams])
    sequences = np.repeat(np.arange(len(streams)), [len(stream) for stream in streams])
    points = np.concatenate(contest.look.points[: contest.training]).astype(np.float64)
    steps = np.sum([place_steps(stream, places) for stream in streams], axis=0)
    labelled = truth >= 0
    return DescriptorTrainingSet(points[labelled], truth[labelled], sequences[labelled], places, steps)


def _run_cascade(contest: Contest) -> Run:
    """The words of both dictionaries; what a second word costs is added for the frames that ask for it."""
    if contest.again is None:
        raise ValueError("the cascade needs a second dictionary")
    looks = (contest.look, contest.again)
    training = range(contest.training)
    truth = np.concatenate([contest.look.streams[i].table.places.codes(contest.places) for i in training])
    sequences = np.repeat(training, [len(contest.look.streams[i]) for i in training])
    units = [np.concatenate([one.units(i) for i in training])[truth >= 0] for one in looks]
    words = [len(one.dictionary.vocabulary) for one in looks]
    answer = pronobis2007.fit(units, truth[truth >= 0], sequences[truth >= 0], words, len(contest.places))
    asked = 0

    def follow() -> Step:
        def step(pair: tuple[int, int]) -> Floats:
            nonlocal asked
            belief, consulted = answer(pair[0], lambda: pair[1])
            asked += consulted
            return belief

        return step

    pairs = [list(zip(*(one.units(i).tolist() for one in looks), strict=True)) for i in contest.tests]
    run = _timed(follow, contest, pairs)
    share = asked / (RUNS * sum(map(len, pairs)))
    second = contest.again.front
    return Run(run.beliefs, run.microseconds + share * (second.descriptor + second.word), share)


def _timed(follow: Follow, contest: Contest, inputs: Sequence[Any]) -> Run:
    """The beliefs over each sequence of inputs, and the time of the fastest of some runs."""
    found: list[list[Floats]] = []
    fastest = np.inf
    for _ in range(RUNS):
        found, spent = [], 0.0
        for sequence in inputs:
            step = follow()
            started = perf_counter()
            rows = [step(one) for one in sequence]
            spent += perf_counter() - started
            found.append(rows)
        fastest = min(fastest, spent)
    streams = [contest.look.streams[i] for i in contest.tests]
    beliefs = [Beliefs.of(stream, contest.places, np.array(rows)) for stream, rows in zip(streams, found, strict=True)]
    return Run(beliefs, 1e6 * fastest / sum(map(len, inputs)))
