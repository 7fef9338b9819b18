"""Pronobis & Caputo 2007: a second cue is computed only where the first is not sure.

A. Pronobis, B. Caputo: "Confidence-based cue integration for visual place recognition", IROS 2007. Frame by frame: if
the best place by the first cue leads the second best by less than a threshold, the next cue is computed and what both
say is added up. Theirs are support vector machines on global and local features, with the distance between the two
best scores as the confidence (from memory). Here a cue is the word of a dictionary, its score the logarithm of the
word's add-one probability in each place, weights are equal, and the confidence is the difference of the two highest
beliefs; two dictionaries of different descriptors (GIST, then CENTRIST) make it a second look at the image and not at
the first cue. The threshold is the one with the highest accuracy on held-out training sequences, the smallest of
equals. No frame knows those before it.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm.filter import normalised
from placerec.methods.descriptors import held_out_folds
from placerec.methods.training_set import lead

# The thresholds that are tried: the first never asks the second cue, since a lead is between 0 and 1; the last always.
MARGINS: tuple[float, ...] = (*np.linspace(0, 1, 41).tolist(), 1.1)


class Answer(NamedTuple):
    """The belief float64 (C,) after one frame, and whether the second cue was asked."""

    belief: Floats
    consulted: bool


# A frame's unit in the first dictionary, and what finds the one in the second.
CueStep = Callable[[int, Callable[[], int]], Answer]


def fit(units: Sequence[Ints], truth: Ints, sequences: Ints, words: Sequence[int], places: int) -> CueStep:
    """The cascade of two cues, from n labelled training frames.

    `units`: int64 (n,) of each frame in either dictionary, which have `words` units; `truth` int64 (n,): columns;
    `sequences` int64 (n,): the number of each frame's sequence.
    """
    return cascade(units, truth, words, places, best_margin(units, truth, sequences, words, places))


def cascade(units: Sequence[Ints], truth: Ints, words: Sequence[int], places: int, margin: float) -> CueStep:
    """The cascade of two cues with a given threshold: the least lead with which the first cue decides alone."""
    first, second = (_log_p(its, truth, K, places) for its, K in zip(units, words, strict=True))

    def step(unit: int, look_again: Callable[[], int]) -> Answer:
        scores = first[unit]
        belief = normalised(scores)
        if lead(belief) >= margin:
            return Answer(belief, False)
        return Answer(normalised(scores + second[look_again()]), True)

    return step


def best_margin(units: Sequence[Ints], truth: Ints, sequences: Ints, words: Sequence[int], places: int) -> float:
    """The one of MARGINS with the highest accuracy on held-out frames, the smallest of equals."""
    right = np.zeros(len(MARGINS))
    for held in held_out_folds(sequences):
        first, second = (_log_p(its[~held], truth[~held], K, places) for its, K in zip(units, words, strict=True))
        scores = first[units[0][held]]
        leads = np.array([lead(normalised(row)) for row in scores])
        alone = scores.argmax(axis=1) == truth[held]
        both = (scores + second[units[1][held]]).argmax(axis=1) == truth[held]
        right += [np.where(leads < margin, both, alone).sum() for margin in MARGINS]
    return MARGINS[int(right.argmax())]


def _log_p(units: Ints, truth: Ints, words: int, places: int) -> Floats:
    """Log of the add-one probability (K, C) of each unit in each place."""
    counts = np.bincount(units * places + truth, minlength=words * places).reshape(words, places) + 1.0
    logs: Floats = np.log(counts / counts.sum(axis=0))
    return logs
