"""One picture of an evaluation: every sequence's beliefs under its true places, what was confused, and how surely."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from placerec.evaluation.metrics import Evaluation
from placerec.evaluation.summary import percent, shorten
from placerec.figures.curves import coverage_panel, reliability_panel, roc_panel
from placerec.figures.panels import belief_strip, confusion_panel, figure_file, legend_panel, strip_title
from placerec.hohmm.beliefs import Beliefs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_STRIPS = 20

# Inches.
_WIDTH, _MARGIN, _HEAD = 14.0, 0.3, 1.15
_STRIP_LEFT, _STRIP_WIDTH = 0.75, 7.6
_SIDE_LEFT, _MATRIX_LEFT = 8.75, 10.3
_CURVES_LEFT, _CURVE, _CURVE_STEP, _CURVES_HEIGHT = 9.1, 1.95, 2.55, 2.9


def plot_evaluation(beliefs: Sequence[Beliefs], evaluation: Evaluation, path: Path | str) -> None:
    """Draw beliefs, confusion matrix and how far to trust them into one picture; PNG, SVG or PDF by suffix.

    beliefs: those that `evaluation` judged. Of more than 20 sequences the best, the worst and evenly many between are
    drawn, and the picture says so. The same numbers give the same bytes. Raises OutputError for another suffix or a
    path that cannot be written, MissingExtraError without matplotlib.
    """
    shown = chosen(beliefs, evaluation)
    places = len(evaluation.places)
    matrix = min(_WIDTH - _MARGIN - _MATRIX_LEFT, 0.6 * places)
    legend = 0.23 * (places // 2 + 2)
    side = legend + matrix + 2.0
    # The curves stand below one sequence, or else below the matrix.
    below = len(shown) == 1 and side >= 2.5 + _CURVES_HEIGHT
    left, top = (_STRIP_LEFT, 2.8) if below else (_CURVES_LEFT, side + 0.15)
    side = side if below else side + _CURVES_HEIGHT - 0.3
    # Few strips are as high as the side beside them, many as low as can be read.
    strip = min(2.0, max(0.68, 5 / len(shown), side / len(shown) - 0.45))
    step = strip + 0.42
    height = _HEAD + max(step * len(shown) + 0.15, side)
    with figure_file(path, _WIDTH, height) as figure:

        def panel(left: float, top: float, wide: float, high: float) -> "Axes":
            return figure.add_axes((left / _WIDTH, 1 - (top + high) / height, wide / _WIDTH, high / height))

        _head(figure, evaluation, _selection_note(len(shown), len(beliefs)))
        for number, sequence in enumerate(shown):
            axes = panel(_STRIP_LEFT, _HEAD + 0.1 + step * number, _STRIP_WIDTH, strip)
            title = strip_title(sequence.name, evaluation.sequences[sequence.name].accuracy)
            belief_strip(axes, sequence, places=evaluation.places, title=title)
        axes.set_xlabel("frame", fontsize=7, labelpad=1)
        legend_panel(panel(_SIDE_LEFT, _HEAD, _WIDTH - _MARGIN - _SIDE_LEFT, legend), evaluation.places)
        confusion_panel(panel(_MATRIX_LEFT, _HEAD + legend + 0.5, matrix, matrix), evaluation)
        reliability_panel(panel(left, _HEAD + top, _CURVE, _CURVE), evaluation.reliability)
        beside = panel(left + _CURVE_STEP, _HEAD + top, _CURVE, _CURVE)
        if evaluation.new_places is not None and evaluation.new_places.auroc is not None:
            roc_panel(beside, evaluation.new_places)
        else:
            coverage_panel(beside, evaluation.risk_coverage)


def chosen(beliefs: Sequence[Beliefs], evaluation: Evaluation, most: int = MOST_STRIPS) -> list[Beliefs]:
    """At most `most` sequences, in their order: the best, the worst and evenly many between by accuracy.

    Sequences without a label come after all others.
    """
    if len(beliefs) <= most:
        return list(beliefs)

    def rank(index: int) -> float:
        accuracy = evaluation.sequences[beliefs[index].name].accuracy
        return -1.0 if accuracy is None else accuracy

    judged = [index for index in range(len(beliefs)) if rank(index) >= 0]
    ranked = sorted(judged if len(judged) >= most else range(len(beliefs)), key=rank, reverse=True)
    picked = np.linspace(0, len(ranked) - 1, most).round().astype(int)
    return [beliefs[index] for index in sorted(ranked[pick] for pick in picked)]


def _head(figure: "Figure", evaluation: Evaluation, note: str) -> None:
    majority = f"always “{shorten(evaluation.majority_place, 40)}”: {percent(evaluation.majority_accuracy)}"
    latency = evaluation.change_latency_frames
    numbers = [
        f"{evaluation.frames} frames judged",
        *([f"{evaluation.unlabelled} without a label left out"] if evaluation.unlabelled else []),
        f"balanced accuracy {percent(evaluation.balanced_accuracy)}",
        *([] if latency is None else [f"new place noticed after {latency:g} frames (median)"]),
        f"ECE {evaluation.ece:.3f}",
        f"log loss {evaluation.log_loss:.3f}",
    ]
    height = figure.get_figheight()
    lines = [
        (0.38, 15, "black", f"Accuracy {percent(evaluation.accuracy)}   (majority class, {majority})"),
        (0.64, 9, "0.25", "  ·  ".join(numbers)),
        (0.86, 8, "0.4", note),
    ]
    for top, size, colour, text in lines:
        figure.text(_MARGIN / _WIDTH, 1 - top / height, text, fontsize=size, color=colour)


def _selection_note(shown: int, all_of_them: int) -> str:
    reading = "Each strip is one sequence; the belief in each place is the height of its colour."
    if shown == all_of_them:
        return reading
    return f"{reading} {shown} of {all_of_them} sequences: the best, the worst and evenly many between by accuracy."
