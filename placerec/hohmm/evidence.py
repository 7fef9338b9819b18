"""A stream as the filter sees it: which words count, how probable they are in each place, how much passed in between.

The probabilities are P(z_t | z_{t-n:t-1}, c) of eq. 1, of the models or of whatever stands for them (`Emissions`).
"""

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import ModelError, StreamError
from placerec.lm import BackoffModel
from placerec.lm.check import Scorer
from placerec.words import Selection, WordStream, select

# What every ARPA file lists beside its words.
MARKERS = frozenset({"<s>", "</s>", "<unk>"})


class Emissions(Protocol):
    """What the filter asks of the models of C places; `lm.backoff.ModelUnion` is one."""

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of each of T words in each place, after the words before it."""

    def follow(self) -> Callable[[str], Sequence[float]]:
        """A function from each word of a sequence in turn to its log10 p (C) in each place, in constant memory."""


class SeparateEmissions:
    """Emissions of one scorer per place, such as KenLM's; `order` is the highest of their models."""

    def __init__(self, scorers: Sequence[Scorer], order: int) -> None:
        self._scorers = scorers
        self._order = order

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of each of T words in each place, after the words before it."""
        return np.stack([score(words) for score in self._scorers], axis=1)

    def follow(self) -> Callable[[str], Sequence[float]]:
        """A function from each word of a sequence in turn to its log10 p (C), which keeps `order` words."""
        recent: deque[str] = deque(maxlen=self._order)

        def score(word: str) -> list[float]:
            recent.append(word)
            return [float(score([*recent])[-1]) for score in self._scorers]

        return score


def common_words(models: Mapping[str, BackoffModel]) -> frozenset[str]:
    """The words that the models of all places list, markers apart; ModelError if they do not list the same."""
    (first, model), *others = models.items()
    words = set(model.words) - MARKERS
    for place, other in others:
        differ = words ^ (set(other.words) - MARKERS)
        if differ:
            word = min(differ)
            have, lack = (first, place) if word in words else (place, first)
            raise ModelError(
                f"the model of {have!r} lists the word {word!r} and that of {lack!r} does not; "
                "a word that one place lacks would decide for another: train them on one vocabulary"
            )
    return frozenset(words)


@dataclass(frozen=True)
class Evidence:
    """An uninterrupted part of a stream, n frames with U selected ones, whose words in D dictionaries count.

    `selected` bool (n,); `at` int64 (U,): where in the stream the selected frames stand; `own` float64 (D, U, C):
    log10 p of each dictionary's words in each place, nan where the dictionary's selection skips the frame; `elapsed`
    float64 (U,): steps of the transitions since the selected frame before, the first 0. `alpha`: the exponent of all
    these probabilities, by which the filter weighs them against what it predicts.
    """

    selected: Mask = field(repr=False)
    at: Ints = field(repr=False)
    own: Floats = field(repr=False)
    elapsed: Floats = field(repr=False)
    alpha: float = 1.0

    def __len__(self) -> int:
        return len(self.selected)

    @cached_property
    def log10_likelihoods(self) -> Floats:
        """log10 of what the selected frames count in each place, float64 (U, C): all words', each to the `alpha`."""
        first, *others = self.own
        if not others:
            return weighted(self.alpha, first)
        total = np.zeros(first.shape)
        for own in self.own:
            total += np.nan_to_num(own, nan=0.0, neginf=-np.inf)
        return weighted(self.alpha, total)

    @property
    def updates(self) -> Ints:
        """How many selected words came up to each frame, int64 (n,)."""
        return np.cumsum(self.selected)


def weighted(alpha: float, log10_likelihoods: Floats) -> Floats:
    """log10 of likelihoods to the power of `alpha`."""
    return log10_likelihoods if alpha == 1 else alpha * log10_likelihoods


@dataclass(frozen=True)
class DictionaryModels:
    """What the words of one dictionary say of the places: their probabilities, and which words these know.

    `name`: of the dictionary, that is of the column of token streams.
    """

    name: str
    emissions: Emissions = field(repr=False)
    words: Collection[str] = field(repr=False)


def evidence_in(
    stream: WordStream,
    dictionaries: Sequence[DictionaryModels],
    *,
    alpha: float = 1.0,
    selection: Selection,
    per: str,
    max_gap: float | None,
) -> Iterator[Evidence]:
    """The parts of a stream, which end where more than `max_gap` seconds pass between two frames.

    Words that are not listed are not selected, and the selection does not see them; their frames count as `per` frame
    has it. A dictionary that the stream has no words of says nothing. Raises StreamError, naming the frame, if seconds
    matter and a frame has no time or time goes back.
    """
    if per == "second" or max_gap is not None:
        _check_times(stream)
    gaps = np.diff(stream.times) > (np.inf if max_gap is None else max_gap)
    columns = [_words(stream, one) for one in dictionaries]
    known = [
        np.fromiter((word in one.words for word in words), bool, len(stream))
        for one, words in zip(dictionaries, columns, strict=True)
    ]
    for part in np.split(np.arange(len(stream)), np.flatnonzero(gaps) + 1):
        kept = np.zeros((len(dictionaries), len(part)), bool)
        for d, words in enumerate(columns):
            listed = known[d][part]
            kept[d, listed] = select([words[i] for i in part[listed].tolist()], selection)
        selected = np.logical_or.reduce(kept, axis=0)
        at = part[selected]
        scores = [
            one.emissions.score([words[i] for i in part[own].tolist()])
            for one, words, own in zip(dictionaries, columns, kept, strict=True)
        ]
        found = np.full((len(dictionaries), len(at), scores[0].shape[1]), np.nan)
        for d, score in enumerate(scores):
            found[d, kept[d, selected]] = score
        stamps = {"update": np.arange(len(at)), "frame": at, "second": stream.times[at]}[per]
        elapsed = np.diff(stamps, prepend=stamps[:1]).astype(np.float64)
        yield Evidence(selected, at, found, elapsed, alpha)


def _words(stream: WordStream, dictionary: DictionaryModels) -> Sequence[str]:
    """A stream's words in a dictionary; empty texts, which none lists, where it has none."""
    if dictionary.name in stream.dictionaries:
        return stream.in_dictionary(dictionary.name).words
    return [""] * len(stream)


def distances_at(stream: WordStream, dictionaries: Iterable[str], at: Ints) -> Floats:
    """The distances of some frames in each of D dictionaries, float64 (D, U), nan where unknown."""
    rows = [
        stream.in_dictionary(name).distances[at] if name in stream.dictionaries else np.full(len(at), np.nan)
        for name in dictionaries
    ]
    return np.array(rows)


def _check_times(stream: WordStream) -> None:
    missing = np.flatnonzero(np.isnan(stream.times))
    if len(missing):
        raise StreamError(
            f"{stream.name}: frame {stream.frames[missing[0]]!r} has no time, which transitions per second and the "
            "largest gap need; leave them out"
        )
    back = np.flatnonzero(np.diff(stream.times) < 0)
    if len(back):
        before, after = stream.times[back[0] : back[0] + 2]
        frame = stream.frames[back[0] + 1]
        raise StreamError(
            f"{stream.name}: time goes back from {before:.6f} to {after:.6f} s at frame {frame!r}; put them in order"
        )
