"""What an experiment found: a row per cell, seed and fold, and of each row its test sequences; as CSV files.

results.csv    the columns of `COLUMNS`, sorted by the first seven
sequences.csv  how many frames of each test sequence were right: what the intervals are computed from
learned.csv    what `placerec learn` makes of each seed and fold, unless all is as in the paper

`Scores` are the accuracies over all frames, and what they would be with other test sequences. Frames of one sequence
resemble each other, so sequences are drawn, with replacement, and all of their frames with them. Every cell sees the
same draws: a difference between two cells is one between the same sequences and seeds.
"""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats
from placerec.evaluation.bootstrap import DRAWS, draw
from placerec.files import write_text

_CELL = ("size", "seed", "fold", "smoothing", "select", "order", "transition")
COLUMNS = (
    *_CELL,
    *("frames", "accuracy", "balanced_accuracy", "majority_accuracy", "same_word_run", "frame_wise_accuracy"),
    *("change_latency_frames", "log_loss", "ece"),
)
LEARNED_CSV = "learned.csv"
SEQUENCE_COLUMNS = (*_CELL, "sequence", "frames", "right", "frame_wise_right", "majority_right", "late")


@dataclass(frozen=True)
class SequenceCount:
    """Labelled frames of a test sequence, and how many of them are right: by the cell, frame-wise, and by majority.

    `late` frames are wrong ones between a change of place and the first right frame, the sum of the latencies.
    """

    frames: int
    right: int
    frame_wise: int
    majority: int
    late: int


@dataclass(frozen=True)
class Row:
    """A cell of one size, seed and fold; shares are from 0 to 1."""

    size: int
    seed: int
    fold: str
    smoothing: str
    select: str
    order: int
    transition: str
    frames: int
    accuracy: float
    balanced_accuracy: float
    majority_accuracy: float
    same_word_run: float
    change_latency_frames: float | None
    log_loss: float
    ece: float
    sequences: Mapping[str, SequenceCount] = field(repr=False)

    @property
    def setting(self) -> "Setting":
        """What the row is a result of, but for the seed and the fold."""
        return Setting(self.size, self.smoothing, self.select, self.order, self.transition)

    @property
    def frame_wise_accuracy(self) -> float:
        """The share of frames that their own word alone gets right (naive Bayes, order 1 without filter)."""
        return sum(one.frame_wise for one in self.sequences.values()) / self.frames


class Setting(NamedTuple):
    """How models are made and used: a row without its seed and fold."""

    size: int
    smoothing: str
    select: str
    order: int
    transition: str

    def __str__(self) -> str:
        return f"S = {self.size}, {self.smoothing}, {self.select}, n = {self.order}, {self.transition} transitions"


class LearnedRow(NamedTuple):
    """What the system of `placerec learn` does on a fold, with dictionaries of a seed; a line of learned.csv.

    `right` of `frames` labelled test frames; shares are from 0 to 1. `alpha` and `memory`: what was learned of weights.
    """

    seed: int
    fold: str
    frames: int
    right: int
    accuracy: float
    balanced_accuracy: float
    change_latency_frames: float | None
    log_loss: float
    ece: float
    alpha: float
    memory: float


@dataclass(frozen=True)
class Results:
    """All rows, in the order of results.csv, and by fold and split (train, test) the labelled images per place.

    `learned`: the rows of learned.csv, none where that is not asked for.
    """

    rows: Sequence[Row] = field(repr=False)
    folds: Mapping[str, Mapping[str, Mapping[str, int]]] = field(repr=False)
    learned: Sequence[LearnedRow] = field(default=(), repr=False)

    def learned_by_seed(self) -> list[float]:
        """Of `learned` the share of the frames of all folds that are right, from 0 to 1: one number a seed."""
        counts: dict[int, list[int]] = {}
        for row in self.learned:
            total = counts.setdefault(row.seed, [0, 0])
            total[0] += row.right
            total[1] += row.frames
        return [right / frames for right, frames in counts.values()]

    def to_dict(self) -> dict[str, list[object]]:
        """The columns of results.csv: `pandas.DataFrame(results.to_dict())`, and so for polars."""
        return {name: [getattr(row, name) for row in self.rows] for name in COLUMNS}


def by_seed(
    rows: Iterable[Row], share: Callable[[SequenceCount], int] = lambda one: one.right
) -> dict[Setting, list[float]]:
    """Per setting, the share of the frames of all folds that are right, from 0 to 1: one number a seed."""
    counts: dict[Setting, dict[int, list[int]]] = {}
    for row in rows:
        total = counts.setdefault(row.setting, {}).setdefault(row.seed, [0, 0])
        total[0] += sum(map(share, row.sequences.values()))
        total[1] += row.frames
    return {setting: [right / frames for right, frames in seeds.values()] for setting, seeds in counts.items()}


