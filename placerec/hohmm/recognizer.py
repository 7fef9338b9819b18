"""The recognizer: words (or images) in, belief over places out; one at a time, or a whole sequence."""

import logging
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import ModelError
from placerec.hohmm.beliefs import Beliefs
from placerec.hohmm.filter import filter_stream, uniform, update
from placerec.hohmm.transitions import Transition, fixed_transition
from placerec.lm import BackoffModel
from placerec.lm.external import Scorer
from placerec.words import Selection, WordStream, select, selector

if TYPE_CHECKING:
    from placerec.vision import Dictionary

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

    `models`: one BackoffModel per place, all of the same words. `selection` is that of their training. `dictionary`
    turns images into words, for `update` with images. Raises ModelError if the models do not list the same words.
    """

    def __init__(
        self,
        models: Mapping[str, BackoffModel],
        *,
        selection: Selection = Selection(),
        transition: Transition | None = None,
        dictionary: "Dictionary | None" = None,
        scorers: Mapping[str, Scorer] | None = None,
    ) -> None:
        if not models:
            raise ModelError("a recognizer needs the model of at least one place")
        self.places = tuple(models)
        self.selection = selection
        self.transition = transition or fixed_transition(len(models))
        self.dictionary = dictionary
        self._score: list[Scorer] = [(scorers or {}).get(place, model.score) for place, model in models.items()]
        self._words = _common_words(models)
        self._order = max(model.order for model in models.values())
        self.unexplained = 0
        self.reset()

    def __contains__(self, word: str) -> bool:
        return word in self._words

    def reset(self) -> None:
        """Forget the sequence so far: uniform belief, empty history."""
        self._log_belief = uniform(len(self.places))
        self._history: deque[str] = deque(maxlen=self._order - 1)
        self._keep = selector(self.selection)
        self._started = False

    def update(self, word_or_image: "str | NDArray[Any]", time: float | None = None) -> Belief:
        """The belief after one more frame: its word, or its image (h, w) grey 0..255 if there is a dictionary.

        `time` in seconds is accepted for every frame; the fixed transitions do not depend on it. A word that the
        selection skips leaves the belief as it is (readings A16). Raises ModelError for a word that the models do not
        list, or for an image without a dictionary.
        """
        word = word_or_image if isinstance(word_or_image, str) else self._see(word_or_image)
        if word not in self._words:
            raise ModelError(f"the word {word!r} is not in the models' vocabulary")
        selected = self._keep(word)
        if selected:
            words = [*self._history, word]
            log10_p = np.array([score(words)[-1] for score in self._score])
            predicted = self.transition.predict(self._log_belief) if self._started else self._log_belief
            self._log_belief, explained = update(predicted, log10_p)
            self.unexplained += not explained
            self._history.append(word)
            self._started = True
        return self.belief(word, selected)

    def belief(self, word: str = "", selected: bool = False) -> Belief:
        """The belief as it stands."""
        probability = np.exp(self._log_belief)
        return Belief(self.places, probability / probability.sum(), word, selected)

    def decode(self, stream: WordStream) -> Beliefs:
        """The beliefs over a whole sequence, the same as `update` gives from a reset; later words change nothing.

        Words that the models do not list are skipped as if the frame were missing from the stream, but hold the belief;
        they are counted in a warning.
        """
        listed = np.array([word in self._words for word in stream.words], bool)
        words = [word for word, known in zip(stream.words, listed, strict=True) if known]
        if len(words) < len(stream):
            strange = next(word for word in stream.words if word not in self._words)
            log.warning(
                "%s: words that the models do not list: %d skipped, %r first",
                stream.name,
                len(stream) - len(words),
                strange,
            )
        selected = np.zeros(len(stream), bool)
        selected[listed] = select(words, self.selection)
        kept = [word for word, keep in zip(stream.words, selected, strict=True) if keep]
        log10_p = np.stack([score(kept) for score in self._score], axis=1) if kept else np.zeros((0, len(self.places)))
        filtered = filter_stream(log10_p, self.transition)
        if filtered.unexplained:
            log.warning(
                "%s: words that no place explains: %d left the prediction as it was", stream.name, filtered.unexplained
            )
        before_first = np.full((1, len(self.places)), 1 / len(self.places))
        belief = np.concatenate([before_first, filtered.belief])[np.cumsum(selected)]
        best = tuple(self.places[i] for i in np.argmax(belief, axis=1).tolist())
        return Beliefs(
            stream.name, self.places, stream.frames, stream.times, stream.places, stream.words, selected, best, belief
        )

    def _see(self, image: NDArray[Any]) -> str:
        if self.dictionary is None:
            raise ModelError("an image needs a dictionary to become a word; give the recognizer the words.npz")
        return self.dictionary.see(image)


def _common_words(models: Mapping[str, BackoffModel]) -> frozenset[str]:
    """The words that all models list, markers apart."""
    markers = {"<s>", "</s>", "<unk>"}
    (first, model), *others = models.items()
    words = set(model.words) - markers
    for place, other in others:
        differ = words ^ (set(other.words) - markers)
        if differ:
            word = min(differ)
            have, lack = (first, place) if word in words else (place, first)
            raise ModelError(
                f"the model of {have!r} lists the word {word!r} and that of {lack!r} does not; "
                "a word that one place lacks would decide for another: train them on one vocabulary"
            )
    return frozenset(words)
