"""The nearest training frames vote: the control for everything that turns descriptors into words or models.

Frame by frame, Euclidean distance in the dictionary's principal components, a vote each; the belief in a place is its
share of the votes, so that it has few values and is zero in most places. scikit-learn finds the neighbours.
"""

import numpy as np

from placerec.arrays import Floats
from placerec.errors import check_optional
from placerec.methods.descriptors import DescriptorTrainingSet, MakePointStepper

NEIGHBOURS = 5


def fit(training: DescriptorTrainingSet, *, neighbours: int = NEIGHBOURS) -> MakePointStepper:
    """Beliefs by the votes of the nearest `neighbours`; MissingExtraError without scikit-learn."""
    check_optional("sklearn", "knn")
    from sklearn.neighbors import KDTree

    tree = KDTree(training.points)
    voters = min(neighbours, len(training.truth))
    places = len(training.places)

    def step(point: Floats) -> Floats:
        nearest = tree.query(point[None], k=voters, return_distance=False)[0]
        votes: Floats = np.bincount(training.truth[nearest], minlength=places) / voters
        return votes

    return lambda: step