def write_results(results: Results, out: Path) -> None:
    """Write results.csv and sequences.csv into `out`."""
    rows = ([_cell(getattr(row, name)) for name in COLUMNS] for row in results.rows)
    write_text(out / "results.csv", _csv(COLUMNS, rows))
    counts = (
        [*(getattr(row, key) for key in _CELL), name, *vars(one).values()]
        for row in results.rows
        for name, one in row.sequences.items()
    )
    write_text(out / "sequences.csv", _csv(SEQUENCE_COLUMNS, counts))


def write_learned(rows: Sequence[LearnedRow], out: Path) -> None:
    """Write learned.csv into `out`; without rows there is none."""
    if rows:
        write_text(out / LEARNED_CSV, _csv(LearnedRow._fields, (map(_cell, row) for row in rows)))
    else:
        (out / LEARNED_CSV).unlink(missing_ok=True)


def _cell(value: object) -> object:
    return f"{value:.6f}" if isinstance(value, float) else "" if value is None else value


def _csv(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()


AXES = ("size", "smoothing", "select", "order")


class MissingCellsError(Exception):
    """The grid lacks what is asked of it; the message says what."""


@dataclass(frozen=True)
class Scores:
    """The cells of one kind of transition; `accuracy` float64 (sizes, smoothings, selects, orders, 1 + DRAWS).

    Percent of the frames of all folds, mean over seeds. The first number of the last axis is the real one, the others
    are those of the draws. `majority` float64 (1 + DRAWS,): of always the most frequent place of the fold.
    """

    size: tuple[int, ...]
    smoothing: tuple[str, ...]
    select: tuple[str, ...]
    order: tuple[int, ...]
    sequences: tuple[str, ...]
    accuracy: Floats = field(repr=False)
    majority: Floats = field(repr=False)

    def take(self, **wanted: Sequence[int | str] | None) -> Floats:
        """The accuracies of the cells with some values of `size`, `smoothing`, `select`, `order`; all axes are kept.

        Raises MissingCellsError for a value that the grid does not have, and for no values.
        """
        taken = self.accuracy
        for axis, name in enumerate(AXES):
            values, has = wanted.get(name), getattr(self, name)
            if values is not None:
                for value in values:
                    if value not in has:
                        raise MissingCellsError(f"the grid has no {name} {value}")
                if not values:
                    raise MissingCellsError(f"the grid has no {name} for it")
                taken = taken.take([has.index(value) for value in values], axis=axis)
        return taken


def mean(cells: Floats) -> Floats:
    """The mean over cells: (a, b, c, d, n) to (n,)."""
    average: Floats = cells.mean(axis=(0, 1, 2, 3))
    return average


def scores(rows: Sequence[Row], *, draws: int = DRAWS) -> Scores:
    """The accuracies of all cells in rows of one kind of transition, really and in draws of the test sequences."""
    size, smoothing, select, order = axes = tuple(tuple(sorted({getattr(row, name) for row in rows})) for name in AXES)
    names = tuple(sorted({name for row in rows for name in row.sequences}))
    right = np.zeros((*map(len, axes), len(names)))
    place = [{value: i for i, value in enumerate(axis)} for axis in axes]
    number = {name: i for i, name in enumerate(names)}
    frames, majority = np.zeros(len(names)), np.zeros(len(names))
    # A sequence may be tested in several folds, in several lights.
    for name, one in {(row.fold, name): (name, one) for row in rows for name, one in row.sequences.items()}.values():
        frames[number[name]] += one.frames
        majority[number[name]] += one.majority
    seeds = len({row.seed for row in rows})
    for row in rows:
        cell = tuple(of[getattr(row, name)] for of, name in zip(place, AXES, strict=True))
        for name, one in row.sequences.items():
            right[(*cell, number[name])] += one.right / seeds
    # Each sequence once, and then as often as a fixed seed draws it.
    weights = np.concatenate([np.ones((1, len(names))), draw(len(names), 0, draws)])
    whole = weights @ frames
    with np.errstate(invalid="ignore", divide="ignore"):
        accuracy = np.nan_to_num(100 * np.einsum("abcds,ns->abcdn", right, weights) / whole)
        always = np.nan_to_num(100 * (weights @ majority) / whole)
    return Scores(size, smoothing, select, order, names, accuracy, always)
