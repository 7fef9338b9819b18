"""The picture of a comparison: a row per method, the best on top, with the accuracy's interval and the cost beside."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from placerec.arrays import Floats
from placerec.evaluation.bootstrap import LEAST
from placerec.evaluation.summary import percent, shorten
from placerec.experiments.comparison.methods import DESCRIPTORS, SEVERAL_WORDS, TWO_WORDS, WORDS, method_of
from placerec.experiments.comparison.results import Comparison, MethodScore
from placerec.figures.canvas import MARGIN, figure_file, panel, place_colours, write_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Inches.
_WIDTH, _ROW, _HEAD, _FOOT = 10.0, 0.235, 1.12, 1.35
_NAMES, _ACCURACY, _SHARES, _COST = 1.65, 4.6, 0.75, 2.2
# What a letter of a name takes; long names make the figure wider.
_LETTER = 0.08
# The least cost that is drawn, in microseconds.
_LEAST_COST = 0.1
_SHADE, _SOFT = "0.945", "0.35"
_KINDS = (WORDS, SEVERAL_WORDS, TWO_WORDS, DESCRIPTORS)


def plot_comparison(found: Comparison, path: Path | str) -> None:
    """Draw every method but `majority`, which is a line; PNG, SVG or PDF by suffix. Raises as `figure_file` does.

    Filled dots are the best method and those that cannot be told from it.
    """
    scores = [score for score in found.best_first() if score.method != "majority"]
    rows = max(len(scores), 1)
    names = max([_NAMES, *(_LETTER * len(score.method) for score in scores)])
    with figure_file(path, _WIDTH + names - _NAMES, _HEAD + _ROW * rows + _FOOT) as figure:
        write_line(figure, 0.4, f"Accuracy on {found.frames} test frames, and cost", 13)
        left = MARGIN + names
        accuracy = panel(figure, left, _HEAD, _ACCURACY, _ROW * rows)
        cost = panel(figure, left + _ACCURACY + _SHARES, _HEAD, _COST, _ROW * rows)
        equals = found.not_told_from_best() if found.pairs else set()
        for axes in (accuracy, cost):
            _rows(axes, scores, equals)
        accuracy.set_yticks(range(len(scores)), labels=[score.method for score in scores], fontsize=8.5)
        for label, score in zip(accuracy.get_yticklabels(), scores, strict=True):
            label.set_fontweight("bold" if score.method in equals else "normal")
        _accuracy(accuracy, found, scores, equals)
        _cost(cost, scores, equals)
        _legend(figure, scores, left, bool(equals))
        for line, text in enumerate(_caption(found)):
            write_line(figure, _HEAD + _ROW * rows + 0.8 + 0.17 * line, text, 7.5, "0.3")


def _rows(axes: "Axes", scores: Sequence[MethodScore], equals: set[str]) -> None:
    """The rows from above; those that cannot be told from the best have a shade."""
    for row, score in enumerate(scores):
        if score.method in equals:
            axes.axhspan(row - 0.5, row + 0.5, color=_SHADE, linewidth=0, zorder=0)
    axes.set_ylim(max(len(scores), 1) - 0.5, -0.5)
    axes.set_yticks([])
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0, pad=6)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(True, axis="x", color="0.88", linewidth=0.7)
    axes.set_axisbelow(True)


def _accuracy(axes: "Axes", found: Comparison, scores: Sequence[MethodScore], equals: set[str]) -> None:
    for row, score in enumerate(scores):
        ends = np.array([[score.accuracy - score.accuracy_low], [score.accuracy_high - score.accuracy]])
        paint = _paint(score, equals)
        interval: dict[str, Any] = {"ecolor": paint["color"], "elinewidth": 1.2, "capsize": 2.5}
        axes.errorbar([100 * score.accuracy], [row], xerr=100 * np.abs(ends), **paint, **interval)
        share = axes.text(1.02, row, percent(score.accuracy), fontsize=8.5, va="center")
        share.set_transform(axes.get_yaxis_transform())
        share.set_fontweight("bold" if score.method in equals else "normal")
    low = 100 * min([found.majority, *(score.accuracy_low for score in scores)])
    high = 100 * max([found.majority, *(score.accuracy_high for score in scores)])
    axes.set_xlim(max(0.0, low - 3), min(100.0, high + 2) + 0.5)
    axes.axvline(100 * found.majority, color=_SOFT, linewidth=1, linestyle=(0, (5, 3)), zorder=1)
    text = f"always “{shorten(found.majority_place, 24)}”: {percent(found.majority)}"
    right = 100 * found.majority > sum(axes.get_xlim()) / 2
    side: dict[str, Any] = {"ha": "right"} if right else {"ha": "left"}
    axes.annotate(
        text,
        (100 * found.majority, -0.5),
        (0, 4),
        textcoords="offset points",
        fontsize=7.5,
        color=_SOFT,
        annotation_clip=False,
        **side,
    )
    axes.set_xlabel("frames right, %, with 95 % interval", fontsize=8.5)


def _cost(axes: "Axes", scores: Sequence[MethodScore], equals: set[str]) -> None:
    for row, score in enumerate(scores):
        axes.plot([max(score.microseconds_per_frame, _LEAST_COST)], [row], **_paint(score, equals))
    costs: Floats = np.log10([max(score.microseconds_per_frame, _LEAST_COST) for score in scores] or [1.0])
    margin = 0.1 * max(1.0, float(np.ptp(costs)))
    axes.set_xscale("log")
    # Not as powers: those are formulas, and formulas are not drawn.
    axes.xaxis.set_major_formatter(lambda cost, _: f"{cost:g}")
    axes.xaxis.set_minor_formatter(lambda cost, _: "")
    axes.set_xlim(10 ** float(costs.min() - margin), 10 ** float(costs.max() + margin))
    axes.set_xlabel("µs per frame, after the descriptor (logarithmic)", fontsize=8.5)


def _paint(score: MethodScore, equals: set[str]) -> dict[str, Any]:
    """How a method's dot is drawn: its colour says what the method sees, filled is told below."""
    colour = tuple(place_colours(_KINDS)[_KINDS.index(_kind(score))].tolist())
    filled = not equals or score.method in equals
    return {
        "marker": "o",
        "linestyle": "none",
        "color": colour,
        "markersize": 6,
        "markeredgewidth": 1.4,
        "markerfacecolor": colour if filled else "white",
        "zorder": 3,
    }


