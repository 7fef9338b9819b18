"""How far to trust an accuracy, and a difference of two: bootstrap over sequences.

Frames of one sequence are alike, so that it is sequences that are drawn, with replacement, and all frames of a drawn
sequence come with it. A pair of methods is judged on the same draws: what is hard for both does not blur their
difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import EvaluationError
from placerec.evaluation.metrics import right_frames
from placerec.hohmm.beliefs import Beliefs

DRAWS = 10_000
LEVEL = 0.95
# Of two equal methods one is better on each of five blocks in one case of 16, on each of six in one of 32: with fewer
# than six no difference holds at the level, however clear the interval looks.
LEAST = 6


@dataclass(frozen=True)
class Pair:
    """Whether the accuracies of two methods differ: first - second, and its interval over so many `blocks`."""

    first: str
    second: str
    difference: float
    low: float
    high: float
    blocks: int

    @property
    def holds(self) -> bool:
        """The interval leaves zero out, and there are blocks enough to say so."""
        return self.blocks >= LEAST and (self.low > 0 or self.high < 0)


def count_blocks(beliefs: Sequence[Beliefs]) -> tuple[Ints, Floats, str]:
    """The U blocks that are drawn: their labelled frames, all above 0, int64 (U,); the right ones, float64 (U,); what.

    Blocks are "sequences" with a label, or "visits" (runs of a label) of a single one. EvaluationError without any.
    """
    counted = [_labelled(sequence) for sequence in beliefs]
    counted = [(truth, right) for truth, right in counted if len(truth)]
    if not counted:
        raise EvaluationError("no frame of the test sequences has a label, so nothing can be compared; label some")
    what = "sequences" if len(counted) > 1 else "visits"
    if what == "visits":
        ((truth, right),) = counted
        ends = np.flatnonzero(truth[1:] != truth[:-1]) + 1
        counted = list(zip(np.split(truth, ends), np.split(right, ends), strict=True))
    frames = np.array([len(truth) for truth, _ in counted], np.int64)
    return frames, np.array([right.sum() for _, right in counted], np.float64), what


def _labelled(sequence: Beliefs) -> tuple[NDArray[np.str_], Mask]:
    truth = np.array(sequence.truth, np.str_)
    return truth[truth != ""], right_frames(sequence)[truth != ""]


def draw(blocks: int, seed: int, draws: int = DRAWS) -> Ints:
    """How often each block is in each draw: int64 (draws, blocks), rows sum to `blocks`."""
    rng = np.random.Generator(np.random.PCG64(seed))
    return rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=draws)


def interval(drawn: Ints, value: Floats, frames: Ints) -> tuple[float, float]:
    """The percentile interval of sum(value) / sum(frames) over the draws; `value` float64 (U,), `frames` int64 (U,)."""
    # Not BLAS, whose sums depend on the number of its threads.
    shares = np.einsum("du,u->d", drawn, value) / np.einsum("du,u->d", drawn, frames)
    return middle(shares, float(value.sum() / frames.sum()))


def middle(drawn: Floats, whole: float) -> tuple[float, float]:
    """The middle 95 % of what the draws give, float64 (draws,), widened to hold `whole`, that over all blocks."""
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2]).tolist()
    return min(low, whole), max(high, whole)


def compare_pairs(right: dict[str, Floats], frames: Ints, drawn: Ints) -> list[Pair]:
    """Every two methods of `right` (name -> right frames per block), in their order."""
    pairs = []
    for first, second in combinations(right, 2):
        difference = right[first] - right[second]
        share = float(difference.sum() / frames.sum())
        pairs.append(Pair(first, second, share, *interval(drawn, difference, frames), len(frames)))
    return pairs
