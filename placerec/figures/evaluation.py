"""Beliefs files to an evaluation, and its picture: beliefs under the true places, what was confused, how surely."""

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from placerec.errors import EvaluationError, counted
from placerec.evaluation.confidence import COVERAGES, ECE_BINS, NewPlaces, Reliability, RiskCoverage
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.evaluation.summary import percent, shorten
from placerec.figures.canvas import (
    BLACK,
    LETTER,
    MARGIN,
    WHITE,
    check_figure,
    figure_file,
    inches,
    panel,
    place_colours,
    place_title,
    write_line,
)
from placerec.figures.strip import axis_of, belief_strip
from placerec.frames.doubts import warn_of_still_sequences, warn_of_strange_labels
from placerec.frames.naming import unique_names
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs, parse_beliefs, read_beliefs
from placerec.methods.made_by import makers_of
from placerec.words.folder import is_stream

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_STRIPS = 20

# Inches.
_WIDTH, _HEAD = 14.0, 1.15
_STRIP_LEFT, _STRIP_WIDTH = 0.75, 7.6
_SIDE_LEFT, _MATRIX_LEFT = 8.75, 10.3
_CURVES_LEFT, _CURVE, _CURVE_STEP, _CURVES_HEIGHT = 9.1, 1.95, 2.55, 3.5
# The bars of how many frames a bin of the reliability has, and what is free above them.
_BINS, _BINS_GAP = 0.5, 0.12

_BLUE, _GREY = "#4a90c2", "0.55"


def confusion_panel(axes: "Axes", evaluation: Evaluation) -> None:
    """Draw the confusion matrix: frames as numbers, each row coloured by its shares."""
    counts = evaluation.confusion
    size = len(counts)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, interpolation="nearest")
    names = [shorten(place, 18) for place in evaluation.places]
    titles = [shorten(place_title(place), 24) for place in evaluation.places]
    cell = inches(axes) * 72 / size
    axes.set_xticks(range(size), labels=names, rotation=90, fontsize=min(8, cell))
    axes.set_yticks(range(size), labels=titles, fontsize=min(8, cell))
    axes.tick_params(length=0, pad=3)
    axes.set_xlabel("decided place", fontsize=8)
    axes.set_ylabel("true place", fontsize=8, labelpad=6)
    axes.set_title("Confusion matrix: frames, darker for more of the row", loc="left", fontsize=8.5)
    axes.spines[:].set_color("0.7")
    font = min(9.0, cell / (LETTER * (1 + len(str(counts.max())))))
    # Numbers that nobody can read only hide the colours.
    for row, column in np.argwhere(counts) if font >= 3.5 else []:
        colour = "white" if shares[row, column] > 0.55 else "black"
        text = str(counts[row, column])
        axes.text(column, row, text, ha="center", va="center", fontsize=font, color=colour)


def legend_panel(axes: "Axes", places: Sequence[str]) -> None:
    """Draw which colour is which place, and what black and white mean."""
    from matplotlib.patches import Patch

    colours = [*map(tuple, place_colours(places).tolist()), BLACK, WHITE]
    labels = [*(shorten(place_title(place), 24) for place in places), "decided wrongly", "no label"]
    patches = [
        Patch(facecolor=colour, edgecolor="0.5", linewidth=0.5, label=label)
        for colour, label in zip(colours, labels, strict=True)
    ]
    axes.axis("off")
    axes.legend(handles=patches, loc="upper left", ncols=2, frameon=False, fontsize=8, borderaxespad=0)


def reliability_panel(axes: "Axes", below: "Axes", found: Reliability) -> None:
    """Draw accuracy over belief in 15 bins, on the diagonal is calibrated; `below` it the frames of each bin."""
    edges = np.arange(ECE_BINS) / ECE_BINS
    some = found.frames > 0
    axes.plot([0, 1], [0, 1], color=_GREY, linewidth=0.8, linestyle="--")
    axes.vlines(found.belief[some], found.belief[some], found.accuracy[some], color=_BLUE, linewidth=1.2, alpha=0.6)
    # The area of a dot tells of the frames behind it.
    share = found.frames[some] / found.frames.max(initial=1)
    axes.scatter(found.belief[some], found.accuracy[some], s=8 + 40 * share, color=_BLUE, linewidths=0, zorder=3)
    _square(axes, f"Reliability: ECE {found.error:.3f}", "", "right")
    axes.tick_params(labelbottom=False)
    below.bar(edges, found.frames, 1 / ECE_BINS, align="edge", color=_BLUE, alpha=0.6, edgecolor="white")
    for edge, frames in zip(edges[some].tolist(), found.frames[some].tolist(), strict=True):
        below.text(edge + 0.5 / ECE_BINS, frames, str(frames), rotation=90, ha="center", va="bottom", fontsize=5.5)
    _square(below, "", "belief in what was decided, in 15 bins", "frames")
    below.set_yscale("log")
    below.set(ylim=(0.7, 60 * max(1, found.frames.max(initial=1))), yticks=[], yticklabels=[])
    below.minorticks_off()


