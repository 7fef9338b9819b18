"""The pictures of an experiment: the paper's figure, beliefs of two sequences, a confusion matrix.

The paper's figure is a panel per map size and smoothing, with a dot of accuracy by n for each selection.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from placerec.evaluation.metrics import Evaluation
from placerec.experiments.grid.config import Config
from placerec.experiments.grid.results import Row, Setting, by_seed
from placerec.figures.canvas import figure_file, place_colours
from placerec.figures.evaluation import confusion_panel, legend_panel
from placerec.figures.strip import axis_of, belief_strip
from placerec.hohmm import Beliefs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Inches.
_PANEL_WIDTH, _PANEL_HEIGHT = 6.4, 3.1
_MARKERS = "osD^v<>"
_BASELINES = (
    ("majority", "always the most frequent place", ":"),
    ("frame_wise", "each frame alone (naive Bayes)", "--"),
)
_LEARNED = "placerec learn (several dictionaries, weighed)"


def draw_figure(
    rows: Sequence[Row], plan: Config, path: Path, *, title: str, learned: Sequence[float] = (), narrow: bool = False
) -> None:
    """Draw the rows of one kind of transition: dots are means over seeds, the lines on them one standard deviation.

    Sizes are rows and smoothings columns of panels; `narrow`: all in one column. `learned`: the share
    of frames that the system of `placerec learn` has right with each seed, none where it was not run. PNG or SVG by
    suffix; MissingExtraError without matplotlib.
    """
    panels = list(product(plan.size, plan.smoothing))
    columns = 1 if narrow else len(plan.smoothing)
    lines = len(panels) // columns
    accuracy = by_seed(rows)
    baselines = {kind: by_seed(rows, attrgetter(kind)) for kind, _, _ in _BASELINES}
    values = [np.mean(seeds) for table in (accuracy, *baselines.values()) for seeds in table.values()]
    values += [np.mean(learned)] if learned else []
    lowest = max(0.0, 10 * math.floor(10 * min(values)) - 2)
    width = 4.6 if narrow else _PANEL_WIDTH * columns
    with figure_file(path, width, _PANEL_HEIGHT * lines + (1.9 if narrow else 1.3), "constrained") as figure:
        grid = figure.subplots(lines, columns, squeeze=False, sharey=True)
        for axes, (size, smoothing) in zip(grid.ravel(), panels, strict=True):
            own = [row for row in rows if (row.size, row.smoothing) == (size, smoothing)]
            settings = sorted({row.setting for row in own})
            for kind, label, style in _BASELINES:
                level = 100 * float(np.mean([np.mean(baselines[kind][setting]) for setting in settings]))
                axes.axhline(level, linestyle=style, color="0.25", linewidth=1.1, label=label, zorder=1)
            if learned:
                level = 100 * float(np.mean(learned))
                axes.axhline(level, linestyle="-.", color="0.25", linewidth=1.1, label=_LEARNED, zorder=1)
            _dots(axes, own, plan, accuracy)
            axes.set_title(f"S = {size}, {smoothing}", loc="left", fontsize=10)
            axes.set_ylim(lowest, 100.5)
        for axes in grid[:, 0]:
            axes.set_ylabel("frames right, %", fontsize=8.5)
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(
            # Columns are filled from above: the lines come first, and the selections in their order after them.
            handles,
            labels,
            loc="outside lower center",
            ncols=2 if narrow else min(4, math.ceil(len(labels) / 2)),
            frameon=False,
            fontsize=8.5,
            title="selection of words (dots), and levels to compare with (lines)",
            title_fontsize=8.5,
        )
        figure.suptitle(title, fontsize=11)


def _dots(axes: "Axes", rows: Sequence[Row], plan: Config, accuracy: Mapping[Setting, Sequence[float]]) -> None:
    size, smoothing, transition = rows[0].size, rows[0].smoothing, rows[0].transition
    selects, orders = plan.select, sorted(plan.order)
    for number, select in enumerate(selects):
        seeds = [np.array(accuracy[Setting(size, smoothing, select, order, transition)]) * 100 for order in orders]
        # Beside each other, so that no interval hides another.
        at = np.arange(len(orders)) + 0.4 / len(selects) * (number - (len(selects) - 1) / 2)
        means, errors = [one.mean() for one in seeds], [one.std(ddof=1) if len(one) > 1 else 0 for one in seeds]
        colour = tuple(place_colours(selects)[number].tolist())
        paint: Any = {"color": colour, "marker": _MARKERS[number % len(_MARKERS)], "markersize": 5.5, "label": select}
        axes.errorbar(at, means, yerr=errors, linewidth=0.6, alpha=0.95, elinewidth=1.3, capsize=2, zorder=3, **paint)
    axes.set_xticks(range(len(orders)), labels=[f"n = {order}" for order in orders], fontsize=8.5)
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(True, axis="y", color="0.9", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def draw_strips(beliefs: Sequence[Beliefs], evaluation: Evaluation, path: Path, width: float) -> None:
    """Draw the beliefs of the sequences with the most and the fewest frames right; `width` in inches."""
    scores = evaluation.sequences
    judged = [one for one in beliefs if scores[one.name].accuracy is not None]
    order = sorted(judged, key=lambda one: scores[one.name].accuracy or 0.0)
    shown = list({one.name: one for one in (order[-1], order[0])}.values())
    with figure_file(path, width, 0.9 + 2.0 * len(shown), "constrained") as figure:
        *strips, legend = figure.subplots(
            len(shown) + 1, 1, height_ratios=[1.0] * len(shown) + [0.12 * (2 + len(evaluation.places) // 2)]
        )
        axis = axis_of(shown)
        for axes, one in zip(strips, shown, strict=True):
            belief_strip(axes, one, evaluation, axis)
        axes.set_xlabel(axis.label, fontsize=7, labelpad=1)
        legend_panel(legend, evaluation.places)


def draw_confusion(evaluation: Evaluation, path: Path) -> None:
    """Draw the confusion matrix of an evaluation."""
    side = 2.0 + 0.5 * len(evaluation.places)
    with figure_file(path, side + 1.0, side, "constrained") as figure:
        confusion_panel(figure.subplots(), evaluation)
