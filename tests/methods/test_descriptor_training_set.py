"""What all systems on descriptors share: folds of the training, and the filter over points."""

import numpy as np

from placerec.hohmm import filter_stream, fixed_transition
from placerec.lm.logs import LN10
from placerec.methods.descriptors import filtered, held_out_folds, scattered


def test_a_fold_is_a_sequence_whatever_its_number() -> None:
    numbers = np.array([7, 7, 3, 3, 3, 9])
    assert [mask.tolist() for mask in held_out_folds(numbers)] == [
        [False, False, True, True, True, False],
        [True, True, False, False, False, False],
        [False, False, False, False, False, True],
    ]


def test_many_sequences_are_held_out_in_ten_groups_and_each_once() -> None:
    numbers = np.repeat(np.arange(23), 4)
    masks = list(held_out_folds(numbers))
    assert len(masks) == 10
    assert (np.sum(masks, axis=0) == 1).all()
    assert all(len(set(numbers[mask]) & set(numbers[~mask])) == 0 for mask in masks)


def test_a_single_sequence_is_held_out_in_tenths() -> None:
    masks = list(held_out_folds(np.zeros(35, np.int64)))
    assert (np.sum(masks, axis=0) == 1).all()
    assert [int(mask.sum()) for mask in masks] == [4, 3, 4, 3, 4, 3, 4, 3, 4, 3]


def test_scattered_columns_leave_the_others_impossible() -> None:
    assert scattered(np.array([[1.0, 2.0]]), np.array([0, 2]), 3).tolist() == [[1.0, -np.inf, 2.0]]


def test_the_filter_over_points_is_the_filter_of_streams() -> None:
    rng = np.random.default_rng(0)
    log10_p = rng.normal(size=(50, 4))
    transition = fixed_transition(4, 0.9)
    make_stepper = filtered(lambda point: log10_p[int(point[0])] * LN10, transition)
    for _ in range(2):  # Every sequence starts anew.
        step = make_stepper()
        online = np.array([step(np.array([t])) for t in range(50)])
        np.testing.assert_allclose(online, filter_stream(log10_p, transition).belief, atol=1e-12)
