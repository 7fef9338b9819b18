"""`filliat2008`: Filliat 2008, words that vote for places until one is clear enough.

A word votes for each place where it was ever seen, with log(C / number of such places): like tf-idf, it says more the
fewer places know it (readings 3.8). Votes are added up until the winner is ahead of the second by QUALITY of its own
votes, or MOST words have voted; that is the decision, which stands until the next one, made of new votes. The belief is
the share of the votes.

Simplified: one feature space and one word an image, where the original adds up the votes of many local features in
several spaces; "look around for another image" is the next frame of the stream; the dictionary does not grow and nobody
corrects. QUALITY and MOST are ours: the winner has twice the second's votes, or it has been a second at ten frames a
second. Before the first decision the belief is that of the votes so far.
"""

import numpy as np

from placerec.arrays import Floats
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, lead

QUALITY, MOST = 0.5, 10


def fit(training: TrainingSet, *, quality: float = QUALITY, most: int = MOST) -> MakeStepper:
    """Belief from the votes of the last decision, which has `quality` from 0 to 1 or `most` words."""
    votes = word_votes(training)
    places = len(training.places)

    def make_stepper() -> StepFunction:
        belief = np.full(places, 1 / places)
        total, words, decided = np.zeros(places), 0, False

        def step(word: int, elapsed: int) -> Floats:
            nonlocal belief, total, words, decided
            total, words = total + votes[word], words + 1
            done = words == most or relative_lead(total) >= quality
            if (done or not decided) and total.any():
                belief = total / total.sum()
            if done:
                total, words, decided = np.zeros(places), 0, True
            return belief

        return step

    return make_stepper


def word_votes(training: TrainingSet) -> Floats:
    """What each word votes for each place, float64 (V, C); words that no place or every place knows do not vote."""
    known = training.counts.T > 0
    rooms = known.sum(axis=1, keepdims=True)
    votes: Floats = known * np.log(known.shape[1] / np.maximum(rooms, 1))
    return votes


def relative_lead(votes: Floats) -> float:
    """(winner - second) / winner; 0 without any vote, 1 without a second place."""
    return float(lead(np.append(votes, 0.0)) / votes.max()) if votes.any() else 0.0
