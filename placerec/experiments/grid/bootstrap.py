"""Accuracies over all frames, and what they would be with other test sequences: the bootstrap.

Frames of one sequence resemble each other, so sequences are drawn, with replacement, and all of their frames with
them. Every cell sees the same draws: a difference between two cells is one between the same sequences and seeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.evaluation.bootstrap import DRAWS, Floats, draw
from placerec.experiments.grid.results import Row


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

    def take(
        self,
        *,
        size: Sequence[int] | None = None,
        smoothing: Sequence[str] | None = None,
        select: Sequence[str] | None = None,
        order: Sequence[int] | None = None,
    ) -> Floats:
        """The accuracies of some cells, all axes kept; MissingCellsError for a value that the grid does not have."""
        taken = self.accuracy
        for axis, (name, wanted) in enumerate(
            (("size", size), ("smoothing", smoothing), ("select", select), ("order", order))
        ):
            if wanted is not None:
                has: tuple[int | str, ...] = getattr(self, name)
                for value in wanted:
                    if value not in has:
                        raise MissingCellsError(f"the grid has no {name} {value}")
                if not wanted:
                    raise MissingCellsError(f"the grid has no {name} for it")
                taken = taken.take([has.index(value) for value in wanted], axis=axis)
        return taken


def mean(cells: Floats) -> Floats:
    """The mean over cells: (a, b, c, d, n) to (n,)."""
    average: Floats = cells.mean(axis=(0, 1, 2, 3))
    return average


def scores(rows: Sequence[Row], *, draws: int = DRAWS) -> Scores:
    """The accuracies of all cells in rows of one kind of transition, really and in draws of the test sequences."""
    size, smoothing, select, order = axes = tuple(
        tuple(sorted({getattr(row, name) for row in rows})) for name in ("size", "smoothing", "select", "order")
    )
    names = tuple(sorted({name for row in rows for name in row.sequences}))
    right = np.zeros((*map(len, axes), len(names)))
    place = [{value: i for i, value in enumerate(axis)} for axis in axes]
    number = {name: i for i, name in enumerate(names)}
    frames, majority = np.zeros(len(names)), np.zeros(len(names))
    seeds = len({row.seed for row in rows})
    for row in rows:
        cell = tuple(of[value] for of, value in zip(place, _key(row), strict=True))
        for name, one in row.sequences.items():
            right[(*cell, number[name])] += one.right / seeds
            frames[number[name]], majority[number[name]] = one.frames, one.majority
    weights = drawn(len(names), draws)
    whole = weights @ frames
    with np.errstate(invalid="ignore", divide="ignore"):
        accuracy = 100 * np.einsum("abcds,ns->abcdn", right, weights) / whole
        return Scores(
            size,
            smoothing,
            select,
            order,
            names,
            np.nan_to_num(accuracy),
            np.nan_to_num(100 * (weights @ majority) / whole),
        )


def drawn(sequences: int, draws: int) -> Floats:
    """How often each sequence is there, float64 (1 + draws, sequences): once each, then as a fixed seed draws them."""
    return np.concatenate([np.ones((1, sequences)), draw(sequences, 0, draws).astype(np.float64)])


def _key(row: Row) -> tuple[int | str, ...]:
    return row.size, row.smoothing, row.select, row.order
