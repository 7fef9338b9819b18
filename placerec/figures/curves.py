"""Small panels on trust: is a belief of 0.8 right in 80 %, what is gained by withholding, and what tells new places."""

from typing import TYPE_CHECKING

import numpy as np

from placerec.evaluation.confidence import COVERAGES, ECE_BINS, NewPlaces, Reliability, RiskCoverage

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BLUE, _GREY = "#4a90c2", "0.55"


def reliability_panel(axes: "Axes", found: Reliability) -> None:
    """Draw accuracy over belief in 15 bins, the frames of each bin written in it; on the diagonal is calibrated."""
    edges = np.arange(ECE_BINS) / ECE_BINS
    some = found.frames > 0
    axes.bar(edges[some], found.accuracy[some], 1 / ECE_BINS, align="edge", color=_BLUE, alpha=0.45, edgecolor="white")
    axes.plot(found.belief[some], found.accuracy[some], "o", color=_BLUE, markersize=2.5)
    for edge, frames in zip(edges[some].tolist(), found.frames[some].tolist(), strict=True):
        axes.text(edge + 0.5 / ECE_BINS, 0.02, str(frames), rotation=90, ha="center", va="bottom", fontsize=5.5)
    _square(axes, f"Reliability: ECE {found.error:.3f}", "belief in what was decided (frames inside)", "right")
    axes.plot([0, 1], [0, 1], color=_GREY, linewidth=0.8, linestyle="--")


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
