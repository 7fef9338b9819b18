"""Somewhere new: worked by hand, on-line as in one go, and only as sure as its evidence."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.arrays import Floats
from placerec.hohmm.filter import filter_stream
from placerec.hohmm.posterior import forward_backward
from placerec.hohmm.unknown import (
    CHAIN,
    DistanceModel,
    UnknownModel,
    WordRuns,
    add_histograms,
    chain_evidence,
    distance_bins,
    distance_histogram,
    evidence,
    measure_distances,
    prior,
    unknown_model,
    word_runs,
)

NO_DISTANCE = np.array([np.nan])
ratio_lists = st.lists(st.floats(-6, 6), min_size=1, max_size=6)


def test_runs_of_equal_words_are_counted_per_visit() -> None:
    # a a b | b b b, and in the other place: a. The visit's end parts the two runs of b.
    assert word_runs([[["a", "a", "b"], ["b", "b", "b"]], [["a"]], []]) == WordRuns(frames=7, runs=4, words=2)
    assert word_runs([]) == WordRuns(0, 0, 0)


def test_a_word_speaks_for_a_new_place_where_it_surprises() -> None:
    # V = 100, C = 2. Known: 0.5 * 0.2 + 0.5 * 0.1 = 0.15; anywhere: (0.2 + 0.1 + 0.01) / 3.
    model = UnknownModel(vocabulary=100, news=1.0, distance=None)
    even = evidence(model, np.log10([[0.2, 0.1]]), np.array([[0.5, 0.5]]), NO_DISTANCE)
    assert even == pytest.approx([math.log(0.31 / 3 / 0.15)])
    # The filter was sure of the place that does not know the word: known is 0.99 * 0.001 + 0.01 * 0.3.
    surprised = evidence(model, np.log10([[0.001, 0.3]]), np.array([[0.99, 0.01]]), NO_DISTANCE)
    assert surprised == pytest.approx([math.log(0.311 / 3 / 0.00399)])
    # Half of the frames repeat the one before: each counts for half.
    assert (
        evidence(UnknownModel(100, 0.5, None), np.log10([[0.2, 0.1]]), np.array([[0.5, 0.5]]), NO_DISTANCE) == even / 2
    )


def test_a_word_that_no_place_explains_counts_as_much_as_the_flat_model_allows() -> None:
    model = UnknownModel(vocabulary=10, news=1.0, distance=None)
    nowhere = evidence(model, np.full((1, 2), -np.inf), np.array([[0.5, 0.5]]), NO_DISTANCE)
    elsewhere = evidence(model, np.array([[-np.inf, -1.0]]), np.array([[1.0, 0.0]]), NO_DISTANCE)
    assert nowhere == elsewhere == pytest.approx([math.log(10)])


def test_a_distance_speaks_for_a_new_place_from_half_an_octave_outside() -> None:
    # Training: bins 8 and 9, i.e. log2 distances 1.0625 and 1.1875, mean 1.125, variance 1/256. No repetition, and more
    # runs than words: with 10 runs of 5 words new frames lie 0.5 log2((10 + 4.5) / (10 - 4.5)) further out.
    model = unknown_model(100, WordRuns(10, 10, 5), [{8: 1, 9: 1}, {}])
    assert model.distance is not None
    shift = 0.5 * math.log2(14.5 / 5.5)
    assert model.distance.mean == pytest.approx([1.125 + shift] * 2)  # a place without distances: the mean of all
    assert model.distance.variance == pytest.approx(1 / 256 + 0.09)
    log10_p, predicted = np.full((5, 2), -2.0), np.full((5, 2), 0.5)  # words without news: 1/V in all places
    middle = 1.125 + shift + 0.5
    found = evidence(model, log10_p, predicted, 2.0 ** np.array([middle, middle + 0.5, middle + 9, middle - 9, np.nan]))
    slope = 1 / (1 / 256 + 0.09)
    assert found == pytest.approx([0, 0.5 * slope, slope, -slope, 0], abs=1e-9)


def test_without_distances_only_words_count() -> None:
    assert unknown_model(100, WordRuns(10, 5, 5), None).distance is None
    assert unknown_model(100, WordRuns(10, 5, 5), [{}, {}]).distance is None
    assert unknown_model(100, WordRuns(0, 0, 0)).news == 1


def test_each_place_has_its_own_distances() -> None:
    model = unknown_model(10, WordRuns(100, 100, 10), [{0: 50}, {16: 50}])
    assert model.distance is not None
    near, far = model.distance.mean
    assert far - near == pytest.approx(2)
    # The same frame is far out for the first place and near for the second.
    flat = np.full((1, 2), -1.0)
    first = evidence(model, flat, np.array([[1.0, 0.0]]), 2.0 ** np.array([far]))
    second = evidence(model, flat, np.array([[0.0, 1.0]]), 2.0 ** np.array([far]))
    assert first[0] > 0 > second[0]


def test_every_run_a_word_of_its_own_is_no_division_by_zero() -> None:
    model = unknown_model(10, WordRuns(10, 10, 10), [{0: 10}])
    assert model.distance is not None
    assert np.isfinite(model.distance.mean).all()


def test_held_out_frames_tell_how_far_out_new_ones_lie() -> None:
    histograms = [{0: 4}, {8: 4}]  # means 0.0625 and 1.0625
    places = np.array([0, 0, 1, 1, 0])
    distances = 2.0 ** np.array([1.0625, 2.0625, 2.0625, 3.0625, np.nan])
    measured = measure_distances(distances, places, histograms)
    assert measured == pytest.approx((1.5, 0.25))
    model = unknown_model(10, WordRuns(8, 8, 2), histograms, measured=measured)
    assert model.distance is not None
    assert model.distance.mean == pytest.approx([1.5625, 2.5625])
    assert model.distance.variance == pytest.approx(0.25 + 0.09)
    assert measure_distances(distances[4:], places[4:], histograms) is None
    assert measure_distances(distances, places, [{}, {}]) is None


def unknown(ratios: list[float], places: int, steps: Floats, *, smoothed: bool = False) -> Floats:
    """The probability of the chain's first state."""
    log10_p = chain_evidence(np.array(ratios), places)
    found: Floats = (
        forward_backward(log10_p, CHAIN, steps) if smoothed else filter_stream(log10_p, CHAIN, steps).belief
    )[:, 0]
    return found


