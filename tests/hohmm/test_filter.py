"""The filter: worked by hand, equal to its definition word by word, in blocks of any size, and never NaN."""

import math

import numpy as np
import pytest
from helpers import plain_filter
from helpers.filter_cases import Case, cases
from hypothesis import given, settings, strategies as st

from placerec.hohmm import filter, filter_stream, fixed_transition, learned_transition
from placerec.hohmm.filter import filter_step
from placerec.hohmm.prediction import predictor


@given(cases(longest=60))
def test_the_filter_is_its_definition(case: Case) -> None:
    expected, possible = plain_filter.filtered(*case)
    found = filter_stream(case.log10_p, case.transition, case.steps)
    assert found.belief == pytest.approx(expected, abs=1e-12)
    assert found.possible.tolist() == possible
    assert found.zero_likelihood_words == possible.count(False)


@settings(max_examples=50)
@given(cases(longest=60), st.integers(1, 9), st.integers(1, 100), st.integers(1, 3))
def test_blocks_of_any_size_give_the_same(case: Case, block: int, together: int, unscaled: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filter, "BLOCK", block)
        patch.setattr(filter, "SIDE_BY_SIDE", together)
        patch.setattr(filter, "UNSCALED", unscaled)
        blocks = filter_stream(case.log10_p, case.transition, case.steps)
    whole = filter_stream(case.log10_p, case.transition, case.steps)
    assert blocks.belief == pytest.approx(whole.belief, abs=1e-12)
    assert np.array_equal(blocks.possible, whole.possible)


@given(cases(longest=30))
def test_later_words_never_change_the_last_digit(case: Case) -> None:
    """Also where they follow in no time, over which no place changes."""
    whole = filter_stream(case.log10_p, case.transition, case.steps).belief
    for n in range(1, len(whole)):
        assert np.array_equal(filter_stream(case.log10_p[:n], case.transition, case.steps[:n]).belief, whole[:n])


@settings(max_examples=40)
@given(cases(longest=40))
def test_word_by_word_is_the_array(case: Case) -> None:
    whole = filter_stream(case.log10_p, case.transition, case.steps).belief
    places = case.log10_p.shape[1]
    log_belief = [-math.log(places)] * places
    for t, row in enumerate(case.log10_p.tolist()):
        if t:
            log_belief = predictor(case.transition, case.elapsed[t])(log_belief)
        log_belief, _ = filter_step(log_belief, row)
        assert np.exp(log_belief) == pytest.approx(whole[t], abs=1e-12)


@pytest.mark.parametrize("places", [1, 2, 12])
@pytest.mark.parametrize("kind", ["fixed", "learned", "seconds"])
def test_later_words_do_not_change_the_last_digit(kind: str, places: int) -> None:
    rng = np.random.default_rng(places)
    log10_p = rng.normal(-2, 1, (1000, places))
    elapsed = rng.integers(1, 9, 1000) / (4 if kind == "seconds" else 1)
    if kind == "learned":
        transition = learned_transition(rng.integers(0, 9, (places, places)))
    else:
        transition = fixed_transition(places, 0.99, "second" if kind == "seconds" else "update")
    whole = filter_stream(log10_p, transition, elapsed).belief
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filter, "SIDE_BY_SIDE", 2 * places**2)
        pieces = filter_stream(log10_p, transition, elapsed).belief
    assert pieces == pytest.approx(whole, abs=1e-13)
    untouched = log10_p.copy()
    for length in (1, 257, 258, 513, 700):
        assert np.array_equal(filter_stream(log10_p[:length], transition, elapsed[:length]).belief, whole[:length])
    assert np.array_equal(log10_p, untouched)


def test_what_is_believed_least_is_not_lost_where_places_do_not_mix() -> None:
    # 800 decades against the first place, then 801 for it: nothing may have been rounded to zero.
    log10_p = np.array([[-400.0, 0.0], [-400.0, 0.0], [0.0, -400.0], [0.0, -401.0]])
    belief = filter_stream(log10_p, fixed_transition(2, 1.0)).belief
    assert belief[1].tolist() == [0.0, 1.0]
    assert belief[3] == pytest.approx(np.array([10, 1]) / 11)


def test_two_steps_by_hand() -> None:
    # Uniform start, no prediction before the first word: 0.8 : 0.2 becomes 0.8, 0.2.
    # Prediction with stay 0.9: 0.9 * 0.8 + 0.1 * 0.2 = 0.74; then 0.74 * 0.1 : 0.26 * 0.5 = 0.074 : 0.13.
    log10_p = np.log10([[0.8, 0.2], [0.1, 0.5]])
    found = filter_stream(log10_p, fixed_transition(2, 0.9)).belief
    assert found == pytest.approx(np.array([[0.8, 0.2], [0.074 / 0.204, 0.13 / 0.204]]), abs=1e-12)


@given(st.integers(0, 5), st.lists(st.sampled_from([-math.inf, -500.0, -3.0, 0.0]), min_size=12, max_size=12))
def test_never_nan(places: int, values: list[float]) -> None:
    log10_p = np.array(values).reshape(4, 3)
    for stay in (0.0, 1 / 3, 0.99, 1.0):
        found = filter_stream(log10_p, fixed_transition(3, stay))
        assert np.isfinite(found.belief).all()
        assert found.belief.sum(axis=1) == pytest.approx(np.ones(4))


def test_where_no_place_explains_the_word_the_prediction_is_kept() -> None:
    log10_p = np.array([[-1.0, -2.0], [-np.inf, -np.inf]])
    found = filter_stream(log10_p, fixed_transition(2, 0.9))
    first = np.array([10, 1]) / 11
    assert found.zero_likelihood_words == 1
    assert found.belief[1] == pytest.approx(0.9 * first + 0.1 * first[::-1])


def test_bounds_of_the_prediction() -> None:
    # readings 1.3: after a prediction every place has at least (1 - p_e) / (C - 1), and none more than p_e.
    transition = fixed_transition(5, 0.99)
    sure = np.array([1 - 4e-12, 1e-12, 1e-12, 1e-12, 1e-12])
    predicted = sure @ transition.over(1)
    assert predicted.min() >= 0.0025 - 1e-12
    assert predicted.max() <= 0.99


def test_staying_at_chance_forgets_and_staying_for_certain_multiplies() -> None:
    log10_p = np.log10([[0.9, 0.1], [0.2, 0.8], [0.5, 0.3]])
    forgets = filter_stream(log10_p, fixed_transition(2, 0.5)).belief[-1]
    assert forgets == pytest.approx(np.array([5, 3]) / 8)
    product = np.prod(10**log10_p, axis=0)
    assert filter_stream(log10_p, fixed_transition(2, 1.0)).belief[-1] == pytest.approx(product / product.sum())


def test_one_place_is_certain() -> None:
    assert filter_stream(np.full((3, 1), -2.0), fixed_transition(1)).belief.tolist() == [[1.0]] * 3
