"""How good the beliefs of labelled sequences are, in numbers: readings A17, and the contract's "Evaluation"."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.errors import EvaluationError
from placerec.hohmm.beliefs import Beliefs

ECE_BINS = 15

# A belief of 0 in the true place would make the mean infinite, and one frame would then hide all others.
_SMALLEST_BELIEF = 1e-15

_UNLABELLED = -1


@dataclass(frozen=True)
class PlaceScore:
    """One place: None where nothing was decided for it (precision) or it never was the truth (recall)."""

    precision: float | None
    recall: float | None
    frames: int  # labelled with it


@dataclass(frozen=True)
class SequenceScore:
    """One sequence: accuracy is None where no frame has a label."""

    frames: int
    unlabelled: int
    accuracy: float | None


@dataclass(frozen=True)
class Evaluation:
    """What `evaluate` found; shares are from 0 to 1, P is the number of places."""

    places: tuple[str, ...]  # P: the columns in order, then labels that no column has, by name
    frames: int  # judged, that is labelled
    unlabelled: int
    accuracy: float
    balanced_accuracy: float
    majority_accuracy: float
    majority_place: str
    per_place: dict[str, PlaceScore]
    confusion: NDArray[np.int64]  # (P, P) frames: true place x decided place
    changes: int
    change_latency_frames: float | None  # median; None without a change
    ece: float
    log_loss: float  # nats per frame
    sequences: dict[str, SequenceScore]

    def to_json(self) -> dict[str, object]:
        """The object that `evaluate --json` prints: plain Python values, None where a number is undefined."""
        counts = self.confusion.tolist()
        return {
            "frames": self.frames,
            "unlabelled": self.unlabelled,
            "accuracy": self.accuracy,
            "balanced_accuracy": self.balanced_accuracy,
            "majority_accuracy": self.majority_accuracy,
            "majority_place": self.majority_place,
            "change_latency_frames": self.change_latency_frames,
            "changes": self.changes,
            "ece": self.ece,
            "log_loss": self.log_loss,
            "per_place": {name: dict(vars(score)) for name, score in self.per_place.items()},
            "confusion": {
                name: dict(zip(self.places, row, strict=True)) for name, row in zip(self.places, counts, strict=True)
            },
            "sequences": {name: dict(vars(score)) for name, score in self.sequences.items()},
        }


def evaluate(beliefs: Sequence[Beliefs]) -> Evaluation:
    """Judge the decided places (`best`) of all labelled frames against their labels.

    Frames without a label are left out and counted. Sequences may have different places. Raises EvaluationError if two
    sequences have the same name or no frame has a label.
    """
    _refuse_twins(beliefs)
    _refuse_unlabelled(beliefs)
    places = place_order(beliefs)
    truths = [codes(sequence.truth, places) for sequence in beliefs]
    decisions = [codes(sequence.best, places) for sequence in beliefs]
    truth, decided = np.concatenate(truths), np.concatenate(decisions)
    labelled = truth != _UNLABELLED
    confidence = np.concatenate([_belief_in(sequence, sequence.best) for sequence in beliefs])[labelled]
    evidence = np.concatenate([_belief_in(sequence, sequence.truth) for sequence in beliefs])[labelled]
    confusion = _confusion(truth[labelled], decided[labelled], len(places))
    support = confusion.sum(axis=1)
    per_place = _per_place(places, confusion)
    latencies = np.concatenate([change_latencies(t, d) for t, d in zip(truths, decisions, strict=True)])
    recalls = [score.recall for score in per_place.values() if score.recall is not None]
    return Evaluation(
        places=places,
        frames=int(labelled.sum()),
        unlabelled=int((~labelled).sum()),
        accuracy=float(np.trace(confusion) / support.sum()),
        balanced_accuracy=float(np.mean(recalls)),
        majority_accuracy=float(support.max() / support.sum()),
        majority_place=places[int(support.argmax())],
        per_place=per_place,
        confusion=confusion,
        changes=len(latencies),
        change_latency_frames=float(np.median(latencies)) if len(latencies) else None,
        ece=calibration_error(confidence, (truth == decided)[labelled]),
        log_loss=float(-np.log(np.maximum(evidence, _SMALLEST_BELIEF)).mean()),
        sequences={s.name: _sequence_score(t, d) for s, t, d in zip(beliefs, truths, decisions, strict=True)},
    )


def place_order(beliefs: Sequence[Beliefs]) -> tuple[str, ...]:
    """All places of several sequences: the columns in order of appearance, then other labels by name."""
    columns = dict.fromkeys(place for sequence in beliefs for place in sequence.places)
    others = {place for sequence in beliefs for place in (*sequence.truth, *sequence.best)} - {"", *columns}
    return (*columns, *sorted(others))


def codes(names: Sequence[str], places: Sequence[str]) -> NDArray[np.int64]:
    """Each name's index in `places`, -1 for the empty name: (n,) int64."""
    index = {place: number for number, place in enumerate(places)} | {"": _UNLABELLED}
    return np.array([index[name] for name in names], dtype=np.int64)


