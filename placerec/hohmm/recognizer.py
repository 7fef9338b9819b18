"""The recognizer: words (or images) in, belief over places out; one at a time, or a whole sequence."""

import logging
import math
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError
from placerec.hohmm import unknown as new_place
from placerec.hohmm.beliefs import UNKNOWN, Beliefs
from placerec.hohmm.calibration import Calibration
from placerec.hohmm.emissions import Emissions, common_words
from placerec.hohmm.evidence import Evidence, evidence_in
from placerec.hohmm.filter import LN10
from placerec.hohmm.offline import believe, believe_unknown, most_probable_path
from placerec.hohmm.online import OnlineFilter
from placerec.hohmm.transitions import Transition, fixed_transition
from placerec.hohmm.unknown import UnknownModel
from placerec.lm import BackoffModel
from placerec.lm.union import unite_models
from placerec.words import Selection, WordStream, selector

if TYPE_CHECKING:
    from placerec.vision import Dictionary

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Belief:
    """What is believed after one frame: `probability` float64 (C,) beside `places`, summing to 1.

    `unknown`: the probability that the place is none of them, None where nobody asked; the others hold if it is one.
    """

    places: tuple[str, ...]
    probability: Floats
    word: str
    selected: bool
    unknown: float | None = None

    @property
    def best(self) -> str:
        """The most probable place, the first in order where several are; "unknown" if that is above 1/2."""
        if self.unknown is not None and self.unknown > 0.5:
            return UNKNOWN
        return self.places[int(np.argmax(self.probability))]

    def as_dict(self) -> dict[str, float]:
        """Place -> probability."""
        return dict(zip(self.places, self.probability.tolist(), strict=True))


class _Decoded(NamedTuple):
    """Of n frames: beliefs (n, C), the place of each (n,), what is unknown (n,) or empty; words nobody explains."""

    belief: Floats
    best: Ints
    unknown: Floats
    unexplained: int


