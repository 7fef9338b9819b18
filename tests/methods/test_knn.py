"""Nearest frames: the votes against sorting all distances."""

import sys

import numpy as np
import pytest
from helpers.point_clouds import clouds

from placerec.errors import MissingExtraError
from placerec.methods import knn


def test_votes_are_those_of_the_nearest_frames() -> None:
    pytest.importorskip("sklearn")
    training, test = clouds(1, apart=1.0), clouds(2, sequences=1, apart=1.0)
    step = knn.fit(training, neighbours=7)()
    for point in test.points:
        nearest = np.argsort(((training.points - point) ** 2).sum(axis=1))[:7]
        expected = [(training.truth[nearest] == column).sum() / 7 for column in range(3)]
        np.testing.assert_allclose(step(point), expected)


def test_fewer_frames_than_neighbours_all_vote() -> None:
    pytest.importorskip("sklearn")
    training = clouds(1, sequences=1, frames=6)
    np.testing.assert_allclose(knn.fit(training, neighbours=50)()(np.zeros(4)), np.bincount(training.truth) / 6)


def test_without_scikit_learn_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(MissingExtraError, match=r"knn needs the package scikit-learn, .*-m pip install scikit-learn"):
        knn.fit(clouds())
