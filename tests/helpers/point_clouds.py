"""Small sets of points for the systems on descriptors: three places, clouds of their own, visited in turns."""

import numpy as np
from numpy.typing import NDArray

from placerec.methods.descriptors import DescriptorTrainingSet

PLACES = ("hall", "kitchen", "office")


def clouds(
    seed: int = 0, *, sequences: int = 3, frames: int = 30, apart: float = 3.0, k: int = 4
) -> DescriptorTrainingSet:
    """`frames` of each sequence, in two visits to each place; centres `apart` on axes of their own."""
    rng = np.random.default_rng(seed)
    truth = np.tile(np.arange(frames) * 6 // frames % 3, sequences)
    points = rng.normal(size=(len(truth), k)) + apart * np.eye(3, k)[truth]
    number = np.repeat(np.arange(sequences), frames)
    return DescriptorTrainingSet(points, truth, number, PLACES, steps_of(truth, number))


def steps_of(truth: NDArray[np.int64], number: NDArray[np.int64]) -> NDArray[np.int64]:
    """How often a place follows a place within a sequence."""
    steps = np.zeros((3, 3), np.int64)
    together = number[1:] == number[:-1]
    np.add.at(steps, (truth[:-1][together], truth[1:][together]), 1)
    return steps