class Recognizer:
    """The HOHMM filter over the language models of places, on-line and in constant memory.

    `models`: one BackoffModel per place, all of the same words. `selection` is that of their training. `transition`:
    how the place changes (default: the paper's). `dictionary` turns images into words, for `update` with images.
    `max_gap`: more seconds than this between two frames begin a new sequence. `emissions`: what gives the words'
    probabilities, in place of the models. `calibration`: applied to the beliefs in places. `unknown`: what a place that
    is none of them is weighed with; None: nobody asks. Raises ModelError if the models do not list the same words, or
    the transitions are between more or fewer places.
    """

    def __init__(
        self,
        models: Mapping[str, BackoffModel],
        *,
        selection: Selection = Selection(),
        transition: Transition | None = None,
        dictionary: "Dictionary | None" = None,
        max_gap: float | None = None,
        emissions: Emissions | None = None,
        calibration: Calibration | None = None,
        unknown: UnknownModel | None = None,
    ) -> None:
        if not models:
            raise ModelError("a recognizer needs the model of at least one place")
        self.places = tuple(models)
        self.selection = selection
        self.transition = transition or fixed_transition(len(models))
        if len(self.transition.matrix) != len(models):
            raise ModelError(f"transitions between {len(self.transition.matrix)} places for {len(models)} models")
        self.dictionary = dictionary
        self.max_gap = max_gap
        self._words = common_words(models)
        self.emissions = emissions or unite_models(list(models.values()))
        self.calibration = calibration
        self.unknown = unknown
        self._filter = OnlineFilter(self.transition, [1 / len(models)] * len(models))
        self._chain = OnlineFilter(new_place.CHAIN, new_place.prior(len(models)))
        self.unexplained = 0
        self.reset()

    def __contains__(self, word: str) -> bool:
        return word in self._words

    def reset(self) -> None:
        """Forget the sequence so far: uniform belief, empty history."""
        self._filter.reset()
        self._chain.reset()
        self._score = self.emissions.follow()
        self._keep = selector(self.selection)
        self._frame = 0
        self._time: float | None = None
        # Frame and time of the last update; None before the first.
        self._updated: tuple[int, float | None] | None = None

    def update(
        self, word_or_image: "str | NDArray[Any]", time: float | None = None, distance: float | None = None
    ) -> Belief:
        """The belief after one more frame: its word, or its image (h, w) grey 0..255 if there is a dictionary.

        `time` in seconds: needed with a largest gap and with transitions per second. `distance` of a word, from the
        descriptor to its unit: evidence for a place that is unknown; that of an image comes from the dictionary. A word
        that the selection skips leaves the belief as it is (readings A16). Raises ModelError for a word that the models
        do not list, for an image without a dictionary, and for a time that is needed and missing, or goes back; nothing
        has changed then.
        """
        if isinstance(word_or_image, str):
            word = word_or_image
        else:
            word, distance = self._see(word_or_image)
        if word not in self._words:
            raise ModelError(f"the word {word!r} is not in the models' vocabulary")
        self._pass(time, needed=self._needs_times)
        selected = self._keep(word)
        if selected:
            steps = self._steps()
            if steps is not None:
                self._filter.predict(steps)
            log10_p = self._score(word)
            if self.unknown is not None:
                self._weigh_unknown(self.unknown, log10_p, steps, distance)
            self.unexplained += not self._filter.weigh(log10_p)
            self._updated = self._frame, self._time
        return self.belief(word, selected)

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word: it is held, but the frame and its time count."""
        self._pass(time, needed=False)
        return self.belief()

    def belief(self, word: str = "", selected: bool = False) -> Belief:
        """The belief as it stands."""
        probability = self._probabilities()
        if self.calibration is not None:
            probability = self.calibration.apply(probability)
        unknown = None if self.unknown is None else math.exp(self._chain.log_belief[0])
        return Belief(self.places, probability, word, selected, unknown)

    def decode(
        self, stream: WordStream, *, smooth: bool = False, viterbi: bool = False, lag: int | None = None
    ) -> Beliefs:
        """The beliefs over a whole sequence: those that `update` gives from a reset, which later words never change.

        `smooth`, `lag`: see `believe`; later words count. `viterbi`: `best` is the most probable path. Words that the
        models do not list are skipped as `skip` does, and counted in a warning. Raises StreamError as `evidence_in`.
        """
        warn_of_strange_words(stream, self._words)
        parts = list(self.evidence(stream))
        decoded = [self._decoded(part, stream, smooth=smooth, viterbi=viterbi, lag=lag) for part in parts]
        if len(parts) > 1:
            log.info("%s: gaps of more than %g s: %d", stream.name, self.max_gap, len(parts) - 1)
        unexplained = sum(part.unexplained for part in decoded)
        if unexplained:
            log.warning("%s: words that no place explains: %d left the prediction as it was", stream.name, unexplained)
        unknown = None if self.unknown is None else np.concatenate([part.unknown for part in decoded])
        return Beliefs.of(
            stream,
            self.places,
            np.concatenate([part.belief for part in decoded]),
            selected=np.concatenate([part.selected for part in parts]),
            best=np.concatenate([part.best for part in decoded]),
            unknown=unknown,
        )

    def evidence(self, stream: WordStream) -> Iterator[Evidence]:
        """What a sequence says of the places, in parts that gaps end; words that the models do not list say nothing."""
        return evidence_in(
            stream,
            self.emissions,
            self._words,
            selection=self.selection,
            per=self.transition.per,
            max_gap=self.max_gap,
        )

    def _decoded(self, part: Evidence, stream: WordStream, *, smooth: bool, viterbi: bool, lag: int | None) -> _Decoded:
        belief, unexplained = believe(part, self.transition, smooth=smooth, lag=lag)
        best = most_probable_path(part, self.transition) if viterbi else belief.argmax(axis=1)
        if self.calibration is not None:
            belief = self.calibration.apply(belief)
        unknown = np.empty(0)
        if self.unknown is not None:
            far = stream.distances[part.at]
            unknown = believe_unknown(part, self.transition, self.unknown, far, smooth=smooth, lag=lag)
        return _Decoded(belief, best, unknown, unexplained)

    @property
    def _needs_times(self) -> bool:
        return self.max_gap is not None or self.transition.per == "second"

    def _pass(self, time: float | None, *, needed: bool) -> None:
        """Take note of one more frame; after a gap everything starts anew."""
        known = time is not None and not math.isnan(time)
        if needed and not known:
            raise ModelError("the frame has no time, which transitions per second and the largest gap need")
        if time is not None and known:
            if self._needs_times and self._time is not None and time < self._time:
                raise ModelError(f"time goes back from {self._time:.6f} to {time:.6f} s")
            if self.max_gap is not None and self._time is not None and time - self._time > self.max_gap:
                log.info("%g s without a frame: a new sequence begins", time - self._time)
                self.reset()
            self._time = time
        self._frame += 1

    def _steps(self) -> float | None:
        """Steps of the transitions since the last update, None before the first."""
        if self._updated is None:
            return None
        frame, time = self._updated
        if self.transition.per == "frame":
            return self._frame - frame
        if self.transition.per == "second" and self._time is not None and time is not None:
            return self._time - time
        return 1.0

    def _weigh_unknown(
        self, model: UnknownModel, log10_p: Sequence[float], steps: float | None, distance: float | None
    ) -> None:
        """Take in a word as evidence for a place that is unknown; the filter is at its prediction."""
        if steps is not None:
            self._chain.predict(steps)
        far = np.array([math.nan if distance is None else distance])
        (ratio,) = new_place.evidence(model, np.array([log10_p]), self._probabilities()[None], far).tolist()
        self._chain.weigh([ratio / LN10, 0.0])

    def _probabilities(self) -> Floats:
        """The filter's own belief (C,)."""
        probability = np.array([math.exp(b) for b in self._filter.log_belief])
        normal: Floats = probability / probability.sum()
        return normal

    def _see(self, image: NDArray[Any]) -> tuple[str, float]:
        if self.dictionary is None:
            raise ModelError("an image needs a dictionary to become a word; give the recognizer the words.npz")
        return self.dictionary.look(image)


def warn_of_strange_words(stream: WordStream, known: Container[str]) -> None:
    """Say how many words of a stream are not `known`, if any."""
    strange = [word for word in stream.words if word not in known]
    if strange:
        message = "%s: words that the models do not list: %d skipped, %r first"
        log.warning(message, stream.name, len(strange), strange[0])
