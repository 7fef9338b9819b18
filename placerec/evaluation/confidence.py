"""How far beliefs can be trusted: calibration, what is gained by withholding answers, and telling new places."""

from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask

ECE_BINS = 15
COVERAGES = tuple(step / 20 for step in range(1, 21))


@dataclass(frozen=True)
class Reliability:
    """The decided frames by the belief in what was decided, in 15 equal bins, each with its upper edge.

    frames: int64 (15,); belief and accuracy: float64 (15,), the means of a bin, nan where it has no frame.
    """

    frames: Ints
    belief: Floats
    accuracy: Floats

    @property
    def error(self) -> float:
        """The expected calibration error: the mean gap between belief and accuracy, weighted by frames."""
        some = self.frames > 0
        gaps = np.abs(self.belief - self.accuracy)[some]
        return float(gaps @ self.frames[some] / self.frames.sum())

    def to_json(self) -> dict[str, list[float | None]]:
        """Plain values, None for nan."""
        columns = {"belief": self.belief.tolist(), "accuracy": self.accuracy.tolist()}
        shown = {name: [None if np.isnan(x) else x for x in values] for name, values in columns.items()}
        return {"frames": self.frames.tolist(), **shown}


@dataclass(frozen=True)
class RiskCoverage:
    """The accuracy of the surest 5 %, 10 %, ... 100 % of the frames, float64 (20,), and its mean over all shares."""

    accuracy: Floats
    area: float

    def to_json(self) -> dict[str, float | list[float]]:
        """Plain values."""
        return {"area": self.area, "coverage": list(COVERAGES), "accuracy": self.accuracy.tolist()}


@dataclass(frozen=True)
class NewPlaces:
    """How well `unknown` tells frames of places that were never trained from all others, by the ROC curve.

    auroc: the area under the curve, None where frames of one of both kinds are missing. false_alarms, detections:
    shares of both kinds above each threshold, from (0, 0) to (1, 1).
    """

    new: int
    known: int
    auroc: float | None
    false_alarms: Floats = field(repr=False)
    detections: Floats = field(repr=False)


def reliability(confidence: Floats, right: Mask) -> Reliability:
    """Bin frames (n,) by the belief in what was decided; a bin holds its upper edge (Guo et al. 2017)."""
    # k / 15 is the closest float to every edge, so that a belief written as 0.2 falls into the bin that ends there.
    bins = np.searchsorted(np.arange(1, ECE_BINS) / ECE_BINS, confidence, side="left")
    frames = np.bincount(bins, minlength=ECE_BINS)
    believed = np.bincount(bins, weights=confidence, minlength=ECE_BINS)
    correct = np.bincount(bins, weights=right, minlength=ECE_BINS)
    count = np.where(frames, frames, np.nan)
    return Reliability(frames, believed / count, correct / count)


def risk_coverage(confidence: Floats, right: Mask) -> RiskCoverage:
    """Accuracy against the share of frames (n,) that are answered, the surest first; equals come in the mean order."""
    ends, correct = _by_blocks(-confidence, right)
    kept = np.arange(1, len(right) + 1)
    correct_of = np.interp(kept, ends, correct) / kept
    wanted = np.array(COVERAGES) * len(right)
    return RiskCoverage(np.interp(wanted, ends, correct) / wanted, float(correct_of.mean()))


def new_places(unknown: Floats, new: Mask) -> NewPlaces:
    """The ROC curve of `unknown` (n,) for frames that are `new` (n,); equals count by halves, as a tie is a draw."""
    ends, detected = _by_blocks(-unknown, new)
    count, others = int(new.sum()), int((~new).sum())
    if not count or not others:
        return NewPlaces(count, others, None, np.empty(0), np.empty(0))
    detections, false_alarms = detected / count, (ends - detected) / others
    # By trapezoids; numpy has a function for it, which is called differently before numpy 2.
    area = (np.diff(false_alarms) * (detections[1:] + detections[:-1]) / 2).sum()
    return NewPlaces(count, others, float(area), false_alarms, detections)


def _by_blocks(score: Floats, hit: Mask) -> tuple[Floats, Floats]:
    """How many frames, and how many hits among them, up to the end of each run of equal scores, ascending; 0 first."""
    order = np.argsort(score, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(score[order])), len(score) - 1) if len(score) else np.empty(0, np.int64)
    hits = np.cumsum(hit[order])[ends]
    return np.append(0.0, ends + 1.0), np.append(0.0, hits)
