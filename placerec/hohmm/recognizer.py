"""The recognizer: words (or images) in, belief over places out; one at a time, or a whole sequence."""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import ModelError
from placerec.hohmm.beliefs import Beliefs
from placerec.hohmm.emissions import Emissions, common_words
from placerec.hohmm.evidence import evidence_in
from placerec.hohmm.filter import filter_step
from placerec.hohmm.motion import Predict, predictor
from placerec.hohmm.offline import believe, most_probable_path
from placerec.hohmm.transitions import Transition, fixed_transition
from placerec.lm import BackoffModel
from placerec.lm.union import unite_models
from placerec.words import Selection, WordStream, selector

if TYPE_CHECKING:
    from placerec.vision import Dictionary

# How many distinct times between updates have their transitions kept.
PREDICTORS = 1024
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Belief:
    """What is believed after one frame: `probability` float64 (C,) beside `places`, summing to 1."""

    places: tuple[str, ...]
    probability: NDArray[np.float64]
    word: str
    selected: bool

    @property
    def best(self) -> str:
        """The most probable place; the first in order where several are."""
        return self.places[int(np.argmax(self.probability))]

    def as_dict(self) -> dict[str, float]:
        """Place -> probability."""
        return dict(zip(self.places, self.probability.tolist(), strict=True))


class Recognizer:
    """The HOHMM filter over the language models of places, on-line and in constant memory.

    `models`: one BackoffModel per place, all of the same words. `selection` is that of their training. `transition`:
    how the place changes (default: the paper's). `dictionary` turns images into words, for `update` with images.
    `max_gap`: more seconds than this between two frames begin a new sequence. `emissions`: what gives the words'
    probabilities, in place of the models. Raises ModelError if the models do not list the same words, or the
    transitions are between more or fewer places.
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
        self._predictors: dict[float, Predict] = {}
        self.unexplained = 0
        self.reset()

    def __contains__(self, word: str) -> bool:
        return word in self._words

    def reset(self) -> None:
        """Forget the sequence so far: uniform belief, empty history."""
        self._log_belief = [-math.log(len(self.places))] * len(self.places)
        self._score = self.emissions.follow()
        self._keep = selector(self.selection)
        self._frame = 0
        self._time: float | None = None
        # Frame and time of the last update; None before the first.
        self._updated: tuple[int, float | None] | None = None

    def update(self, word_or_image: "str | NDArray[Any]", time: float | None = None) -> Belief:
        """The belief after one more frame: its word, or its image (h, w) grey 0..255 if there is a dictionary.

        `time` in seconds: needed with a largest gap and with transitions per second. A word that the selection skips
        leaves the belief as it is (readings A16). Raises ModelError for a word that the models do not list, for an
        image without a dictionary, and for a time that is needed and missing, or goes back; nothing has changed then.
        """
        word = word_or_image if isinstance(word_or_image, str) else self._see(word_or_image)
        if word not in self._words:
            raise ModelError(f"the word {word!r} is not in the models' vocabulary")
        self._pass(time, needed=self._needs_times)
        selected = self._keep(word)
        if selected:
            if self._updated is not None:
                self._log_belief = self._predictor(*self._updated)(self._log_belief)
            self._log_belief, explained = filter_step(self._log_belief, self._score(word))
            self.unexplained += not explained
            self._updated = self._frame, self._time
        return self.belief(word, selected)

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word: it is held, but the frame and its time count."""
        self._pass(time, needed=False)
        return self.belief()

    def belief(self, word: str = "", selected: bool = False) -> Belief:
        """The belief as it stands."""
        probability = np.array([math.exp(b) for b in self._log_belief])
        return Belief(self.places, probability / probability.sum(), word, selected)

    def decode(
        self, stream: WordStream, *, smooth: bool = False, viterbi: bool = False, lag: int | None = None
    ) -> Beliefs:
        """The beliefs over a whole sequence: those that `update` gives from a reset, which later words never change.

        `smooth`, `lag`: see `believe`; later words count. `viterbi`: `best` is the most probable path. Words that the
        models do not list are skipped as `skip` does, and counted in a warning. Raises StreamError as `evidence_in`.
        """
        self._warn_of_strange_words(stream)
        selected, beliefs, best, unexplained = [], [], [], 0
        parts = evidence_in(
            stream,
            self.emissions,
            self._words,
            selection=self.selection,
            per=self.transition.per,
            max_gap=self.max_gap,
        )
        for evidence in parts:
            belief, strange = believe(evidence, self.transition, smooth=smooth, lag=lag)
            selected.append(evidence.selected)
            beliefs.append(belief)
            best.append(most_probable_path(evidence, self.transition) if viterbi else belief.argmax(axis=1))
            unexplained += strange
        if len(beliefs) > 1:
            log.info("%s: gaps of more than %g s: %d", stream.name, self.max_gap, len(beliefs) - 1)
        if unexplained:
            log.warning("%s: words that no place explains: %d left the prediction as it was", stream.name, unexplained)
        return Beliefs(
            stream.name,
            self.places,
            stream.frames,
            stream.times,
            stream.places,
            stream.words,
            np.concatenate(selected),
            tuple(self.places[i] for i in np.concatenate(best).tolist()),
            np.concatenate(beliefs),
        )

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

    def _predictor(self, frame: int, time: float | None) -> Predict:
        """The prediction from the last update to now."""
        steps = 1.0
        if self.transition.per == "frame":
            steps = self._frame - frame
        elif self.transition.per == "second" and self._time is not None and time is not None:
            steps = self._time - time
        predict = self._predictors.get(steps)
        if predict is None:
            if len(self._predictors) == PREDICTORS:
                self._predictors.clear()
            predict = self._predictors[steps] = predictor(self.transition, steps)
        return predict

    def _see(self, image: NDArray[Any]) -> str:
        if self.dictionary is None:
            raise ModelError("an image needs a dictionary to become a word; give the recognizer the words.npz")
        return self.dictionary.see(image)

    def _warn_of_strange_words(self, stream: WordStream) -> None:
        strange = [word for word in stream.words if word not in self._words]
        if strange:
            message = "%s: words that the models do not list: %d skipped, %r first"
            log.warning(message, stream.name, len(strange), strange[0])
