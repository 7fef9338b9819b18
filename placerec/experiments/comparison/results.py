"""What came of a comparison of methods: a score each, every pair over the same draws; as tables and as a picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from placerec.arrays import Floats
from placerec.evaluation.bootstrap import Pair, compare_pairs, count_blocks, draw, interval
from placerec.evaluation.metrics import evaluate
from placerec.evaluation.summary import percent, shorten
from placerec.experiments.comparison.benchmark import (
    COMPARED,
    DESCRIPTORS,
    SEVERAL_WORDS,
    TWO_WORDS,
    WORDS,
    FrontEndCost,
    MethodRun,
)
from placerec.figures.canvas import figure_file, place_colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Inches.
_WIDTH, _LEAST_HEIGHT = 10.0, 5.2
_TITLE = 0.65
# The height of a label in inches, and the least cost that is drawn, in microseconds.
_LABEL, _LEAST = 0.19, 0.1
_KINDS = (WORDS, TWO_WORDS, SEVERAL_WORDS, DESCRIPTORS)


@dataclass(frozen=True)
class MethodScore:
    """A line of methods.csv; shares from 0 to 1, nats; `consulted`: the share of frames that asked a second cue."""

    method: str
    accuracy: float
    accuracy_low: float
    accuracy_high: float
    balanced_accuracy: float
    change_latency_frames: float | None
    ece: float
    microseconds_per_frame: float
    log_loss: float
    consulted: float | None = None


@dataclass(frozen=True)
class Comparison:
    """What `compare` found; `drawn`: the intervals are over so many `sequences`, or `visits` of one sequence.

    `cost`: what comes before every method; `majority`: the share of the most frequent place among the test frames.
    """

    scores: tuple[MethodScore, ...]
    pairs: tuple[Pair, ...]
    frames: int
    majority: float
    majority_place: str
    drawn: tuple[int, str]
    cost: FrontEndCost


def judge(runs: Mapping[str, MethodRun], cost: FrontEndCost, seed: int) -> Comparison:
    """The scores of all methods with intervals over the same draws, and every pair."""
    evaluations = {name: evaluate(run.beliefs) for name, run in runs.items()}
    counted = {name: count_blocks(run.beliefs) for name, run in runs.items()}
    frames, _, what = next(iter(counted.values()))
    right = {name: one for name, (_, one, _) in counted.items()}
    drawn = draw(len(frames), seed)
    scores = tuple(
        MethodScore(
            name,
            evaluation.accuracy,
            *interval(drawn, right[name], frames),
            evaluation.balanced_accuracy,
            evaluation.change_latency_frames,
            evaluation.ece,
            runs[name].microseconds,
            evaluation.log_loss,
            runs[name].consulted,
        )
        for name, evaluation in evaluations.items()
    )
    one = next(iter(evaluations.values()))
    return Comparison(
        scores,
        tuple(compare_pairs(right, frames, drawn)),
        one.frames,
        one.majority_accuracy,
        one.majority_place,
        (len(frames), what),
        cost,
    )


def format_methods(scores: Sequence[MethodScore]) -> str:
    """The text of methods.csv."""
    names = [name for name in MethodScore.__annotations__ if name != "consulted"]
    rows = ([_cell(name, getattr(score, name)) for name in names] for score in scores)
    return "".join(f"{','.join(row)}\n" for row in (names, *rows))


def format_pairs(pairs: Sequence[Pair]) -> str:
    """The text of pairs.csv: `holds` or `cannot tell`, see `Pair.holds`."""
    lines = ["first,second,difference,difference_low,difference_high,verdict"]
    for pair in pairs:
        verdict = "holds" if pair.holds else "cannot tell"
        lines.append(f"{pair.first},{pair.second},{pair.difference:.6f},{pair.low:.6f},{pair.high:.6f},{verdict}")
    return "\n".join(lines) + "\n"


def format_comparison(found: Comparison) -> str:
    """A table for a terminal, best first, without a line end at its end."""
    width = max(16, *(len(score.method) + 1 for score in found.scores))
    lines = [
        f"{'method':<{width}}{'accuracy':>9}  {'95 % interval':>15}{'balanced':>10}{'latency':>9}{'ECE':>7}"
        f"{'log loss':>10}{'us/frame':>10}"
    ]
    for s in sorted(found.scores, key=lambda score: -score.accuracy):
        latency = "-" if s.change_latency_frames is None else f"{s.change_latency_frames:g}"
        lines.append(
            f"{s.method:<{width}}{100 * s.accuracy:>7.1f} %"
            f"  {100 * s.accuracy_low:>6.1f} - {100 * s.accuracy_high:>4.1f} %{100 * s.balanced_accuracy:>8.1f} %"
            f"{latency:>9}{s.ece:>7.3f}{s.log_loss:>10.3f}{s.microseconds_per_frame:>10.1f}"
        )
    lines.append(f"{found.frames} frames; always {found.majority_place!r}: {100 * found.majority:.1f} %")
    return "\n".join(lines)


def _cell(name: str, value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:g}" if name == "change_latency_frames" else f"{value:.{2 if name.startswith('micro') else 6}f}"


def plot_comparison(found: Comparison, path: Path | str) -> None:
    """Draw every method but `majority`, which is a line; PNG, SVG or PDF by suffix. Raises as `figure_file` does."""
    scores = sorted((s for s in found.scores if s.method != "majority"), key=lambda s: (s.accuracy, s.method))
    height = max(_LEAST_HEIGHT, 1.6 + _LABEL * len(scores))
    with figure_file(path, _WIDTH, height) as figure:
        bottom = 1.0 / height
        axes = figure.add_axes((0.08, bottom, 0.66, 1 - bottom - _TITLE / height))
        _points(axes, scores)
        axes.axhline(found.majority, color="0.35", linewidth=1, linestyle=(0, (5, 3)), zorder=1)
        axes.text(
            0.01,
            found.majority,
            f"always “{shorten(found.majority_place, 24)}”: {percent(found.majority)}",
            transform=axes.get_yaxis_transform(),
            fontsize=7.5,
            color="0.35",
            va="bottom",
        )
        _limits(axes, found, scores)
        _labels(axes, scores, height * (1 - bottom) - _TITLE)
        axes.set_title(f"Accuracy on {found.frames} test frames against cost", loc="left", fontsize=11, pad=12)
        figure.text(0.08, 0.12 / height, _caption(found), fontsize=7.5, color="0.3", va="bottom", linespacing=1.4)


def _points(axes: "Axes", scores: list[MethodScore]) -> None:
    colours = place_colours(_KINDS)
    for kind, colour in zip(_KINDS, map(tuple, colours.tolist()), strict=True):
        own = [s for s in scores if _kind(s) == kind]
        if own:
            accuracy = np.array([s.accuracy for s in own])
            ends = np.array([[s.accuracy_low for s in own], [s.accuracy_high for s in own]])
            axes.errorbar(
                [max(s.microseconds_per_frame, _LEAST) for s in own],
                accuracy,
                yerr=np.abs(ends - accuracy),
                fmt="o",
                markersize=5.5,
                color=colour,
                ecolor=colour,
                elinewidth=1,
                capsize=2.5,
                label=kind,
                zorder=3,
            )
    axes.set_xscale("log")
    # Not as powers: those are formulas, and formulas are not drawn.
    axes.xaxis.set_major_formatter(lambda cost, _: f"{cost:g}")
    axes.grid(True, color="0.9", linewidth=0.7, zorder=0)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    axes.set_xlabel("microseconds per frame, after the descriptor (logarithmic)", fontsize=8.5)
    axes.set_ylabel("accuracy, with 95 % interval", fontsize=8.5)
    if scores:
        axes.legend(loc="lower right", bbox_to_anchor=(1.36, 1.02), ncols=3, fontsize=7.5, frameon=False)


def _limits(axes: "Axes", found: Comparison, scores: list[MethodScore]) -> None:
    """Room for all intervals and the line, and a tenth of the costs' range on either side."""
    low = min([found.majority, *(s.accuracy_low for s in scores)])
    high = max([found.majority, *(s.accuracy_high for s in scores)])
    axes.set_ylim(max(0.0, low - 0.05), min(1.0, high + 0.02) + 0.005)
    costs = np.log10([max(s.microseconds_per_frame, _LEAST) for s in scores] or [1.0])
    margin = 0.1 * max(1.0, float(np.ptp(costs)))
    axes.set_xlim(10 ** float(costs.min() - margin), 10 ** float(costs.max() + margin))


