"""A stream as the filter sees it: which words count, how probable they are in each place, how much passed in between.

The probabilities are P(z_t | z_{t-n:t-1}, c) of eq. 1, of the models or of whatever stands for them (`Emissions`).
"""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
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
    """An uninterrupted part of a stream, n frames with U selected words.

    `selected` bool (n,); `at` int64 (U,): where in the stream the selected words stand; `log10_likelihoods` float64
    (U, C): of these words in each place; `elapsed` float64 (U,): steps of the transitions since the selected word
    before, the first 0.
    """

    selected: Mask = field(repr=False)
    at: Ints = field(repr=False)
    log10_likelihoods: Floats = field(repr=False)
    elapsed: Floats = field(repr=False)

    def __len__(self) -> int:
        return len(self.selected)

    @property
    def updates(self) -> Ints:
        """How many selected words came up to each frame, int64 (n,)."""
        return np.cumsum(self.selected)


def evidence_in(
    stream: WordStream,
    emissions: Emissions,
    listed: Collection[str],
    *,
    selection: Selection,
    per: str,
    max_gap: float | None,
) -> Iterator[Evidence]:
    """The parts of a stream, which end where more than `max_gap` seconds pass between two frames.

    Words that are not `listed` are not selected, and the selection does not see them; their frames count as `per` frame
    has it. Raises StreamError, naming the frame, if seconds matter and a frame has no time or time goes back.
    """
    if per == "second" or max_gap is not None:
        _check_times(stream)
    known = np.fromiter((word in listed for word in stream.words), bool, len(stream))
    gaps = np.diff(stream.times) > (np.inf if max_gap is None else max_gap)
    for part in np.split(np.arange(len(stream)), np.flatnonzero(gaps) + 1):
        selected = np.zeros(len(part), bool)
        words = [stream.words[i] for i in part[known[part]].tolist()]
        selected[known[part]] = select(words, selection)
        at = part[selected]
        log10_likelihoods = emissions.score([stream.words[i] for i in at.tolist()])
        stamps = {"update": np.arange(len(at)), "frame": at, "second": stream.times[at]}[per]
        elapsed = np.diff(stamps, prepend=stamps[:1]).astype(np.float64)
        yield Evidence(selected, at, log10_likelihoods, elapsed)


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
