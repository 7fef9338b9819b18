"""Gaussian mixtures: the density against scikit-learn's and by hand, the width by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.point_clouds import PLACES, clouds

from placerec.hohmm import learned_transition
from placerec.methods import torralba2003
from placerec.methods.descriptors import DescriptorTrainingSet, held_out_folds
from placerec.methods.torralba2003 import WIDTHS, best_width, draw_prototypes

KernelDensity = pytest.importorskip("sklearn.neighbors").KernelDensity


def plain_beliefs(training: DescriptorTrainingSet, points: np.ndarray, width: float) -> np.ndarray:
    """Densities of scikit-learn, one place at a time, and eq. 1 in a loop; places without frames are impossible."""
    logs = np.full((len(points), len(PLACES)), -np.inf)
    for column in np.unique(training.truth):
        cloud = KernelDensity(kernel="gaussian", bandwidth=width).fit(training.points[training.truth == column])
        logs[:, column] = cloud.score_samples(points)
    matrix = learned_transition(training.steps).matrix
    beliefs: list[np.ndarray] = []
    for row in logs:
        predicted = beliefs[-1] @ matrix if beliefs else np.full(len(PLACES), 1 / len(PLACES))
        weighed = predicted * np.exp(row - row.max())
        beliefs.append(weighed / weighed.sum())
    return np.array(beliefs)


def test_beliefs_are_those_of_kernel_densities_in_the_filter() -> None:
    training, test = clouds(1), clouds(2, sequences=1)
    step = torralba2003.fit(training)()
    online = np.array([step(point) for point in test.points])
    width = best_width(training, torralba2003.PROTOTYPES, 0)
    np.testing.assert_allclose(online, plain_beliefs(training, test.points, width), atol=1e-9)
    assert (online.argmax(axis=1) == test.truth).mean() > 0.8


def test_one_prototype_a_place_by_hand() -> None:
    """Two places, one frame each at 0 and 2 on a line: at 0.5 the squared distances are 0.25 and 2.25."""
    training = DescriptorTrainingSet(
        np.array([[0.0], [2.0]]), np.array([0, 1]), np.array([0, 1]), ("a", "b"), np.eye(2, dtype=np.int64)
    )
    width = best_width(training, 1, 0)
    belief = torralba2003.fit(training)()(np.array([0.5]))
    odds = np.exp((2.25 - 0.25) / (2 * width**2))
    np.testing.assert_allclose(belief, [odds / (1 + odds), 1 / (1 + odds)])


def test_the_width_is_the_best_of_all_by_brute_force() -> None:
    training = clouds(3, apart=1.5)
    centred = training.points - training.points.mean(axis=0)
    spread = np.sqrt((centred**2).sum(axis=1).mean())

    def evidence(width: float) -> float:
        total = 0.0
        for held in held_out_folds(training.sequences):
            rest = replace(training, points=training.points[~held], truth=training.truth[~held])
            belief = plain_beliefs(rest, training.points[held], width)
            total += np.log(np.maximum(belief[np.arange(held.sum()), training.truth[held]], 1e-15)).sum()
        return total

    widths = [spread * width for width in WIDTHS]
    assert best_width(training, 1000, 0) == pytest.approx(max(widths, key=evidence))


def test_prototypes_are_drawn_by_the_seed_and_belong_to_their_places() -> None:
    training = clouds(0)
    everything = np.ones(len(training.truth), bool)
    first, again, other = (draw_prototypes(training, everything, 5, seed) for seed in (0, 0, 1))
    assert first.count.tolist() == [5, 5, 5]
    assert first.first.tolist() == [0, 5, 10]
    assert (first.points == again.points).all()
    assert (first.points != other.points).any()
    for column, block in enumerate(np.split(first.points, 3)):
        its = training.points[training.truth == column].tolist()
        assert all(point in its for point in block.tolist())


def test_a_place_without_frames_in_a_fold_has_no_prototypes() -> None:
    training = clouds(0)
    chosen = draw_prototypes(training, training.truth != 1, 5, 0)
    assert chosen.columns.tolist() == [0, 2]
    assert chosen.first.tolist() == [0, 5]
