"""`ranganathan2010`: Ranganathan 2010 (PLISS), Bayesian change points with a Polya model of each place.

The stream is cut into segments, each in one place; at every frame a new one begins with probability H, in any place,
the same one too. Within a segment a word has probability (n_w + alpha_c(w)) / (n + A), where n_w and n count the
segment's words so far: a segment that has seen a word expects it again, however rare it is in the place (readings 3.7).
The belief sums over all ways to cut (Adams & MacKay's recursion over the beginning of the current segment). With
`unknown`, a broad model without a place, alpha(w) = A / V, competes as one place more.

alpha_c(w) = A P(w | c), P(w | c) = (n_c(w) + delta) / (n_c + delta V). H is what the training counted, smoothed as if a
change in 150 frames had been seen before; that alone where nothing was counted. The MOST probable beginnings are kept.

Simplified: one word a frame, where the original has a pyramid of histograms; A = 50 for all places (readings: 30 to
100) instead of the most likely alpha of each; new places are recognised, not learned.
"""

import numpy as np

from placerec.arrays import Floats
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, log_word_p

CONCENTRATION = 50.0
VISIT = 150
MOST = 60


def fit(
    training: TrainingSet, *, concentration: float = CONCENTRATION, most: int = MOST, unknown: bool = False
) -> MakeStepper:
    """Belief from all ways to cut the stream; with `unknown` it has one column more, which is the last."""
    C, V = len(training.places), len(training.vocabulary)
    alpha = concentration * np.exp(log_word_p(training)).T
    if unknown:
        alpha = np.concatenate([alpha, np.full((V, 1), concentration / V)], axis=1)
    start = np.full(alpha.shape[1], 1 / (C + unknown))
    go_on = 1 - hazard(training)

    def make_stepper() -> StepFunction:
        # Of the beginnings that are kept: joint probability with the places, words of the segment so far.
        weights = np.zeros((most, len(start)))
        counts, totals = np.zeros((most, V)), np.zeros((most, 1))
        begun = 0

        def step(word: int, elapsed: int) -> Floats:
            nonlocal begun
            same = go_on**elapsed
            row = begun if begun < most else int(weights.sum(axis=1).argmin())
            weights[:begun] *= same
            weights[row], counts[row], totals[row] = (1 - same if begun else 1.0) * start, 0, 0
            begun = min(begun + 1, most)
            weights[:begun] *= (counts[:begun, word, None] + alpha[word]) / (totals[:begun] + concentration)
            weights[:begun] /= weights[:begun].sum()
            counts[:begun, word] += 1
            totals[:begun] += 1
            belief: Floats = weights[:begun].sum(axis=0)
            belief /= belief.sum()
            return belief

        return step

    return make_stepper


def hazard(training: TrainingSet) -> float:
    """The probability that a segment ends at a frame."""
    if training.steps is None:
        return 1 / VISIT
    changes = training.steps.sum() - np.trace(training.steps)
    return float((changes + 1) / (training.steps.sum() + VISIT))
