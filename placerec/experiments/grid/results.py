"""What an experiment found: a row per cell, seed and fold, and of each row its test sequences; as CSV files.

results.csv    the columns of `COLUMNS`, sorted by the first seven
sequences.csv  how many frames of each test sequence were right: what the intervals are computed from
"""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from placerec.files import write_text

COLUMNS = (
    "size,seed,fold,smoothing,select,order,transition,frames,accuracy,balanced_accuracy,majority_accuracy,"
    "same_word_run,frame_wise_accuracy,change_latency_frames,log_loss,ece"
)
SEQUENCE_COLUMNS = (
    "size,seed,fold,smoothing,select,order,transition,sequence,frames,right,frame_wise_right,majority_right,late"
)


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
    def frame_wise_accuracy(self) -> float:
        """The share of frames that their own word alone gets right (naive Bayes, order 1 without filter)."""
        return sum(one.frame_wise for one in self.sequences.values()) / self.frames


class Way(NamedTuple):
    """How models are made and used: a row without its seed and fold."""

    size: int
    smoothing: str
    select: str
    order: int
    transition: str

    def __str__(self) -> str:
        return f"S = {self.size}, {self.smoothing}, {self.select}, n = {self.order}, {self.transition} transitions"


def way_of(row: Row) -> Way:
    """The way of a row."""
    return Way(row.size, row.smoothing, row.select, row.order, row.transition)


@dataclass(frozen=True)
class FoldData:
    """What the recordings of a fold hold: labelled images per place."""

    train: Mapping[str, int]
    test: Mapping[str, int]


@dataclass(frozen=True)
class Results:
    """All rows, in the order of results.csv, and the folds by name."""

    rows: Sequence[Row] = field(repr=False)
    folds: Mapping[str, FoldData] = field(repr=False)


def by_seed(
    rows: Iterable[Row], share: Callable[[SequenceCount], int] = lambda one: one.right
) -> dict[Way, list[float]]:
    """Per way, the share of the frames of all folds that are right, from 0 to 1: one number a seed."""
    counts: dict[Way, dict[int, list[int]]] = {}
    for row in rows:
        total = counts.setdefault(way_of(row), {}).setdefault(row.seed, [0, 0])
        total[0] += sum(map(share, row.sequences.values()))
        total[1] += row.frames
    return {way: [right / frames for right, frames in seeds.values()] for way, seeds in counts.items()}


def write_results(results: Results, out: Path) -> None:
    """Write results.csv and sequences.csv into `out`."""
    rows = ([_cell(getattr(row, name)) for name in COLUMNS.split(",")] for row in results.rows)
    write_text(out / "results.csv", _csv(COLUMNS, rows))
    counts = (
        [*(getattr(row, key) for key in COLUMNS.split(",")[:7]), name, *vars(one).values()]
        for row in results.rows
        for name, one in row.sequences.items()
    )
    write_text(out / "sequences.csv", _csv(SEQUENCE_COLUMNS, counts))


def _cell(value: object) -> object:
    return f"{value:.6f}" if isinstance(value, float) else "" if value is None else value


def _csv(header: str, rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header.split(","))
    writer.writerows(rows)
    return text.getvalue()
