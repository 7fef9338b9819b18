"""Histograms of distances: which bin, what is left out, and that taking away undoes adding."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from placerec.arrays import Floats
from placerec.hohmm.unknown import add_histograms, distance_bins, distance_histogram

DISTANCES = st.lists(st.floats(1e-9, 1e9), max_size=30).map(np.array)


def test_bins_are_an_eighth_of_an_octave() -> None:
    assert distance_bins(np.array([1, 1.09, 1.1, 2, 0.5, 0.49])).tolist() == [0, 0, 1, 8, -8, -9]


def test_what_is_no_distance_is_left_out() -> None:
    assert distance_histogram(np.array([0, np.nan, -1, np.inf, 4, 1, 4])) == {0: 1, 16: 2}
    assert distance_histogram(np.zeros(0)) == {}


@given(DISTANCES)
def test_every_distance_is_inside_its_bin(distances: Floats) -> None:
    for distance, b in zip(distances, distance_bins(distances), strict=True):
        assert 2 ** (b / 8) * (1 - 1e-12) <= distance <= 2 ** ((b + 1) / 8) * (1 + 1e-12)


@given(DISTANCES, DISTANCES)
def test_the_sum_is_the_histogram_of_all_and_taking_away_undoes_it(first: Floats, second: Floats) -> None:
    a, b = distance_histogram(first), distance_histogram(second)
    both = add_histograms(a, b)
    assert list(both.items()) == list(distance_histogram(np.concatenate([first, second])).items())
    assert list(add_histograms(both, b, -1).items()) == list(a.items())