def coverage_panel(axes: "Axes", found: RiskCoverage) -> None:
    """Draw the accuracy of the surest frames over their share."""
    axes.plot(COVERAGES, found.accuracy, color=_BLUE, marker="o", markersize=2.5, linewidth=1.2)
    _square(axes, f"Only the surest answered: area {found.area:.3f}", "share of frames answered", "right of these")


def roc_panel(axes: "Axes", found: NewPlaces) -> None:
    """Draw how many frames of new places are noticed over how many others are taken for new; needs both kinds."""
    axes.plot(found.false_alarms, found.detections, color=_BLUE, linewidth=1.2)
    _square(axes, f"New places: AUROC {found.auroc:.3f}", "known places taken for new", "new places noticed")
    axes.plot([0, 1], [0, 1], color=_GREY, linewidth=0.8, linestyle="--")


def _square(axes: "Axes", title: str, across: str, up: str) -> None:
    axes.set(xlim=(0, 1), ylim=(0, 1.02))
    axes.set_title(title, loc="left", fontsize=8.5)
    axes.set_xlabel(across, fontsize=7, labelpad=2)
    axes.set_ylabel(up, fontsize=7, labelpad=2)
    axes.tick_params(labelsize=6.5, length=2, pad=1.5)
    axes.spines[["top", "right"]].set_visible(False)


def evaluate_files(sources: Iterable[Path | str], *, plot: Path | str | None = None) -> Evaluation:
    """Judge beliefs files, folders of them, or standard input (`-`) by their true places; `plot` gets the picture.

    Files of one name are called by their folders too. A warning tells of test sequences that all hold one place
    throughout, and of labels that no column has. Raises EvaluationError for what cannot be read or judged, and
    what `plot_evaluation` raises.
    """
    if plot is not None:
        check_figure(plot)
    named = read_files(sources)
    names = unique_names([(one.name, path) for path, one in named], EvaluationError)
    beliefs = [replace(one, stream=one.stream.renamed(name)) for (_, one), name in zip(named, names, strict=True)]
    evaluation = replace(evaluate(beliefs), made_by=makers_of(path for path, _ in named))
    warn_of_still_sequences(one.truth for one in beliefs)
    columns = dict.fromkeys(place for one in beliefs for place in (*one.places, UNKNOWN_PLACE))
    warn_of_strange_labels((one.truth for one in beliefs), [*columns], any(one.unknown is not None for one in beliefs))
    if plot is not None:
        plot_evaluation(beliefs, evaluation, plot)
    return evaluation


def read_files(sources: Iterable[Path | str]) -> list[tuple[Path, Beliefs]]:
    """Read beliefs files, all of folders of them, or standard input (`-`), each with its path.

    Raises EvaluationError for what cannot be read, for a folder without such files, and for a file that comes twice.
    """
    return [(path, _read(path)) for path in _files([Path(source) for source in sources])]


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
        axis = axis_of(shown)
        for number, sequence in enumerate(shown):
            axes = panel(figure, _STRIP_LEFT, _HEAD + 0.1 + step * number, _STRIP_WIDTH, strip)
            belief_strip(axes, sequence, evaluation, axis)
        axes.set_xlabel(axis.label, fontsize=7, labelpad=1)
        legend_panel(panel(figure, _SIDE_LEFT, _HEAD, _WIDTH - MARGIN - _SIDE_LEFT, legend), evaluation.places)
        confusion_panel(panel(figure, _MATRIX_LEFT, _HEAD + legend + 0.5, matrix, matrix), evaluation)
        bins = panel(figure, left, _HEAD + top + _CURVE + _BINS_GAP, _CURVE, _BINS)
        reliability_panel(panel(figure, left, _HEAD + top, _CURVE, _CURVE), bins, evaluation.reliability)
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
        f"{counted(evaluation.frames, 'frame')} judged",
        *([f"{evaluation.unlabelled} without a label left out"] if evaluation.unlabelled else []),
        f"balanced accuracy {percent(evaluation.balanced_accuracy)}",
        *([] if latency is None else [f"new place noticed after {counted(latency, 'frame')} (median)"]),
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