def _labels(axes: "Axes", scores: list[MethodScore], inches: float) -> None:
    """Names in a column on the right, in the order of accuracy and apart from each other, a thin line to each point."""
    low, high = axes.get_ylim()
    wanted = (np.array([s.accuracy for s in scores]) - low) / (high - low)
    colours = place_colours(_KINDS).tolist()
    for score, at in zip(scores, spread(wanted, _LABEL / inches).tolist(), strict=True):
        point = (max(score.microseconds_per_frame, _LEAST), score.accuracy)
        axes.annotate(
            f"{score.method}  {percent(score.accuracy)}",
            xy=point,
            xytext=(1.03, at),
            textcoords="axes fraction",
            fontsize=8,
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": (*colours[_KINDS.index(_kind(score))], 0.6),
                "linewidth": 0.7,
                "shrinkA": 1,
                "shrinkB": 3,
                "relpos": (0, 0.5),
            },
        )


def spread(wanted: Floats, apart: float) -> Floats:
    """Ascending positions (n,) moved as little as it takes to be `apart`, within 0..1 where there is room.

    Groups that touch share their middle: the least squares of the moves, by pooling neighbours.
    """
    steps = apart * np.arange(len(wanted))
    groups: list[tuple[float, int]] = []
    for target in (wanted - steps).tolist():
        mean, size = target, 1
        while groups and groups[-1][0] >= mean:
            before, many = groups.pop()
            mean, size = (before * many + mean * size) / (many + size), many + size
        groups.append((mean, size))
    placed = np.repeat([mean for mean, _ in groups], [size for _, size in groups]) if groups else np.empty(0)
    highest = max(0.0, 1.0 - (steps[-1] if len(steps) else 0.0))
    moved: Floats = np.clip(placed, 0.0, highest) + steps
    return moved


def _kind(score: MethodScore) -> str:
    return COMPARED[score.method].kind if score.method in COMPARED else WORDS


def _caption(found: Comparison) -> str:
    number, what = found.drawn
    over = f"over {number} test sequences" if what == "sequences" else f"over the {number} visits of one sequence"
    lines = [
        f"Intervals: bootstrap {over}. Cost: one frame at a time, from its word or its components to the belief;",
        f"before it, each needs the descriptor ({found.cost.descriptor / 1000:.1f} ms) and its components or word "
        f"({found.cost.word:.0f} µs).",
    ]
    for score in found.scores:
        if score.consulted is not None:
            lines[-1] += f" {score.method}: with the second descriptor, for {percent(score.consulted)} of the frames."
    return "\n".join(lines)
