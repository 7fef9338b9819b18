"""A stream as the filter sees it: which words count, what they say of the places, and how much passed in between."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import StreamError
from placerec.hohmm.emissions import Emissions
from placerec.words import Selection, WordStream, select


@dataclass(frozen=True)
class Evidence:
    """An uninterrupted part of a stream, n frames with U selected words.

    `selected` bool (n,); `at` int64 (U,): where in the stream the selected words stand; `log10_p` float64 (U, C): of
    them in each place; `elapsed` float64 (U,): steps of the transitions since the selected word before, the first 0.
    """

    selected: Mask = field(repr=False)
    at: Ints = field(repr=False)
    log10_p: Floats = field(repr=False)
    elapsed: Floats = field(repr=False)

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
        log10_p = emissions.score([stream.words[i] for i in at.tolist()])
        yield Evidence(selected, at, log10_p, _elapsed(at, stream.times, per))


def _elapsed(at: Ints, times: Floats, per: str) -> Floats:
    """Steps since the update before, for updates at the frames `at` (U,); 0 for the first."""
    stamps = {"update": np.arange(len(at)), "frame": at, "second": times[at]}[per]
    return np.diff(stamps, prepend=stamps[:1]).astype(np.float64)


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
