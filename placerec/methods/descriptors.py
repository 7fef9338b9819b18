"""What the systems on descriptors learn from: labelled training frames as points, with their places and sequences."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.hohmm import Transition, learned_transition
from placerec.hohmm.filter import filter_step, normalised
from placerec.hohmm.prediction import predictor
from placerec.lm.logs import LN10

# A point float64 (k,) in, its belief float64 (C,) out; on-line, so that a belief depends on no later point.
PointStepFunction = Callable[[Floats], Floats]
# Fits such a function to a training set; log likelihoods, for instance, or a machine's scores.
FitPoints = Callable[["DescriptorTrainingSet"], PointStepFunction]
# Begins a sequence.
MakePointStepper = Callable[[], PointStepFunction]
MOST_FOLDS = 10


@dataclass(frozen=True)
class DescriptorTrainingSet:
    """n labelled training frames, in the order of time within a sequence.

    `points` float64 (n, k): descriptors in principal components; `truth` int64 (n,): column in `places` (C);
    `sequences` int64 (n,): number of the sequence; `steps` int64 (C, C): how often a frame of a place is followed by
    one of another (`placerec.words.place_steps`).
    """

    points: Floats = field(repr=False)
    truth: Ints = field(repr=False)
    sequences: Ints = field(repr=False)
    places: tuple[str, ...]
    steps: Ints = field(repr=False)


def held_out_folds(sequences: Ints, most: int = MOST_FOLDS) -> Iterator[Mask]:
    """Which frames to hold out, bool (n,), fold by fold, given the number of each frame's sequence, int64 (n,).

    A fold is one sequence, or each tenth one where there are more than ten; `most`: another number than ten.

    Of a single sequence its tenths: the frames beside them are near, so that they flatter what is fitted on the rest.
    """
    numbers = np.unique(sequences)
    if len(numbers) == 1:
        group = np.arange(len(sequences)) * most // len(sequences)
    else:
        group = np.searchsorted(numbers, sequences) % most
    for held in np.unique(group):
        mask: Mask = group == held
        yield mask


def scattered(part: Floats, columns: Ints, places: int) -> Floats:
    """Log probabilities (n, C) from those of some places' columns; -inf in the others."""
    spread = np.full((len(part), places), -np.inf)
    spread[:, columns] = part
    return spread


def filtered(log_likelihoods: Callable[[Floats], Floats], transition: Transition) -> MakePointStepper:
    """The filter of eq. 1 over points, one transition a frame; `log_likelihoods`: natural, (C,) of a point."""
    predict = predictor(transition, 1.0)
    places = len(transition.matrix)

    def make_stepper() -> PointStepFunction:
        log_belief: list[float] = []

        def step(point: Floats) -> Floats:
            nonlocal log_belief
            predicted = predict(log_belief) if log_belief else [-float(np.log(places))] * places
            log_belief, _ = filter_step(predicted, (log_likelihoods(point) / LN10).tolist())
            return normalised(np.array(log_belief))

        return step

    return make_stepper


def through_filter(training: DescriptorTrainingSet, likelihoods: FitPoints) -> MakePointStepper:
    """Beliefs of the filter over `likelihoods` that are fitted to the training, with its transitions."""
    return filtered(likelihoods(training), learned_transition(training.steps))
