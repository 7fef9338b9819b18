"""Words (or images) in, belief over places out, frame by frame: what all methods that do so have in common."""

import copy
import logging
import math
import os
from collections.abc import Callable, Collection, Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats
from placerec.errors import ModelError, StreamError
from placerec.frames.folder import SUFFIXES
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs, list_places
from placerec.words import Selection, WordStream, selector
from placerec.words.stream import column_of

if TYPE_CHECKING:
    from placerec.vision import Dictionary, DictionarySet

log = logging.getLogger(__name__)


class Belief(NamedTuple):
    """What is believed after one frame: `probability` float64 (C,) beside `places`, summing to 1.

    `unknown`: the probability that the place is none of them, None where nobody asked; the others hold if it is one.
    """

    places: tuple[str, ...]
    probability: Floats
    word: str
    selected: bool
    unknown: float | None = None

    def __repr__(self) -> str:
        unknown = "" if self.unknown is None else f", unknown {self.unknown:.3g}"
        return f"Belief({self.best!r}, {self.probability.max():.3g}{unknown}, word={self.word!r})"

    @property
    def best(self) -> str:
        """The most probable place, the first in order where several are; "unknown" if that is above 1/2."""
        if self.unknown is not None and self.unknown > 0.5:
            return UNKNOWN_PLACE
        return self.places[int(np.argmax(self.probability))]

    def as_dict(self) -> dict[str, float]:
        """Place -> probability."""
        return dict(zip(self.places, self.probability.tolist(), strict=True))


# The belief after a selected word: float64 (C,) in the places; that the place is none of them, None where nobody asked;
# and whether any place gives the word a probability above 0. A plain tuple: it is made for every frame.
Posterior = tuple[Floats, float | None, bool]
# Takes in a frame's selected words: the word of each dictionary (None where none is selected), the steps since the
# selected words before (None for the first), and the distance from the frame's descriptor to each word (None where it
# is unknown).
TakeIn = Callable[[Sequence[str | None], float | None, Sequence[float | None]], Posterior]
# The word of a frame, or its words in several dictionaries; and its distance, or that of each word.
Words = str | Sequence[str]
# What is given for every frame comes first: to ask an abstract class takes long.
_WORDS = (str, tuple, list, Sequence)
Distances = float | Sequence[float | None] | None


@dataclass
class _Sequence:
    """The sequence so far: the posterior, what takes in the next words; frames, and the last time.

    `keep`: what selects the words of each dictionary; empty where all count. `updated`: frame and time of the last
    selected word, None before the first.
    """

    posterior: Posterior
    take_in: TakeIn
    keep: Sequence[Callable[[str], bool]]
    frame: int = 0
    time: float | None = None
    updated: tuple[int, float | None] | None = None


