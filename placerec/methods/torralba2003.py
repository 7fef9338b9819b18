"""Torralba, Murphy, Freeman & Rubin 2003: Gaussian mixtures on global descriptors, in a hidden Markov model.

A. Torralba, K. Murphy, W. Freeman, M. Rubin: "Context-based vision system for place and object recognition", ICCV
2003. p(v | place) is the mean of Gaussians of one width around prototype training of the place; the filter is that of
eq. 1, with learned transitions. From memory, as the paper is not at hand: equal weights, one width by cross-validation,
about 100 prototypes a place, a Dirichlet prior on the transitions. Simplified here: the descriptor is the dictionary's
(GIST in place of a steerable pyramid, 80 components as theirs); prototypes are drawn from the training frames; the
width is the one with which the filter is best on held-out training frames, which also takes into account that
neighbouring frames are alike. The frames held out have their part in the transitions. Known places only.

The density is that of scikit-learn's KernelDensity, in two lines of numpy: on-line that is ten times faster.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.hohmm import Transition, filter_stream, learned_transition
from placerec.lm.logs import LN10
from placerec.methods.descriptors import (
    DescriptorTrainingSet,
    FitPoints,
    MakePointStepper,
    PointStepFunction,
    held_out_folds,
    scattered,
    through_filter,
)

PROTOTYPES = 100
# Widths that are tried, in units of the root mean square distance of the training frames from their mean. Wide ones
# make the filter less sure: a remedy for neighbouring frames, which are alike, that sequences of 500 frames ask for.
WIDTHS: tuple[float, ...] = tuple(2.0 ** (4 - j / 2) for j in range(21))
_SMALLEST_BELIEF = 1e-15


@dataclass(frozen=True)
class Prototypes:
    """Prototype points float64 (P, k) in the order of their places; `first` and `count` int64 (D,) per place seen."""

    points: Floats = field(repr=False)
    columns: Ints  # (D,) the columns of the places that have any
    first: Ints
    count: Ints


def fit(training: DescriptorTrainingSet, *, prototypes: int = PROTOTYPES, seed: int = 0) -> MakePointStepper:
    """Beliefs of the mixtures in the filter; `prototypes` a place at most, drawn by `seed`."""
    return through_filter(training, choose(training, prototypes=prototypes, seed=seed))


def choose(training: DescriptorTrainingSet, *, prototypes: int = PROTOTYPES, seed: int = 0) -> FitPoints:
    """What fits log likelihoods of a point, float64 (C,), of the width that the training asks for."""
    width = best_width(training, prototypes, seed)

    def likelihoods(learned: DescriptorTrainingSet) -> PointStepFunction:
        drawn = draw_prototypes(learned, np.ones(len(learned.truth), bool), prototypes, seed)
        return _density(drawn, width, len(learned.places))

    return likelihoods


def draw_prototypes(training: DescriptorTrainingSet, among: Mask, most: int, seed: int) -> Prototypes:
    """`most` frames of each place at most, of those `among` bool (n,), in their order."""
    rng = np.random.Generator(np.random.PCG64(seed))
    rows = []
    for column in range(len(training.places)):
        its = np.flatnonzero(among & (training.truth == column))
        rows.append(np.sort(rng.permutation(its)[:most]))
    count = np.array([len(its) for its in rows], np.int64)
    columns = np.flatnonzero(count)
    first = (np.cumsum(count) - count)[columns]
    return Prototypes(training.points[np.concatenate(rows)], columns, first, count[columns])


def best_width(training: DescriptorTrainingSet, prototypes: int, seed: int) -> float:
    """The width with the highest mean log belief in the true place over held-out training frames."""
    spread = float(np.sqrt(np.square(training.points - training.points.mean(axis=0)).sum(axis=1).mean()))
    widths = [spread * width for width in WIDTHS]
    transition = learned_transition(training.steps)
    total = np.zeros(len(widths))
    for held in held_out_folds(training.sequences):
        chosen = draw_prototypes(training, ~held, prototypes, seed)
        judged = held & np.isin(training.truth, chosen.columns)
        for sequence in np.unique(training.sequences[judged]):
            rows = np.flatnonzero(judged & (training.sequences == sequence))
            distances = np.stack([_squared(chosen, point) for point in training.points[rows]])
            total += [_evidence(distances, chosen, width, transition, training.truth[rows]) for width in widths]
    return widths[int(total.argmax())]


def _evidence(distances: Floats, chosen: Prototypes, width: float, transition: Transition, truth: Ints) -> float:
    """The sum of the log beliefs in the true places (T,) of frames with squared `distances` (T, P)."""
    log_p = scattered(_log_density(distances, chosen, width), chosen.columns, len(transition.matrix))
    belief = filter_stream(log_p / LN10, transition).belief[np.arange(len(truth)), truth]
    evidence: float = np.log(np.maximum(belief, _SMALLEST_BELIEF)).sum().item()
    return evidence


def _density(chosen: Prototypes, width: float, places: int) -> Callable[[Floats], Floats]:
    def log_likelihoods(point: Floats) -> Floats:
        (logs,) = scattered(_log_density(_squared(chosen, point)[None], chosen, width), chosen.columns, places)
        return np.asarray(logs)

    return log_likelihoods


def _squared(chosen: Prototypes, point: Floats) -> Floats:
    # Not BLAS, whose sums depend on the number of its threads.
    squared: Floats = np.square(chosen.points - point).sum(axis=1)
    return squared


def _log_density(distances: Floats, chosen: Prototypes, width: float) -> Floats:
    """log p (T, D) up to what all places share, of squared `distances` (T, P)."""
    exponents = distances / (-2 * width**2)
    mixed: Floats = np.logaddexp.reduceat(exponents, chosen.first, axis=1) - np.log(chosen.count)
    return mixed
