"""From machines that give margins to beliefs: the options and a temperature by held-out training, and the filter.

A machine (a linear or kernel machine, a regression) gives every place a margin, not a probability. Beliefs are the
softmax of the margins over a temperature, which changes no decision. Of several machines the one is taken whose beliefs
have the least log loss on training sequences that were held out, each machine at its best temperature; no test sequence
has a part in it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm import fit_calibration
from placerec.hohmm.filter import normalised
from placerec.methods.descriptors import (
    DescriptorTrainingSet,
    FitPoints,
    MakePointStepper,
    PointStepFunction,
    held_out_folds,
    scattered,
)

# Points float64 (n, k), in units of their root mean square, to the margin of each place seen, float64 (n, D).
Margins = Callable[[Floats], Floats]
# Learns margins from such points (n, k) and the columns of their places, int64 (n,); the places seen are ascending.
FitMargins = Callable[[Floats, Ints], Margins]
# The margin of a place that a fold of the training does not have: below any that occurs, and finite.
_ABSENT = -20.0


def best_machine(
    training: DescriptorTrainingSet, machines: Sequence[FitMargins], folds: int, most: int | None = None
) -> FitPoints:
    """What fits the best of the `machines` to a training set, and gives a point's margins over its temperature (C,).

    `folds`: groups of sequences that are held out in turn (`held_out_folds`). `most`: where there are more frames, each
    second, third... one alone decides on machine and temperature. Where no fold can tell, the first machine at 1.
    """
    every = 1 if most is None else -(-len(training.truth) // most)
    some = replace(
        training,
        points=training.points[::every] / _scale(training),
        truth=training.truth[::every],
        sequences=training.sequences[::every],
    )
    best, temperature, least = machines[0], 1.0, np.inf
    for machine in machines:
        found = _held_out(some, machine, folds)
        if found:
            margins, truth = (np.concatenate(parts) for parts in zip(*found, strict=True))
            fitted = fit_calibration(normalised(margins), truth)
            if fitted.log_loss_after < least:
                best, temperature, least = machine, fitted.temperature, fitted.log_loss_after
    return partial(_scores, best, temperature)


def _scores(machine: FitMargins, temperature: float, training: DescriptorTrainingSet) -> PointStepFunction:
    scale, places = _scale(training), len(training.places)
    margins, columns = machine(training.points / scale, training.truth), np.unique(training.truth)

    def scores(point: Floats) -> Floats:
        found = margins(point[None] / scale)
        if len(columns) < places:
            found = np.maximum(scattered(found, columns, places), _ABSENT)
        tempered: Floats = found[0] / temperature
        return tempered

    return scores


def _scale(training: DescriptorTrainingSet) -> float:
    return float(np.sqrt(np.square(training.points).mean(axis=0).sum()))


def _held_out(training: DescriptorTrainingSet, machine: FitMargins, folds: int) -> list[tuple[Floats, Ints]]:
    """The margins (m, C) and places (m,) of the points of each fold, by a machine that learned from all others."""
    found, points, truth = [], training.points, training.truth
    for held in held_out_folds(training.sequences, folds):
        columns = np.unique(truth[~held])
        judged = held & np.isin(truth, columns)
        if len(columns) > 1 and judged.any():
            margins = scattered(machine(points[~held], truth[~held])(points[judged]), columns, len(training.places))
            found.append((np.maximum(margins, _ABSENT), truth[judged]))
    return found


def linear_margins(weights: Floats, offsets: Floats) -> Margins:
    """The margins of linear machines, `weights` float64 (D, k) and `offsets` (D,), as scikit-learn has them.

    Of two places scikit-learn keeps the machine of the second: (1, k) and (1,).
    """
    if len(weights) == 1:
        weights, offsets = np.concatenate([-weights, weights]), np.concatenate([-offsets, offsets])

    def margins(points: Floats) -> Floats:
        # Not BLAS, whose sums depend on the number of its threads.
        reached: Floats = np.einsum("nk,ck->nc", points, weights) + offsets
        return reached

    return margins


def frame_by_frame(scores: PointStepFunction) -> MakePointStepper:
    """Beliefs of each frame for itself: the softmax of its scores."""
    return lambda: lambda point: normalised(scores(point))


def likelihoods(fit: FitPoints, training: DescriptorTrainingSet) -> PointStepFunction:
    """Log likelihoods of a point for the filter, float64 (C,): its scores over the places' shares of the training."""
    frames = np.bincount(training.truth, minlength=len(training.places))
    prior = np.log(np.where(frames, frames, len(training.truth)) / len(training.truth))
    scores = fit(training)
    return lambda point: scores(point) - prior