class SequenceDecoder:
    """Beliefs over places on-line, in constant memory, from words that are selected as in training.

    A word that the selection skips leaves the belief as it is (readings A16). More than `max_gap` seconds between two
    frames begin a new sequence. `dictionary` turns images into words. `words`: the vocabulary of each dictionary, by
    the dictionary's name; they have no word in common. Attributes without an underscore cannot be assigned: decoding a
    whole sequence and word by word would part ways; `changed` makes a copy with other settings. A subclass says in
    `_begin` what is believed before any word, and how words change that.
    """

    _SETTINGS: tuple[str, ...] = ("selection", "dictionary", "max_gap")
    # What a frame's missing time is needed for, in an error.
    _NEEDING = "the largest gap needs"

    def __init__(
        self,
        places: Collection[str],
        words: Mapping[str, Collection[str]],
        *,
        selection: Selection = Selection(),
        dictionary: "Dictionary | DictionarySet | None" = None,
        max_gap: float | None = None,
    ) -> None:
        self.places: Final = tuple(places)
        self.selection: Final = selection
        self.dictionary: Final = dictionary
        self.max_gap: Final = max_gap
        self._vocabularies = words
        self._number = _numbered(words)
        self._restart()

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.__dict__ and not name.startswith("_"):
            remedy = f"; changed({name}=...) gives another one" if name in self._SETTINGS else ""
            raise AttributeError(f"{name} of a {type(self).__name__} is fixed{remedy}")
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        several = f" of {len(self._vocabularies)} dictionaries" if len(self._vocabularies) > 1 else ""
        sizes = f"{list_places(self.places)}; {len(self._number)} words{several}"
        return f"{type(self).__name__}({sizes}; {self._settings()})"

    def _settings(self) -> str:
        """Settings, for `repr`."""
        gap = "" if self.max_gap is None else f", gaps above {self.max_gap:g} s"
        return f"selection {self.selection}{gap}"

    def __contains__(self, word: object) -> bool:
        return word in self._number

    def changed(self, **settings: Any) -> Self:
        """A copy with other settings, named as the arguments of the class, at the beginning of a sequence.

        Raises TypeError for a name that is no setting, and whatever the class raises for the value.
        """
        for name in settings:
            if name not in self._SETTINGS:
                raise TypeError(f"{name!r} is no setting of a {type(self).__name__}: {', '.join(self._SETTINGS)}")
        copied = copy.copy(self)
        vars(copied).update(settings)
        copied._restart()
        return copied

    def _restart(self, per: str = "frame") -> None:
        """Begin with the settings as they are; `per`: a step between selected words: `update`, `frame` or `second`."""
        self._per = per
        self._needs_times = self.max_gap is not None or per == "second"
        self._zero_likelihood_words = 0
        self.reset()

    def _begin(self) -> tuple[Posterior, TakeIn]:
        """The belief before any word of a sequence, and what takes in its selected words."""
        raise NotImplementedError

    @property
    def zero_likelihood_words(self) -> int:
        """How many selected words had probability 0 in every place, since the decoder was made."""
        return self._zero_likelihood_words

    @property
    def several(self) -> bool:
        """Whether a frame has words of several dictionaries."""
        return len(self._vocabularies) > 1

    @property
    def asks_unknown(self) -> bool:
        """Whether beliefs tell the probability that the place is none of `places`."""
        return self._now.posterior[1] is not None

    def reset(self) -> None:
        """Forget the sequence so far: the belief is that before any word, and no word has been seen."""
        choosy = () if self.selection.kind == "none" else self._vocabularies
        self._now = _Sequence(*self._begin(), [selector(self.selection) for _ in choosy])

    def update(
        self, words_or_image: "Words | NDArray[Any]", time: float | None = None, distance: Distances = None
    ) -> Belief:
        """The belief after one more frame: its word, or its image (h, w) grey 0..255 if there is a dictionary.

        Of several dictionaries a sequence of words, one of each at most, in any order. `time` in seconds: needed with a
        largest gap and with transitions per second. `distance` of a word, from the descriptor to its unit, or those of
        the words: evidence for a place that is unknown; those of an image come from the dictionary. Raises ModelError
        for a word that is not in the vocabulary, for an image without a dictionary, and for a time that is needed and
        missing, or goes back; nothing has changed then.
        """
        if isinstance(words_or_image, _WORDS):
            return self._take(*_columns(words_or_image, distance), time)
        return self._take(*self._look(words_or_image), time)

    def _take(self, words: Sequence[str], far: Sequence[float | None], time: float | None) -> Belief:
        """The belief after one more frame with its words and their distances."""
        taken: list[str | None]
        if len(words) == len(far) == 1 == len(self._vocabularies) and words[0] in self._number:
            taken, distances = [words[0]], far
        else:
            taken, distances = self._by_dictionary(words, far)
        self._pass(time, needed=self._needs_times)
        now = self._now
        selected = not now.keep
        for number, keep in enumerate(now.keep):
            given = taken[number]
            if given is not None and keep(given):
                selected = True
            else:
                taken[number] = None
        if selected:
            now.posterior = now.take_in(taken, self._steps(now), distances)
            now.updated = now.frame, now.time
            if not now.posterior[2]:
                self._zero_likelihood_words += 1
        # As `belief` does; a call more would be felt on-line.
        probability, unknown, _ = now.posterior
        return Belief(self.places, probability.copy(), words[0], selected, unknown)

    def _by_dictionary(
        self, words: Sequence[str], far: Sequence[float | None]
    ) -> tuple[list[str | None], list[float | None]]:
        """The word of each dictionary, and the distance to it; None where there is none."""
        taken: list[str | None] = [None] * len(self._vocabularies)
        distances: list[float | None] = [None] * len(taken)
        for word, own in zip(words, far, strict=True):
            number = self._number.get(word)
            if number is None:
                raise ModelError(f"the word {word!r} is not in the models' vocabulary{_image_hint(word)}")
            if taken[number] is not None:
                raise ModelError(f"the words {taken[number]!r} and {word!r} are of one dictionary; give one a frame")
            taken[number], distances[number] = word, own
        if not words:
            raise ModelError("no word is given; a frame without a word is told by skip()")
        return taken, distances

    def answer(self, words: Words, time: float | None = None, distance: Distances = None) -> Belief:
        """The belief after one more frame and its word or words, which hold the belief if none is in the vocabulary.

        `time`, `distance`, and what is raised for a time: see `update`.
        """
        given, far = _columns(words, distance)
        if all(map(self._number.__contains__, given)):
            return self._take(given, far, time)
        listed = [pair for pair in zip(given, far, strict=True) if pair[0] in self._number]
        if not listed:
            return self.skip(time)._replace(word=given[0])
        known, distances = zip(*listed, strict=True)
        return self._take(known, distances, time)._replace(word=given[0])

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word: it is held, but the frame and its time count."""
        self._pass(time, needed=False)
        return self.belief()

    def belief(self) -> Belief:
        """The belief as it stands."""
        probability, unknown, _ = self._now.posterior
        return Belief(self.places, probability.copy(), "", False, unknown)

    def decode(self, stream: WordStream) -> Beliefs:
        """The beliefs over a whole sequence: those that `answer` gives from a reset, which later words never change.

        Words that are not in the vocabulary are counted in a warning. Raises StreamError, naming the frame, if a time
        is needed and missing, or goes back.
        """
        self.reset()
        warn_of_unlisted(stream, self._vocabularies)
        rows = []
        columns = [stream.in_dictionary(name) for name in self._vocabularies if name in stream.dictionaries]
        words = zip(*(column.words for column in columns), strict=True)
        distances = zip(*(column.distances.tolist() for column in columns), strict=True)
        for name, time, given, far in zip(stream.frames, stream.times.tolist(), words, distances, strict=True):
            try:
                rows.append(self.answer(given, time, far))
            except ModelError as error:
                raise StreamError(f"{stream.name}: frame {name!r}: {error}") from error
        return Beliefs.of(
            stream,
            self.places,
            np.array([row.probability for row in rows]).reshape(len(rows), len(self.places)),
            selected=np.array([row.selected for row in rows], bool),
            unknown=np.array([row.unknown for row in rows], float) if self.asks_unknown else None,
        )

    def _pass(self, time: float | None, *, needed: bool) -> None:
        """Take note of one more frame; after a gap everything starts anew."""
        now = self._now
        if time is None or math.isnan(time):
            if needed:
                raise ModelError(f"the frame has no time, which {self._NEEDING}")
        else:
            if self._needs_times and now.time is not None:
                if time < now.time:
                    raise ModelError(f"time goes back from {now.time:.6f} to {time:.6f} s")
                if self.max_gap is not None and time - now.time > self.max_gap:
                    log.info("%g s without a frame: a new sequence begins", time - now.time)
                    self.reset()
                    now = self._now
            now.time = time
        now.frame += 1

    def _steps(self, now: _Sequence) -> float | None:
        """Steps since the last selected word, None before the first."""
        if now.updated is None:
            return None
        frame, time = now.updated
        if self._per == "frame":
            return now.frame - frame
        if self._per == "second" and now.time is not None and time is not None:
            return now.time - time
        return 1.0

    def _look(self, image: NDArray[Any]) -> tuple[Sequence[str], Sequence[float | None]]:
        if isinstance(image, os.PathLike):
            raise ModelError(f"{str(image)!r} is a path, and a word or an image is expected{_image_hint(str(image))}")
        if self.dictionary is None:
            raise ModelError("an image needs a dictionary to become a word; give the recognizer the words.npz")
        words, distances = self.dictionary.words_of(image)
        # A system of one dictionary leaves the others' words aside.
        listed = [(word, far) for word, far in zip(words, distances, strict=True) if word in self._number]
        return ([word for word, _ in listed], [far for _, far in listed]) if listed else (words, distances)


def _numbered(vocabularies: Mapping[str, Collection[str]]) -> dict[str, int]:
    """The number of each word's dictionary; ModelError for a word of two."""
    number: dict[str, int] = {}
    for d, (name, words) in enumerate(vocabularies.items()):
        if twice := number.keys() & words:
            raise ModelError(f"the word {min(twice)!r} of the dictionary {name!r} is one of another, too; rename it")
        number |= dict.fromkeys(words, d)
    return number


