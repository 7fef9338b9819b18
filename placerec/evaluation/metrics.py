"""How good the beliefs of labelled sequences are, in numbers: readings A17, and the contract's "Evaluation"."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.errors import EvaluationError
from placerec.evaluation.confidence import NewPlaces, Reliability, RiskCoverage, new_places, reliability, risk_coverage
from placerec.hohmm.beliefs import UNKNOWN, Beliefs

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

    places: tuple[str, ...]  # P: the columns in order, then labels that no column has, by name, then `unknown`
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
    reliability: Reliability
    log_loss: float  # nats per frame
    risk_coverage: RiskCoverage
    new_places: NewPlaces | None  # None where no sequence has the column `unknown`
    sequences: dict[str, SequenceScore]

    @property
    def ece(self) -> float:
        """The expected calibration error."""
        return self.reliability.error

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
            "reliability": self.reliability.to_json(),
            "risk_coverage": self.risk_coverage.to_json(),
            **self._new_places_to_json(),
            "per_place": {name: dict(vars(score)) for name, score in self.per_place.items()},
            "confusion": {
                name: dict(zip(self.places, row, strict=True)) for name, row in zip(self.places, counts, strict=True)
            },
            "sequences": {name: dict(vars(score)) for name, score in self.sequences.items()},
        }

    def _new_places_to_json(self) -> dict[str, object]:
        if self.new_places is None:
            return {}
        return {"unknown_auroc": self.new_places.auroc, "unknown_frames": self.new_places.new}


def evaluate(beliefs: Sequence[Beliefs]) -> Evaluation:
    """Judge the decided places (`best`) of all labelled frames against their labels.

    Frames without a label are left out and counted. Sequences may have different places. Where a sequence has the
    column `unknown`, a frame of a place without a column is right if `best` is `unknown`, and the beliefs are judged as
    those in all places and `unknown` together. Raises EvaluationError if two sequences have the same name or no frame
    has a label.
    """
    _refuse_twins(beliefs)
    _refuse_unlabelled(beliefs)
    places = place_order(beliefs)
    truths = [codes(sequence.truth, places) for sequence in beliefs]
    decisions = [codes(sequence.best, places) for sequence in beliefs]
    rights = [right_frames(sequence) for sequence in beliefs]
    truth, decided, right = np.concatenate(truths), np.concatenate(decisions), np.concatenate(rights)
    labelled = truth != _UNLABELLED
    right = right[labelled]
    confidence = np.concatenate([_belief_in(sequence, sequence.best) for sequence in beliefs])[labelled]
    evidence = np.concatenate([_belief_in(sequence, sequence.truth) for sequence in beliefs])[labelled]
    confusion = _confusion(truth[labelled], decided[labelled], len(places))
    support = confusion.sum(axis=1)
    per_place = _per_place(places, truth[labelled], decided[labelled], right)
    latencies = np.concatenate([change_latencies(t, r) for t, r in zip(truths, rights, strict=True)])
    recalls = [score.recall for score in per_place.values() if score.recall is not None]
    return Evaluation(
        places=places,
        frames=int(labelled.sum()),
        unlabelled=int((~labelled).sum()),
        accuracy=float(right.mean()),
        balanced_accuracy=float(np.mean(recalls)),
        majority_accuracy=float(support.max() / support.sum()),
        majority_place=places[int(support.argmax())],
        per_place=per_place,
        confusion=confusion,
        changes=len(latencies),
        change_latency_frames=float(np.median(latencies)) if len(latencies) else None,
        reliability=reliability(confidence, right),
        log_loss=float(-np.log(np.maximum(evidence, _SMALLEST_BELIEF)).mean()),
        risk_coverage=risk_coverage(confidence, right),
        new_places=_new_places(beliefs),
        sequences={s.name: _sequence_score(t, r) for s, t, r in zip(beliefs, truths, rights, strict=True)},
    )


def place_order(beliefs: Sequence[Beliefs]) -> tuple[str, ...]:
    """All places of several sequences: the columns in order of appearance, other labels by name, then `unknown`."""
    columns = dict.fromkeys(place for sequence in beliefs for place in sequence.places)
    others = {place for sequence in beliefs for place in (*sequence.truth, *sequence.best)} - {"", UNKNOWN, *columns}
    asked = any(s.unknown is not None or UNKNOWN in s.truth for s in beliefs)
    return (*columns, *sorted(others), *([UNKNOWN] if asked else []))


def right_frames(sequence: Beliefs) -> NDArray[np.bool_]:
    """bool (n,): what was decided is the label, or `unknown` for a label that has no column."""
    answers = [UNKNOWN if new else label for label, new in zip(sequence.truth, _new_frames(sequence), strict=True)]
    pairs = zip(sequence.truth, answers, sequence.best, strict=True)
    return np.array([bool(label) and best in (label, answer) for label, answer, best in pairs], dtype=np.bool_)


def codes(names: Sequence[str], places: Sequence[str]) -> NDArray[np.int64]:
    """Each name's index in `places`, -1 for the empty name: (n,) int64."""
    index = {place: number for number, place in enumerate(places)} | {"": _UNLABELLED}
    return np.array([index[name] for name in names], dtype=np.int64)