def change_latencies(truth: NDArray[np.int64], decided: NDArray[np.int64]) -> NDArray[np.int64]:
    """Frames from each change of the true place to the first right frame, the visit's length if there is none.

    truth, decided: (n,) place indices of one sequence, truth -1 where unlabelled. A visit is a run of frames with one
    label, and an unlabelled frame ends it; a change lies between two successive visits to different places.
    """
    if not len(truth):
        return np.empty(0, dtype=np.int64)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(truth)) + 1))
    ends = np.append(starts[1:], len(truth))
    visits = truth[starts] != _UNLABELLED
    starts, ends = starts[visits], ends[visits]
    changed = np.flatnonzero(np.diff(truth[starts])) + 1
    starts, ends = starts[changed], ends[changed]
    # The first right frame at or after each start; the visit's end stands in where it lies beyond the visit.
    right = np.append(np.flatnonzero(truth == decided), len(truth))
    first = right[np.searchsorted(right, starts)]
    latencies: NDArray[np.int64] = np.minimum(first, ends) - starts
    return latencies


def calibration_error(confidence: NDArray[np.float64], right: NDArray[np.bool_]) -> float:
    """Expected calibration error over 15 equal bins: the mean gap between belief and accuracy, weighted by frames.

    confidence: (n,) belief in the decided place; right: (n,). A bin holds its upper edge (Guo et al. 2017).
    """
    # k / 15 is the closest float to every edge, so that a belief written as 0.2 falls into the bin that ends there.
    bins = np.searchsorted(np.arange(1, ECE_BINS) / ECE_BINS, confidence, side="left")
    believed = np.bincount(bins, weights=confidence, minlength=ECE_BINS)
    correct = np.bincount(bins, weights=right, minlength=ECE_BINS)
    return float(np.abs(believed - correct).sum() / len(confidence))


def _refuse_twins(beliefs: Sequence[Beliefs]) -> None:
    seen = set()
    for sequence in beliefs:
        if sequence.name in seen:
            raise EvaluationError(f"two sequences are called {sequence.name!r}; rename one file or leave it out")
        seen.add(sequence.name)


def _refuse_unlabelled(beliefs: Sequence[Beliefs]) -> None:
    if any(any(sequence.truth) for sequence in beliefs):
        return
    names = ", ".join(sequence.name for sequence in beliefs[:3]) + (", ..." if len(beliefs) > 3 else "")
    raise EvaluationError(
        f"no frame of {names} has a label, so nothing can be judged; give the true places in the column `place`"
        if beliefs
        else "no sequence to judge; name at least one beliefs file"
    )


def _belief_in(sequence: Beliefs, names: Sequence[str]) -> NDArray[np.float64]:
    """The belief of each frame in the place named for it, 0 for a place that has no column: (n,)."""
    column = {place: number for number, place in enumerate(sequence.places)}
    columns = np.array([column.get(name, len(column)) for name in names], dtype=np.int64)
    padded = np.hstack([sequence.belief, np.zeros((len(names), 1))])
    picked: NDArray[np.float64] = padded[np.arange(len(names)), columns]
    return picked


def _confusion(truth: NDArray[np.int64], decided: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.bincount(truth * size + decided, minlength=size * size).reshape(size, size).astype(np.int64)


def _per_place(places: Sequence[str], confusion: NDArray[np.int64]) -> dict[str, PlaceScore]:
    def share(part: int, whole: int) -> float | None:
        return part / whole if whole else None

    right = confusion.diagonal().tolist()
    support, decided = confusion.sum(axis=1).tolist(), confusion.sum(axis=0).tolist()
    return {
        place: PlaceScore(precision=share(right[i], decided[i]), recall=share(right[i], support[i]), frames=support[i])
        for i, place in enumerate(places)
    }


def _sequence_score(truth: NDArray[np.int64], decided: NDArray[np.int64]) -> SequenceScore:
    labelled = truth != _UNLABELLED
    frames = int(labelled.sum())
    accuracy = float((truth == decided)[labelled].mean()) if frames else None
    return SequenceScore(frames=frames, unlabelled=len(truth) - frames, accuracy=accuracy)
