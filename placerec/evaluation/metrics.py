"""How good the beliefs of labelled sequences are, in numbers: readings A17, and the contract's "Evaluation"."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import EvaluationError
from placerec.evaluation.confidence import NewPlaces, Reliability, RiskCoverage, new_places, reliability, risk_coverage
from placerec.frames.table import Labels
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs

# A belief of 0 in the true place would make the mean infinite, and one frame would then hide all others.
_SMALLEST_BELIEF = 1e-15

_UNLABELLED = -1

# What the JSON object of an evaluation begins with.
_NUMBERS = (
    *("frames", "unlabelled", "accuracy", "balanced_accuracy", "majority_accuracy", "majority_place"),
    *("change_latency_frames", "changes", "ece", "log_loss"),
)


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
    confusion: Ints  # (P, P) frames: true place x decided place
    changes: int
    change_latency_frames: float | None  # median; None without a change
    reliability: Reliability
    log_loss: float  # nats per frame
    risk_coverage: RiskCoverage
    new_places: NewPlaces | None  # None where no sequence has the column `unknown`
    sequences: dict[str, SequenceScore]
    made_by: tuple[str, ...] = ()  # the models and options that made the beliefs, where that is known

    def _repr_html_(self) -> str:
        from placerec.evaluation.html import evaluation_html

        return evaluation_html(self)

    @property
    def ece(self) -> float:
        """The expected calibration error."""
        return self.reliability.error

    def to_dict(self) -> dict[str, list[object]]:
        """A table with a row for each place: `pandas.DataFrame(evaluation.to_dict())`, and so for polars."""
        scores = self.per_place.values()
        numbers = {name: [getattr(one, name) for one in scores] for name in ("frames", "precision", "recall")}
        return {"place": [*self.per_place], **numbers}

    def to_json(self) -> dict[str, object]:
        """The object that `evaluate --json` prints: plain Python values, None where a number is undefined."""
        counts, new = self.confusion.tolist(), self.new_places
        unknown = {} if new is None else {"unknown_auroc": new.auroc, "unknown_frames": new.new}
        return {
            **{name: getattr(self, name) for name in _NUMBERS},
            "reliability": self.reliability.to_json(),
            "risk_coverage": self.risk_coverage.to_json(),
            **unknown,
            "per_place": {name: dict(vars(score)) for name, score in self.per_place.items()},
            "confusion": {
                name: dict(zip(self.places, row, strict=True)) for name, row in zip(self.places, counts, strict=True)
            },
            "sequences": {name: dict(vars(score)) for name, score in self.sequences.items()},
            "made_by": list(self.made_by),
        }


def evaluate(beliefs: Sequence[Beliefs]) -> Evaluation:
    """Judge the decided places (`best`) of all labelled frames against their labels.

    Frames without a label are left out and counted. Sequences may have different places. Where a sequence has the
    column `unknown`, a frame of a place without a column is right if `best` is `unknown`, and the beliefs are judged as
    those in all places and `unknown` together. Raises EvaluationError if two sequences have the same name or no frame
    has a label.
    """
    _check(beliefs)
    places = place_order(beliefs)
    truths = [one.stream.table.places.codes(places) for one in beliefs]
    rights = [right_frames(one) for one in beliefs]
    labelled = np.concatenate(truths) != _UNLABELLED
    truth, right = np.concatenate(truths)[labelled], np.concatenate(rights)[labelled]
    decided = np.concatenate([Labels(one.best).codes(places) for one in beliefs])[labelled]
    confidence = np.concatenate([_belief_in(one, Labels(one.best)) for one in beliefs])[labelled]
    evidence = np.concatenate([_belief_in(one, one.stream.table.places) for one in beliefs])[labelled]
    size = len(places)
    confusion = np.bincount(truth * size + decided, minlength=size * size).reshape(size, size).astype(np.int64)
    support = confusion.sum(axis=1)
    per_place = _per_place(places, truth, decided, right)
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
        log_loss=max(0.0, float(-np.log(np.maximum(evidence, _SMALLEST_BELIEF)).mean())),
        risk_coverage=risk_coverage(confidence, right),
        new_places=_new_places(beliefs),
        sequences={s.name: _sequence_score(t, r) for s, t, r in zip(beliefs, truths, rights, strict=True)},
    )


def place_order(beliefs: Sequence[Beliefs]) -> tuple[str, ...]:
    """All places of several sequences: the columns in order of appearance, other labels by name, then `unknown`."""
    columns = dict.fromkeys(place for sequence in beliefs for place in sequence.places)
    others = {place for one in beliefs for place in (*one.truth, *one.best)} - {"", UNKNOWN_PLACE, *columns}
    asked = any(s.unknown is not None or UNKNOWN_PLACE in s.truth for s in beliefs)
    return (*columns, *sorted(others), *([UNKNOWN_PLACE] if asked else []))


def right_frames(sequence: Beliefs) -> Mask:
    """The frames whose decided place is their label, or `unknown` where the label has no column, bool (n,)."""
    truth, best = np.array(sequence.truth, np.str_), np.array(sequence.best, np.str_)
    right: Mask = (truth != "") & ((best == truth) | (_new_frames(sequence) & (best == UNKNOWN_PLACE)))
    return right


def change_latencies(truth: Ints, right: Mask) -> Ints:
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
    latencies: Ints = np.minimum(first, ends) - starts
    return latencies


def _check(beliefs: Sequence[Beliefs]) -> None:
    for name, times in Counter(sequence.name for sequence in beliefs).items():
        if times > 1:
            raise EvaluationError(f"two sequences are called {name!r}; rename one file or leave it out")
    if any(any(sequence.truth) for sequence in beliefs):
        return
    names = ", ".join(sequence.name for sequence in beliefs[:3]) + (", ..." if len(beliefs) > 3 else "")
    raise EvaluationError(
        f"no frame of {names} has a label, so nothing can be judged; give the true places in the column `place`"
        if beliefs
        else "no sequence to judge; name at least one beliefs file"
    )


def _new_frames(sequence: Beliefs) -> Mask:
    """The frames with a label that no column has, where the sequence has the column `unknown`, bool (n,)."""
    if sequence.unknown is None:
        return np.zeros(len(sequence), bool)
    return sequence.stream.table.labelled & (sequence.stream.table.places.codes(sequence.places) < 0)


def _new_places(beliefs: Sequence[Beliefs]) -> NewPlaces | None:
    asked = [(sequence, sequence.unknown) for sequence in beliefs if sequence.unknown is not None]
    if not asked:
        return None
    labelled = np.concatenate([sequence.stream.table.labelled for sequence, _ in asked])
    new = np.concatenate([_new_frames(sequence) for sequence, _ in asked])
    return new_places(np.concatenate([unknown for _, unknown in asked])[labelled], new[labelled])


def _belief_in(sequence: Beliefs, names: Labels) -> Floats:
    """The belief of each frame in the place that is named for it, float64 (n,).

    Of a place that has no column, the belief in `unknown`, 0 where the sequence has none.
    """
    unknown = np.zeros(len(names)) if sequence.unknown is None else sequence.unknown
    together = np.hstack([sequence.belief * (1 - unknown[:, None]), unknown[:, None]])
    # -1, the code of a place without a column, is the last column.
    picked: Floats = together[np.arange(len(names)), names.codes(sequence.places)]
    return picked


def _per_place(places: Sequence[str], truth: Ints, decided: Ints, right: Mask) -> dict[str, PlaceScore]:
    named = truth, decided, truth[right], decided[right]
    counts = [np.bincount(one, minlength=len(places)).tolist() for one in named]
    return {
        place: PlaceScore(precise / chosen if chosen else None, recalled / frames if frames else None, frames)
        for place, frames, chosen, recalled, precise in zip(places, *counts, strict=True)
    }


def _sequence_score(truth: Ints, right: Mask) -> SequenceScore:
    labelled = truth != _UNLABELLED
    frames = int(labelled.sum())
    accuracy = float(right[labelled].mean()) if frames else None
    return SequenceScore(frames=frames, unlabelled=len(truth) - frames, accuracy=accuracy)