def _legend(figure: "Figure", scores: Sequence[MethodScore], left: float, told: bool) -> None:
    """What colours and filled dots mean, above the rows."""
    from matplotlib.lines import Line2D

    shown = [kind for kind in _KINDS if kind in map(_kind, scores)]
    colours = dict(zip(_KINDS, place_colours(_KINDS).tolist(), strict=True))
    dots = [Line2D([], [], marker="o", linestyle="none", markersize=6, color=colours[k], label=k) for k in shown]
    grey: dict[str, Any] = {"marker": "o", "linestyle": "none", "markersize": 6, "color": _SOFT, "markeredgewidth": 1.4}
    marks = [
        Line2D([], [], **grey, label="the best, or cannot be told from it"),
        Line2D([], [], **grey, markerfacecolor="white", label="behind the best"),
    ]
    width, height = figure.get_size_inches()
    at = {"frameon": False, "fontsize": 8, "title_fontsize": 8, "alignment": "left", "borderaxespad": 0}
    placed = ("the method sees", dots, (left, 0.52)), ("its accuracy is", marks if told else [], (5.1, 0.12))
    for title, handles, (right, top) in placed:
        if handles:
            spot = (right / width, 1 - top / height)
            columns = len(handles)
            legend = figure.legend(
                handles=handles, title=title, loc="upper left", bbox_to_anchor=spot, ncols=columns, **at
            )
            legend.get_title().set_color(_SOFT)


def _kind(score: MethodScore) -> str:
    return method_of(score.method).kind


def _caption(found: Comparison) -> list[str]:
    number, what = found.drawn
    over = f"{number} test sequences" if what == "sequences" else f"the {number} visits of one sequence"
    few = f" Fewer than {LEAST}: no method can be told from another." if number < LEAST else ""
    own = found.cost.descriptor
    described = "computed elsewhere" if math.isnan(own) else f"{own / 1000:.1f} ms"
    lines = [
        f"Intervals: bootstrap over {over}.{few} Bold: the best, and those whose difference to it may be chance.",
        "Cost: one frame at a time, from its word or its components to the belief; before, each needs the descriptor "
        f"({described}) and its components or word ({found.cost.word:.0f} µs).",
    ]
    for score in found.scores:
        if score.consulted is not None:
            lines.append(f"{score.method}: with the second descriptor, for {percent(score.consulted)} of the frames.")
    return lines