def change_latencies(truth: NDArray[np.int64], right: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Frames from each change of the true place to the first right frame, the visit's length if there is none.

    truth: (n,) place indices of one sequence, -1 where unlabelled; right: (n,). A visit is a run of frames with one
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
    found = np.append(np.flatnonzero(right), len(truth))
    first = found[np.searchsorted(found, starts)]
    latencies: NDArray[np.int64] = np.minimum(first, ends) - starts
    return latencies


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


def _new_frames(sequence: Beliefs) -> list[bool]:
    """Per frame, whether it has a label that no column has, where the sequence has the column `unknown`."""
    known = {"", *sequence.places} if sequence.unknown is not None else {*sequence.truth}
    return [label not in known for label in sequence.truth]


def _new_places(beliefs: Sequence[Beliefs]) -> NewPlaces | None:
    asked = [(sequence, sequence.unknown) for sequence in beliefs if sequence.unknown is not None]
    if not asked:
        return None
    labelled = np.concatenate([np.array(sequence.truth, np.str_) != "" for sequence, _ in asked])
    new = np.concatenate([np.array(_new_frames(sequence), np.bool_) for sequence, _ in asked])
    return new_places(np.concatenate([unknown for _, unknown in asked])[labelled], new[labelled])


def _belief_in(sequence: Beliefs, names: Sequence[str]) -> NDArray[np.float64]:
    """The belief of each frame in the place named for it: (n,).

    For a place that has no column, that in `unknown`, or 0 where the sequence has none.
    """
    column = {place: number for number, place in enumerate(sequence.places)}
    columns = np.array([column.get(name, len(column)) for name in names], dtype=np.int64)
    unknown = np.zeros(len(names)) if sequence.unknown is None else sequence.unknown
    together = np.hstack([sequence.belief * (1 - unknown[:, None]), unknown[:, None]])
    picked: NDArray[np.float64] = together[np.arange(len(names)), columns]
    return picked


def _confusion(truth: NDArray[np.int64], decided: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.bincount(truth * size + decided, minlength=size * size).reshape(size, size).astype(np.int64)


def _per_place(
    places: Sequence[str], truth: NDArray[np.int64], decided: NDArray[np.int64], right: NDArray[np.bool_]
) -> dict[str, PlaceScore]:
    def share(part: int, whole: int) -> float | None:
        return part / whole if whole else None

    def count(place: NDArray[np.int64]) -> list[int]:
        counts: list[int] = np.bincount(place, minlength=len(places)).tolist()
        return counts

    support, chosen = count(truth), count(decided)
    recalled, precise = count(truth[right]), count(decided[right])
    return {
        place: PlaceScore(
            precision=share(precise[i], chosen[i]), recall=share(recalled[i], support[i]), frames=support[i]
        )
        for i, place in enumerate(places)
    }


def _sequence_score(truth: NDArray[np.int64], right: NDArray[np.bool_]) -> SequenceScore:
    labelled = truth != _UNLABELLED
    frames = int(labelled.sum())
    accuracy = float(right[labelled].mean()) if frames else None
    return SequenceScore(frames=frames, unlabelled=len(truth) - frames, accuracy=accuracy)
