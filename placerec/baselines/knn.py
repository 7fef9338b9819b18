"""The nearest training frames vote: the control for everything that turns descriptors into words or models.

Frame by frame, Euclidean distance in the dictionary's principal components, a vote each; the belief in a place is its
share of the votes, so that it has few values and is zero in most places. scikit-learn finds the neighbours.
"""

import numpy as np

from placerec.baselines.views import Floats, PointFollow, Views
from placerec.errors import check_optional

NEIGHBOURS = 5


def fit(views: Views, *, neighbours: int = NEIGHBOURS) -> PointFollow:
    """Beliefs by the votes of the nearest `neighbours`; MissingExtraError without scikit-learn."""
    check_optional("sklearn", "knn")
    from sklearn.neighbors import KDTree

    tree = KDTree(views.points)
    voters = min(neighbours, len(views.truth))
    places = len(views.places)

    def step(point: Floats) -> Floats:
        nearest = tree.query(point[None], k=voters, return_distance=False)[0]
        votes: Floats = np.bincount(views.truth[nearest], minlength=places) / voters
        return votes

    return lambda: step