def _columns(words: Words, distance: Distances) -> tuple[Sequence[str], Sequence[float | None]]:
    """Words and distances of a frame, one of each or several, as sequences."""
    if isinstance(words, str):
        words = (words,)
    if distance is None or isinstance(distance, float) or not isinstance(distance, Sequence):
        return words, (distance,) * len(words)
    return words, distance


def warn_of_unlisted(stream: WordStream, vocabularies: Mapping[str, Container[str]]) -> None:
    """Say how many words of a stream are not listed, and of which dictionaries it has no words, if any.

    `vocabularies`: the listed words of each dictionary, by the dictionary's name.
    """
    unlisted = []
    for name, listed in vocabularies.items():
        if name in stream.dictionaries:
            unlisted += [word for word in stream.in_dictionary(name).words if word not in listed]
    if unlisted:
        message = "%s: words that the models do not list: %d skipped, %r first"
        log.warning(message, stream.name, len(unlisted), unlisted[0])
    if missing := [column_of(name) for name in vocabularies if name not in stream.dictionaries]:
        log.warning("%s: has no column %s; what there is decides alone", stream.name, ", ".join(missing))


def _image_hint(text: str) -> str:
    """How to give an image, where a text looks like the name of an image's file."""
    if PurePath(text).suffix.lower() not in SUFFIXES and not {"/", "\\"} & {*text}:
        return ""
    return f"; for an image, give its grey levels: read_gray({text!r})"
