"""Ullah, Pronobis, Caputo, Luo & Jensfelt 2008: support vector machines, one image at a time.

M. Ullah, A. Pronobis, B. Caputo, J. Luo, P. Jensfelt: "Towards robust place recognition for robot localization", ICRA
2008, the baseline that came with the COLD data. Theirs matches local features (Harris-Laplace, SIFT) inside the kernel
(from memory); here a linear machine of scikit-learn (one against the rest, C = 1, its defaults) sees the dictionary's
global descriptor, so that what differs from the other systems is the decision and not the feature. A machine gives
margins, not probabilities: their softmax at a temperature that is fitted on held-out training sequences. That changes
no decision. `fit_filtered` divides these by the places' shares of the training frames and lets the project's filter
have them as likelihoods, with learned transitions; that is not in the paper.
"""

from collections.abc import Callable

import numpy as np

from placerec.arrays import Floats, Mask
from placerec.errors import check_optional
from placerec.hohmm import fit_calibration, learned_transition
from placerec.hohmm.filter import normalised
from placerec.methods.descriptors import DescriptorTrainingSet, MakePointStepper, filtered, held_out_folds, scattered

# The margin of a place that a fold of the training does not have: below any that occurs, and finite.
_ABSENT = -20.0


def fit(training: DescriptorTrainingSet, *, seed: int = 0) -> MakePointStepper:
    """Beliefs frame by frame; MissingExtraError without scikit-learn."""
    scores = _scores(training, seed)

    def step(point: Floats) -> Floats:
        return normalised(scores(point))

    return lambda: step


def fit_filtered(training: DescriptorTrainingSet, *, seed: int = 0) -> MakePointStepper:
    """Beliefs of the machines' scores, as likelihoods, through the filter; MissingExtraError without scikit-learn."""
    scores = _scores(training, seed)
    shares = np.bincount(training.truth, minlength=len(training.places)) / len(training.truth)
    prior = np.log(shares)

    return filtered(lambda point: scores(point) - prior, learned_transition(training.steps))


def _scores(training: DescriptorTrainingSet, seed: int) -> Callable[[Floats], Floats]:
    """The margins of a point in each place (C,), over the temperature."""
    everything = np.ones(len(training.truth), bool)
    scale = float(np.sqrt(np.square(training.points).mean(axis=0).sum()))
    weights, offsets = _machines(training, everything, scale, seed)
    temperature = _temperature(training, scale, seed)

    def scores(point: Floats) -> Floats:
        tempered: Floats = margins(point[None] / scale, weights, offsets)[0] / temperature
        return tempered

    return scores


def margins(points: Floats, weights: Floats, offsets: Floats) -> Floats:
    """(n, C) of points (n, k)."""
    # Not BLAS, whose sums depend on the number of its threads.
    reached: Floats = np.einsum("nk,ck->nc", points, weights) + offsets
    return reached


def _machines(training: DescriptorTrainingSet, among: Mask, scale: float, seed: int) -> tuple[Floats, Floats]:
    """One machine per place seen: weights (D, k) and offsets (D,)."""
    check_optional("sklearn", "ullah2008")
    from sklearn.svm import LinearSVC

    machine = LinearSVC(dual=False, random_state=seed).fit(training.points[among] / scale, training.truth[among])
    weights, offsets = machine.coef_, machine.intercept_
    if len(weights) == 1:
        # Of two places scikit-learn keeps the machine of the second.
        return np.concatenate([-weights, weights]), np.concatenate([-offsets, offsets])
    return weights, offsets


def _temperature(training: DescriptorTrainingSet, scale: float, seed: int) -> float:
    """What makes the softmax of the margins believable on held-out training frames; 1 where no fold can tell."""
    beliefs, truths = [], []
    for held in held_out_folds(training.sequences):
        columns = np.unique(training.truth[~held])
        judged = held & np.isin(training.truth, columns)
        if len(columns) > 1 and judged.any():
            weights, offsets = _machines(training, ~held, scale, seed)
            found = scattered(margins(training.points[judged] / scale, weights, offsets), columns, len(training.places))
            beliefs.append(normalised(np.maximum(found, _ABSENT)))
            truths.append(training.truth[judged])
    return fit_calibration(np.concatenate(beliefs), np.concatenate(truths)).temperature if beliefs else 1.0
