"""A system that needs no filter of eq. 1, with the surface of a `Recognizer`: one word at a time, or a sequence."""

import logging
import math
from collections.abc import Sequence

import numpy as np

from placerec.errors import ModelError, StreamError
from placerec.hohmm import Belief, Beliefs
from placerec.hohmm.recognizer import warn_of_strange_words
from placerec.methods.training_set import MakeStepper
from placerec.words import Selection, WordStream, selector

log = logging.getLogger(__name__)


class Follower:
    """Beliefs of `make_stepper` over `places`, on-line; words as in `vocabulary`, selected as in training.

    Before the first selected word all places are equally probable; a word that the selection skips, or that the
    vocabulary lacks, leaves the belief as it is. More than `max_gap` seconds between two frames begin a new sequence.
    `unknown`: the beliefs of `make_stepper` have one column more, the probability that the place is none of `places`.
    """

    unexplained = 0  # Every word has a probability everywhere.

    def __init__(
        self,
        places: Sequence[str],
        vocabulary: Sequence[str],
        make_stepper: MakeStepper,
        *,
        selection: Selection = Selection(),
        max_gap: float | None = None,
        unknown: bool = False,
    ) -> None:
        self.places = tuple(places)
        self.selection = selection
        self.max_gap = max_gap
        self.unknown = unknown or None
        self._index = {word: i for i, word in enumerate(vocabulary)}
        self._make_stepper = make_stepper
        self.reset()

    def __contains__(self, word: str) -> bool:
        return word in self._index

    def reset(self) -> None:
        """Forget the sequence so far."""
        columns = len(self.places) + bool(self.unknown)
        self._belief = np.full(columns, 1 / columns)
        self._step = self._make_stepper()
        self._keep = selector(self.selection)
        self._time: float | None = None
        # Frames since the last selected word; None before the first.
        self._since: int | None = None

    def update(self, word: str, /, time: float | None = None, distance: float | None = None) -> Belief:
        """The belief after one more frame and its word; `time` in seconds, needed with a largest gap.

        `distance` is what a `Recognizer` takes, too; it says nothing here. Raises ModelError for a word that the
        vocabulary lacks, and for a time that is needed and missing or goes back.
        """
        if word not in self._index:
            raise ModelError(f"the word {word!r} is not in the models' vocabulary")
        if self.max_gap is not None and (time is None or math.isnan(time)):
            raise ModelError("the frame has no time, which the largest gap needs")
        self._pass(time)
        selected = self._keep(word)
        if selected:
            self._belief = self._step(self._index[word], self._since or 0)
            self._since = 0
        return self._believed(word, selected)

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word: it is held, but the frame and its time count."""
        self._pass(time)
        return self._believed("", False)

    def decode(self, stream: WordStream) -> Beliefs:
        """The beliefs over a whole sequence: those that `update` gives from a reset.

        Words that the vocabulary lacks are skipped and counted in a warning. Raises StreamError, naming the frame, if
        there is a largest gap and a frame has no time or time goes back.
        """
        self.reset()
        warn_of_strange_words(stream, self._index)
        selected = np.zeros(len(stream), bool)
        belief, unknown = np.empty((len(stream), len(self.places))), np.zeros(len(stream))
        for i, (word, time) in enumerate(zip(stream.words, stream.times.tolist(), strict=True)):
            try:
                answer = self.update(word, time) if word in self else self.skip(time)
            except ModelError as error:
                raise StreamError(f"{stream.name}: frame {stream.frames[i]!r}: {error}") from error
            selected[i], belief[i], unknown[i] = answer.selected, answer.probability, answer.unknown or 0
        return Beliefs.of(stream, self.places, belief, selected=selected, unknown=unknown if self.unknown else None)

    def _believed(self, word: str, selected: bool) -> Belief:
        if not self.unknown:
            return Belief(self.places, self._belief.copy(), word, selected)
        known = self._belief[:-1]
        return Belief(self.places, known / known.sum(), word, selected, float(self._belief[-1]))

    def _pass(self, time: float | None) -> None:
        """Take note of one more frame; after a gap everything starts anew."""
        if self.max_gap is not None and time is not None and not math.isnan(time):
            if self._time is not None and time < self._time:
                raise ModelError(f"time goes back from {self._time:.6f} to {time:.6f} s")
            if self._time is not None and time - self._time > self.max_gap:
                log.info("%g s without a frame: a new sequence begins", time - self._time)
                self.reset()
            self._time = time
        if self._since is not None:
            self._since += 1
