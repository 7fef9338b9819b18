"""Beliefs files to an evaluation, and its picture: beliefs under the true places, what was confused, how surely."""

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from placerec.errors import EvaluationError
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.evaluation.summary import percent, shorten
from placerec.figures.canvas import MARGIN, check_figure, figure_file, panel, write_line
from placerec.figures.panels import (
    belief_strip,
    confusion_panel,
    coverage_panel,
    legend_panel,
    reliability_panel,
    roc_panel,
)
from placerec.frames.naming import unique_names
from placerec.hohmm.beliefs import Beliefs, parse_beliefs, read_beliefs
from placerec.words.folder import is_stream

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_STRIPS = 20

# Inches.
_WIDTH, _HEAD = 14.0, 1.15
_STRIP_LEFT, _STRIP_WIDTH = 0.75, 7.6
_SIDE_LEFT, _MATRIX_LEFT = 8.75, 10.3
_CURVES_LEFT, _CURVE, _CURVE_STEP, _CURVES_HEIGHT = 9.1, 1.95, 2.55, 2.9


def evaluate_files(sources: Iterable[Path | str], *, plot: Path | str | None = None) -> Evaluation:
    """Judge beliefs files, folders of them, or standard input (`-`) by their true places; `plot` gets the picture.

    Files of one name are called by their folders too. Raises EvaluationError for what cannot be read or judged, and
    what `plot_evaluation` raises.
    """
    if plot is not None:
        check_figure(plot)
    paths = _files([Path(source) for source in sources])
    beliefs = [_read(path) for path in paths]
    names = unique_names([(one.name, path) for one, path in zip(beliefs, paths, strict=True)], EvaluationError)
    beliefs = [replace(one, stream=one.stream.renamed(name)) for one, name in zip(beliefs, names, strict=True)]
    evaluation = evaluate(beliefs)
    if plot is not None:
        plot_evaluation(beliefs, evaluation, plot)
    return evaluation


def plot_evaluation(beliefs: Sequence[Beliefs], evaluation: Evaluation, path: Path | str) -> None:
    """Draw beliefs, confusion matrix and how far to trust them into one picture; PNG, SVG or PDF by suffix.

    beliefs: those that `evaluation` judged. Of more than 20 sequences the best, the worst and evenly many between are
    drawn, and the picture says so. The same numbers give the same bytes. Raises OutputError for another suffix or a
    path that cannot be written, MissingExtraError without matplotlib.
    """
    shown = chosen(beliefs, evaluation)
    places = len(evaluation.places)
    matrix = min(_WIDTH - MARGIN - _MATRIX_LEFT, 0.6 * places)
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
        _head(figure, evaluation)
        reading = "Each strip is one sequence; the belief in each place is the height of its colour."
        some = f" {len(shown)} of {len(beliefs)} sequences: the best, the worst and evenly many between by accuracy."
        write_line(figure, 0.86, reading + some * (len(shown) < len(beliefs)), 8, "0.4")
        for number, sequence in enumerate(shown):
            axes = panel(figure, _STRIP_LEFT, _HEAD + 0.1 + step * number, _STRIP_WIDTH, strip)
            belief_strip(axes, sequence, evaluation)
        axes.set_xlabel("frame", fontsize=7, labelpad=1)
        legend_panel(panel(figure, _SIDE_LEFT, _HEAD, _WIDTH - MARGIN - _SIDE_LEFT, legend), evaluation.places)
        confusion_panel(panel(figure, _MATRIX_LEFT, _HEAD + legend + 0.5, matrix, matrix), evaluation)
        reliability_panel(panel(figure, left, _HEAD + top, _CURVE, _CURVE), evaluation.reliability)
        beside = panel(figure, left + _CURVE_STEP, _HEAD + top, _CURVE, _CURVE)
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


def _head(figure: "Figure", evaluation: Evaluation) -> None:
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
    write_line(figure, 0.38, f"Accuracy {percent(evaluation.accuracy)}   (majority class, {majority})", 15)
    write_line(figure, 0.64, "  ·  ".join(numbers), 9, "0.25")


def _files(sources: list[Path]) -> list[Path]:
    files: dict[str, Path] = {}
    for source in sources:
        found = sorted(path for path in source.iterdir() if is_stream(path)) if source.is_dir() else [source]
        if not found:
            raise EvaluationError(f"{source}: holds no beliefs file (.tsv); write them with `placerec decode -o`")
        for path in found:
            if files.setdefault(os.path.abspath(path), path) is not path:
                raise EvaluationError(f"{path}: is given twice; its frames would count twice")
    return list(files.values())


def _read(path: Path) -> Beliefs:
    if str(path) != "-":
        return read_beliefs(path)
    try:
        return parse_beliefs(sys.stdin.buffer.read().decode(), name="stdin", source="<stdin>")
    except UnicodeDecodeError as error:
        raise EvaluationError(f"<stdin>: byte 0x{error.object[error.start]:02x} is not UTF-8") from error