def test_one_place_more_before_anything_is_seen() -> None:
    assert prior(3) == (1 / 4, 3 / 4)
    # Evidence that says nothing leaves it on the way to a half, by 1 - p_e a step.
    assert unknown([0.0, 0.0], 3, np.ones(2)) == pytest.approx([0.25, 0.25 * 0.99 + 0.75 * 0.01])


@given(ratio_lists, st.integers(1, 4), st.lists(st.integers(0, 4), min_size=7, max_size=7))
def test_filter_and_smoother_equal_enumeration(ratios: list[float], places: int, gaps: list[int]) -> None:
    steps = np.array([0.0, *gaps[: len(ratios) - 1]])
    filtered, smoothed = unknown(ratios, places, steps), unknown(ratios, places, steps, smoothed=True)
    chain = np.array([[0.99, 0.01], [0.01, 0.99]])
    for seen, found in ((None, smoothed), (len(ratios) - 1, filtered)):
        weights = np.zeros((len(ratios), 2))
        for path in product((0, 1), repeat=len(ratios)):
            weight = (places / (places + 1), 1 / (places + 1))[path[0]]
            for t, state in enumerate(path):
                if t:
                    weight *= np.linalg.matrix_power(chain, int(steps[t]))[path[t - 1], state]
                weight *= math.exp(ratios[t]) if state else 1.0
            weights[range(len(ratios)), path] += weight
        expected = weights[:, 1] / weights.sum(axis=1)
        if seen is None:
            assert found == pytest.approx(expected, abs=1e-12)
        else:
            assert found[seen] == pytest.approx(expected[seen], abs=1e-12)


@given(st.lists(st.tuples(*[st.floats(-8, 0)] * 3), min_size=1, max_size=6), st.permutations(range(3)))
def test_the_order_of_places_does_not_matter(rows: list[tuple[float, ...]], order: list[int]) -> None:
    log10_p = np.array(rows)
    predicted = np.tile([0.7, 0.2, 0.1], (len(rows), 1))
    distances = np.linspace(0.5, 4, len(rows))
    mean = np.array([0.0, 0.5, 1.0])
    found = evidence(UnknownModel(20, 0.4, DistanceModel(mean, 0.3)), log10_p, predicted, distances)
    other = UnknownModel(20, 0.4, DistanceModel(mean[order], 0.3))
    assert evidence(other, log10_p[:, order], predicted[:, order], distances) == pytest.approx(found, abs=1e-12)
    alone = evidence(UnknownModel(20, 0.4, DistanceModel(mean, 0.3)), log10_p[:1], predicted[:1], distances[:1])
    assert alone == pytest.approx(found[:1], abs=1e-12)


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
