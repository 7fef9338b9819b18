"""The filter over points whose evidence has a weight, and which does not remember for ever: both are learned.

With A the transitions and pi the places' shares, the belief in place c is in proportion to p(point | c)^alpha times
(1 - memory) sum over c' of b(c') A(c', c) + memory pi(c). Neighbouring frames are alike, and count as less than one
each; what the filter took for true long ago fades. Both numbers are those with the least mean -log b(true place) on
training sequences that were held out, five groups of them at most, for which likelihoods, transitions and shares are
learned without each; of a single sequence nothing is held out, and both stay 1 and 0. (The components of the points are
those of all training sequences.)
"""

from dataclasses import replace
from itertools import product

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.hohmm import Transition, filter_stream, learned_transition
from placerec.lm.logs import LN10
from placerec.methods.descriptors import (
    DescriptorTrainingSet,
    FitPoints,
    MakePointStepper,
    filtered,
    held_out_folds,
)

ALPHAS = (1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.09, 0.06, 0.04, 0.03, 0.02, 0.01)
MEMORIES = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0)
GROUPS = 5
_SMALLEST_BELIEF = 1e-15


def fit(training: DescriptorTrainingSet, likelihoods: FitPoints) -> MakePointStepper:
    """Beliefs of the filter over `likelihoods`, weighed as the training asks for."""
    alpha, memory = best_weights(training, likelihoods)
    of_point = likelihoods(training)
    return filtered(lambda point: alpha * of_point(point), fading(training, memory))


def fading(training: DescriptorTrainingSet, memory: float) -> Transition:
    """Transitions a frame that forget: (1 - memory) A + memory pi in every row."""
    frames, places = np.bincount(training.truth, minlength=len(training.places)), len(training.places)
    shares = (frames + 1 / places) / (frames.sum() + 1)
    learned = learned_transition(training.steps)
    return Transition((1 - memory) * learned.matrix + memory * shares, learned.per)


def best_weights(training: DescriptorTrainingSet, likelihoods: FitPoints) -> tuple[float, float]:
    """The alpha and the memory with the least log loss on held-out training sequences; the first of equals."""
    ways = list(product(ALPHAS, MEMORIES))
    if len(np.unique(training.sequences)) == 1:
        return 1.0, 0.0
    loss = np.zeros(len(ways))
    for held in held_out_folds(training.sequences, GROUPS):
        rest = without(training, held)
        of_point, known = likelihoods(rest), np.isin(training.truth, rest.truth)
        transitions = {memory: fading(rest, memory) for memory in MEMORIES}
        for sequence in np.unique(training.sequences[held]):
            rows = np.flatnonzero(training.sequences == sequence)
            log10_p = np.array([of_point(point) for point in training.points[rows]]) / LN10
            judged, truth = known[rows], training.truth[rows]
            loss += [
                _log_loss(filter_stream(alpha * log10_p, transitions[memory]).belief[judged], truth[judged])
                for alpha, memory in ways
            ]
    return ways[int(loss.argmin())]


def without(training: DescriptorTrainingSet, held: Mask) -> DescriptorTrainingSet:
    """The training set without some sequences, whose frames are `held`, bool (n,); its steps are counted anew."""
    truth, sequences, places = training.truth[~held], training.sequences[~held], len(training.places)
    steps = np.zeros((places, places), np.int64)
    together = sequences[1:] == sequences[:-1]
    np.add.at(steps, (truth[:-1][together], truth[1:][together]), 1)
    return replace(training, points=training.points[~held], truth=truth, sequences=sequences, steps=steps)


def _log_loss(belief: Floats, truth: Ints) -> float:
    """The sum of -log b(true place) over frames (m, C) with their places (m,)."""
    loss: float = -np.log(np.maximum(belief[np.arange(len(truth)), truth], _SMALLEST_BELIEF)).sum().item()
    return loss
