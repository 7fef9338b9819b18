"""The recognizer: the filter over the language models of places, on-line or over a whole sequence."""

import logging
import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from operator import add
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError
from placerec.hohmm import unknown as new_place
from placerec.hohmm.beliefs import Beliefs
from placerec.hohmm.calibration import Calibration
from placerec.hohmm.decoder import Posterior, SequenceDecoder, TakeIn, warn_of_unlisted
from placerec.hohmm.evidence import DictionaryModels, Emissions, Evidence, common_words, distances_at, evidence_in
from placerec.hohmm.explain import WINDOW, Decision, TakenIn, explain_last, explain_part
from placerec.hohmm.filter import OnlineFilter
from placerec.hohmm.posterior import most_probable_path, posterior, unknown_posterior
from placerec.hohmm.transitions import Transition, fixed_transition
from placerec.hohmm.unknown import UnknownModel
from placerec.lm import BackoffModel
from placerec.lm.backoff import unite_models
from placerec.lm.logs import LN10
from placerec.words import Selection, WordStream
from placerec.words.stream import FIRST

if TYPE_CHECKING:
    from placerec.vision import Dictionary, DictionarySet

log = logging.getLogger(__name__)


class Recognizer(SequenceDecoder):
    """The HOHMM filter over the language models of places, on-line and in constant memory.

    `models`: one BackoffModel per place, all of the same words. `further`: such models of further dictionaries, by the
    dictionary's name. `alpha`: the exponent of all words' probabilities, which weighs them against the prediction.
    `selection` is that of their training. `transition`: how the place changes (default: the paper's). `dictionary`
    turns images into words, for `update` with images. `max_gap`: more seconds than this between two frames begin a new
    sequence. `emissions`: what gives the words' probabilities, in place of the models; for several dictionaries a
    sequence, in their order. `calibration`: applied to the beliefs in places. `unknown`: what a place that is none of
    them is weighed with, for several dictionaries a sequence; None: nobody asks. `explain`: keep the models and the
    last words, so that `explain` can tell what decided. Raises ModelError if the models of a dictionary do not list the
    same words or are of other places, two dictionaries have a word in common, or the transitions are between more or
    fewer places.
    """

    _SETTINGS = ("selection", "transition", "dictionary", "max_gap", "emissions", "alpha", "calibration", "unknown")
    _NEEDING = "transitions per second and the largest gap need"

    def __init__(
        self,
        models: Mapping[str, BackoffModel],
        *,
        further: Mapping[str, Mapping[str, BackoffModel]] = MappingProxyType({}),
        alpha: float = 1.0,
        selection: Selection = Selection(),
        transition: Transition | None = None,
        dictionary: "Dictionary | DictionarySet | None" = None,
        max_gap: float | None = None,
        emissions: Emissions | Sequence[Emissions] | None = None,
        calibration: Calibration | None = None,
        unknown: UnknownModel | Sequence[UnknownModel] | None = None,
        explain: bool = False,
    ) -> None:
        if not models:
            raise ModelError("a recognizer needs the model of at least one place")
        self.transition: Final = transition or fixed_transition(len(models))
        every = {FIRST: models, **further}
        for name, others in further.items():
            if tuple(others) != tuple(models):
                raise ModelError(f"the models of the dictionary {name!r} are of other places; train them together")
        united = [unite_models(list(own.values())) for own in every.values()] if emissions is None else []
        self.emissions: Final = (united if further else united[0]) if emissions is None else emissions
        self.alpha: Final = alpha
        self.calibration: Final = calibration
        self.unknown: Final = unknown
        self._models = every if explain else None
        words = {name: common_words(own) for name, own in every.items()}
        super().__init__(models, words, selection=selection, dictionary=dictionary, max_gap=max_gap)

    def _settings(self) -> str:
        weight = "" if self.alpha == 1 else f"alpha {self.alpha:g}, "
        return f"{weight}transitions per {self._per}, {super()._settings()}"

    def _restart(self, per: str = "") -> None:
        C = len(self.places)
        if len(self.transition.matrix) != C:
            raise ModelError(f"transitions between {len(self.transition.matrix)} places for {C} models")
        if not 0 < self.alpha < math.inf:
            raise ModelError(f"alpha {self.alpha:g} is no exponent above 0 for the probabilities of words")
        emissions = self.emissions if isinstance(self.emissions, Sequence) else [self.emissions]
        self._dictionaries = [
            DictionaryModels(name, own, words)
            for own, (name, words) in zip(emissions, self._vocabularies.items(), strict=True)
        ]
        asked = () if self.unknown is None else self.unknown
        self._unknown_models = [asked] if isinstance(asked, UnknownModel) else [*asked]
        self._filter = OnlineFilter(self.transition, [1 / C] * C)
        self._chain = OnlineFilter(new_place.CHAIN, new_place.prior(C))
        super()._restart(self.transition.per)

    def _begin(self) -> tuple[Posterior, TakeIn]:
        self._filter.reset()
        self._chain.reset()
        # Of a dictionary whose word is not selected, as in `Evidence.own`.
        self._silent = [math.nan] * len(self.places)
        self._scores = [one.emissions.follow() for one in self._dictionaries]
        self._taken_in: deque[TakenIn] = deque(maxlen=WINDOW)
        return self._posterior(True), self._take_in

    def _take_in(
        self, words: Sequence[str | None], steps: float | None, distances: Sequence[float | None]
    ) -> Posterior:
        if steps is not None:
            self._filter.predict(steps)
        own = [self._silent if word is None else score(word) for word, score in zip(words, self._scores, strict=True)]
        log10_likelihoods = self._together(own)
        news = None
        if self._unknown_models:
            news = self._weigh_unknown(own, steps, distances)
        before = self._filter.belief() if self._models else None
        posterior = self._posterior(self._filter.condition_on(log10_likelihoods))
        if before is not None:
            after = self._filter.belief()
            frame, time = self._now.frame - 1, self._now.time
            self._taken_in.append(TakenIn(frame, time, tuple(words), steps or 0.0, np.array(own), before, after, news))
        return posterior

    def _together(self, own: Sequence[Sequence[float]]) -> Sequence[float]:
        """What the words of a frame count together, log10 (C): the sums of `Evidence.log10_likelihoods`."""
        alpha = self.alpha
        if len(own) == 1:
            return own[0] if alpha == 1 else [alpha * p for p in own[0]]
        total = [0.0] * len(self.places)
        for row in own:
            # nan is not equal to itself.
            if row[0] == row[0]:
                total = list(map(add, total, row))
        return [alpha * p for p in total]

    def _posterior(self, possible: bool) -> Posterior:
        probability = self._filter.belief()
        if self.calibration is not None:
            probability = self.calibration.apply(probability)
        unknown = None if self.unknown is None else math.exp(self._chain.log_belief[0])
        return probability, unknown, possible

    def _weigh_unknown(
        self, own: Sequence[Sequence[float]], steps: float | None, distances: Sequence[float | None]
    ) -> Floats:
        """Take in a frame as evidence for a place that is unknown; the filter is at its prediction.

        What the words say of that, log10, and its probability before and after, float64 (3,).
        """
        if steps is not None:
            self._chain.predict(steps)
        far = np.array([[math.nan if distance is None else distance] for distance in distances])
        predicted = self._filter.belief()[None]
        (ratio,) = new_place.evidence_of_all(self._unknown_models, np.array(own)[:, None], predicted, far).tolist()
        before = self._chain.log_belief[0]
        self._chain.condition_on([ratio / LN10, 0.0])
        return np.array([ratio / LN10, math.exp(before), math.exp(self._chain.log_belief[0])])

    def explain(self) -> Decision:
        """What decided after the last selected word, as plain data: a line of NAME.explain.jsonl (docs/files.md).

        `frame` is the number of the frame since the sequence began, from 0. Raises ModelError before the first selected
        word, and for a recognizer that was not made to explain.
        """
        if self._models is None:
            raise ModelError(
                "this recognizer keeps nothing to explain with; make it with explain=True, or load it with "
                "load_recognizer(..., options=Decoding(explain=True))"
            )
        if not self._taken_in:
            raise ModelError("no word was selected yet, so that there is nothing to explain")
        return explain_last(self._taken_in, self._models, self.transition, self.alpha)

    def explain_stream(self, stream: WordStream) -> Iterator[Decision]:
        """For each selected frame of a whole sequence what `explain` tells; ModelError as there.

        The beliefs are the filter's own, before any calibration.
        """
        if self._models is None:
            raise ModelError("this recognizer keeps nothing to explain with; make it with explain=True")
        for part in self.evidence(stream):
            yield from explain_part(part, stream, self._models, self.transition, self._unknown_models)

    def decode(
        self, stream: WordStream, *, smooth: bool = False, viterbi: bool = False, lag: int | None = None
    ) -> Beliefs:
        """The beliefs over a whole sequence: those that `update` gives from a reset, which later words never change.

        Unless `smooth` (all words count) or `lag` (the words up to so many frames later count) is asked for. `viterbi`:
        `best` is the most probable path. Words that the models do not list are counted in a warning. Raises
        StreamError, naming the frame, if a time is needed and missing, or goes back.
        """
        warn_of_unlisted(stream, self._vocabularies)
        parts = list(self.evidence(stream))
        decoded = [self._decoded(part, stream, smooth=smooth, viterbi=viterbi, lag=lag) for part in parts]
        if len(parts) > 1:
            log.info("%s: gaps of more than %g s: %d", stream.name, self.max_gap, len(parts) - 1)
        belief, best, unknown, zero_likelihood_words = zip(*decoded, strict=True)
        if never := sum(zero_likelihood_words):
            log.warning("%s: words that no place explains: %d left the prediction as it was", stream.name, never)
        return Beliefs.of(
            stream,
            self.places,
            np.concatenate(belief),
            selected=np.concatenate([part.selected for part in parts]),
            best=np.concatenate(best),
            unknown=None if self.unknown is None else np.concatenate(unknown),
        )

    def evidence(self, stream: WordStream) -> Iterator[Evidence]:
        """What a sequence says of the places, in parts that gaps end; words that the models do not list say nothing."""
        return evidence_in(
            stream,
            self._dictionaries,
            alpha=self.alpha,
            selection=self.selection,
            per=self._per,
            max_gap=self.max_gap,
        )

    def _decoded(
        self, part: Evidence, stream: WordStream, *, smooth: bool, viterbi: bool, lag: int | None
    ) -> tuple[Floats, Ints, Floats, int]:
        """Of n frames: beliefs (n, C), the place of each (n,), unknown (n,) or empty; words of probability 0."""
        belief, never = posterior(part, self.transition, smooth=smooth, lag=lag)
        best = most_probable_path(part, self.transition) if viterbi else belief.argmax(axis=1)
        if self.calibration is not None:
            belief = self.calibration.apply(belief)
        unknown = np.empty(0)
        if self._unknown_models:
            far = distances_at(stream, self._vocabularies, part.at)
            unknown = unknown_posterior(part, self.transition, self._unknown_models, far, smooth=smooth, lag=lag)
        return belief, best, unknown, never
