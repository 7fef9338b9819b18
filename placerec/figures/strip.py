"""One sequence as a strip over time: true places, beliefs stacked to 1, what was decided, and where that is wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.evaluation.metrics import Evaluation, right_frames
from placerec.evaluation.summary import percent, shorten
from placerec.figures.canvas import BLACK, LETTER, WHITE, inches, letter_colour, place_colours
from placerec.frames.table import Labels
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# More columns than this would fall between the pixels of a strip.
_MOST_COLUMNS = 1500
_BELIEF_ROWS = 120

# Where the bars of a strip lie, in units of the belief's height.
_TRUE, _DECIDED, _WRONG = (1.07, 1.43), (-0.33, -0.07), (-0.55, -0.41)

# After a frame without a follower for so many times the usual step nothing is drawn, until the next frame.
_GAP = 5.0
# Seconds of a unit of the time axis, and how many of them a drive should have to be told in it.
_UNITS = ((1.0, "s", 0.0), (60.0, "min", 10.0), (3600.0, "h", 3.0))


@dataclass(frozen=True)
class Axis:
    """What strips are drawn over, one scale for all: frames, or time from each sequence's first frame on.

    `seconds`: of one unit of time, None for frames; `end`: of the longest sequence, in these units.
    """

    label: str
    seconds: float | None
    end: float


def axis_of(beliefs: Sequence[Beliefs]) -> Axis:
    """Time where every frame has one and none goes back, else frames."""
    longest = max((len(one) for one in beliefs), default=0)
    if not longest or not all(timed(one.times) for one in beliefs):
        return Axis("frame", None, max(longest, 1))
    end = max(float(_edges(one.times)[-1]) for one in beliefs if len(one))
    seconds, name = next((size, name) for size, name, least in reversed(_UNITS) if end >= least * size)
    return Axis(f"time from the first frame, {name}", seconds, end / seconds)


def timed(times: Floats) -> bool:
    """Whether times in seconds (n,) can be an axis: all are known, none goes back, and they are not all one."""
    return bool(np.isfinite(times).all() and (np.diff(times) >= 0).all() and (len(times) < 2 or times[-1] > times[0]))


def _edges(times: Floats) -> Floats:
    """Where each frame of n > 0 begins, and where the last one ends, seconds from the first, (n + 1,)."""
    since = times - times[0]
    return np.append(since, since[-1] + _step(times))


def _step(times: Floats) -> float:
    """The usual time between two frames; 1 where there is one frame alone."""
    steps = np.diff(times)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


@dataclass(frozen=True)
class _Columns:
    """The m columns of a strip: `frame` of each, -1 where there is none, and `edges` (m + 1,) in units of the axis."""

    frame: Ints
    edges: Floats

    @staticmethod
    def of(beliefs: Beliefs, axis: Axis) -> "_Columns":
        n = len(beliefs)
        drawn = np.unique(np.linspace(0, n - 1, min(n, _MOST_COLUMNS)).round().astype(np.int64))
        if axis.seconds is None:
            return _Columns(drawn, np.append(drawn, n).astype(np.float64))
        edges = _edges(beliefs.times) / axis.seconds
        starts, ends = edges[drawn], edges[np.append(drawn[1:], n)]
        # A frame holds until the next one, where that is not long gone.
        most = _GAP * max(_step(beliefs.times) / axis.seconds, float(np.median(ends - starts)))
        held = np.minimum(ends, starts + most)
        gap = held < ends
        frame = np.stack([drawn, np.full(len(drawn), -1)], axis=1)[np.stack([np.ones(len(drawn), bool), gap], axis=1)]
        left = np.stack([starts, held], axis=1)[np.stack([np.ones(len(drawn), bool), gap], axis=1)]
        return _Columns(frame, np.append(left, edges[-1]))


def belief_strip(axes: "Axes", beliefs: Beliefs, evaluation: Evaluation, axis: Axis | None = None) -> None:
    """Draw one sequence: true places on top, the beliefs stacked to 1, decided places below, black where wrong.

    With a column `unknown` its share comes on top of the places', which are drawn as much lower. Of a long sequence
    evenly spaced frames are drawn. `evaluation`: of all sequences of the picture, which give the places their colours.
    `axis`: that of all of them, if it is not the sequence's own.
    """
    axis = axis or axis_of([beliefs])
    places, accuracy = evaluation.places, evaluation.sequences[beliefs.name].accuracy
    right = "no frame has a label" if accuracy is None else f"{percent(accuracy)} right"
    frames = len(beliefs.frames)
    # One more colour than places: the last answers for index -1, no label.
    colours = np.vstack([place_colours(places), WHITE])
    axes.set(xlim=(0, axis.end), ylim=(_WRONG[0] - 0.05, _TRUE[1]), facecolor="none")
    axes.spines[:].set_visible(False)
    heights = [sum(span) / 2 for span in (_TRUE, (0, 1), _DECIDED, _WRONG)]
    axes.set_yticks(heights, labels=["true", "belief", "decided", "wrong"], fontsize=6.5)
    axes.tick_params(axis="x", labelsize=6.5, length=2, pad=1.5)
    axes.tick_params(axis="y", length=0, pad=2)
    axes.set_title(f"{shorten(beliefs.name, 70)}   {right}", loc="left", fontsize=8.5, pad=3)
    if not frames:
        axes.text(0.5, 0.5, "no frames", ha="center", va="center", fontsize=8, color="0.4")
        return
    truth, decided = beliefs.stream.table.places.codes(places), Labels(beliefs.best).codes(places)
    columns = _Columns.of(beliefs, axis)
    shown, there = columns.frame, columns.frame >= 0
    if there.sum() < frames:
        axes.set_title(f"{there.sum()} of {frames} frames are drawn", loc="right", fontsize=6.5, color="0.4", pad=3)
    wrong = ~right_frames(beliefs) & (truth >= 0)
    stacked = np.full((_BELIEF_ROWS, len(shown)), -1)
    stacked[:, there] = _stacked(*_shares(beliefs, shown[there], places))
    bars = [
        (_TRUE, colours[np.where(there, truth[shown], -1)][None]),
        ((0.0, 1.0), colours[stacked]),
        (_DECIDED, colours[np.where(there, decided[shown], -1)][None]),
        (_WRONG, np.where((there & wrong[shown])[:, None], BLACK, WHITE)[None]),
    ]
    for (low, high), image in bars:
        axes.pcolorfast(columns.edges, np.linspace(low, high, len(image) + 1), image)
    axes.set(xlim=(0, axis.end), ylim=(_WRONG[0] - 0.05, _TRUE[1]))
    _name_visits(axes, np.where(there, truth[shown], -1), columns.edges, places)


def _shares(beliefs: Beliefs, drawn: Ints, places: Sequence[str]) -> tuple[Floats, Ints]:
    """The probabilities of the frames `drawn` (n, columns), and the place of each column."""
    belief = beliefs.belief[drawn]
    if beliefs.unknown is None:
        return belief, Labels(beliefs.places).codes(places)
    unknown = beliefs.unknown[drawn, None]
    return np.hstack([belief * (1 - unknown), unknown]), Labels((*beliefs.places, UNKNOWN_PLACE)).codes(places)


def _stacked(belief: Floats, place: Ints) -> Ints:
    """The place at every height of the stacked beliefs: (rows from 0 to 1, frames)."""
    heights = (np.arange(_BELIEF_ROWS) + 0.5) / _BELIEF_ROWS
    below = (np.cumsum(belief, axis=1)[None] <= heights[:, None, None]).sum(axis=2)
    # Rounding may leave the sum a hair under 1.
    stacked: Ints = place[np.minimum(below, len(place) - 1)]
    return stacked


def _name_visits(axes: "Axes", truth: Ints, edges: Floats, places: Sequence[str]) -> None:
    """Write a place's name into its bar where there is room: colours alone are hard to look up."""
    font = 6.5
    room = inches(axes) * 72 / axes.get_xlim()[1]
    starts = np.concatenate(([0], np.flatnonzero(np.diff(truth)) + 1))
    colours = place_colours(places)
    for start, end in zip(starts, [*starts[1:], len(truth)], strict=True):
        place = int(truth[start])
        left, right = edges[start], edges[end]
        if place >= 0 and (right - left) * room > LETTER * font * (len(places[place]) + 1):
            colour = letter_colour(colours[place])
            spot = ((left + right) / 2, sum(_TRUE) / 2 - 0.02)
            axes.text(*spot, places[place], ha="center", va="center", fontsize=font, color=colour)
