"""Forward-backward, fixed lag and Viterbi: equal to the enumeration of all paths."""

import numpy as np
import pytest
from helpers import plain_filter
from helpers.filter_cases import Case, cases
from hypothesis import given, settings

from placerec.hohmm import filter_stream, fixed_transition, posterior
from placerec.hohmm.posterior import fixed_lag, forward_backward, viterbi

small = cases(longest=4, most=3)


@given(small)
def test_forward_backward_is_the_sum_over_all_paths(case: Case) -> None:
    found = forward_backward(case.log10_p, case.transition, case.steps)
    assert found == pytest.approx(plain_filter.posterior(*case), abs=1e-11)


@given(small)
def test_viterbi_is_the_best_of_all_paths(case: Case) -> None:
    every = plain_filter.paths(*case)
    path = tuple(viterbi(case.log10_p, case.transition, case.steps).tolist())
    assert every[path] == pytest.approx(max(every.values()), abs=1e-9)


@given(small)
def test_a_lagged_posterior_is_that_of_the_shorter_sequence(case: Case) -> None:
    T = len(case.log10_p)
    for known in range(T):
        cut = slice(0, known + 1)
        shorter = plain_filter.posterior(case.log10_p[cut], case.transition, case.elapsed[cut])
        now = np.arange(known + 1)
        found = fixed_lag(case.log10_p, case.transition, case.steps, now, np.full(known + 1, known))
        assert found == pytest.approx(shorter, abs=1e-11)


@settings(max_examples=50)
@given(cases())
def test_no_lag_is_the_filter_and_a_long_one_is_smoothing(case: Case) -> None:
    now = np.arange(len(case.log10_p))
    arguments = case.log10_p, case.transition, case.steps
    assert fixed_lag(*arguments, now, now) == pytest.approx(filter_stream(*arguments).belief, abs=1e-11)
    assert fixed_lag(*arguments, now, np.full(len(now), now[-1])) == pytest.approx(
        forward_backward(*arguments), abs=1e-11
    )


@settings(max_examples=50)
@given(cases())
def test_the_last_posterior_is_the_filter(case: Case) -> None:
    arguments = case.log10_p, case.transition, case.steps
    assert forward_backward(*arguments)[-1] == pytest.approx(filter_stream(*arguments).belief[-1], abs=1e-11)


def test_long_sequences_are_smoothed_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    log10_p = np.random.default_rng(0).normal(-1, 1, (50, 3))
    arguments = log10_p, fixed_transition(3, 0.8), (np.arange(50) % 4).astype(np.float64)
    now = np.arange(50)
    known = np.minimum(now + 7, 49)
    whole = forward_backward(*arguments), fixed_lag(*arguments, now, known), viterbi(*arguments)
    monkeypatch.setattr(posterior, "CHUNK", 6)
    pieces = forward_backward(*arguments), fixed_lag(*arguments, now, known), viterbi(*arguments)
    for one, other in zip(whole, pieces, strict=True):
        assert np.array_equal(one, other)


def test_later_words_correct_a_late_switch() -> None:
    # The place changes after the second word, but one word in the new place says little.
    log10_p = np.log10([[0.9, 0.1], [0.9, 0.1], [0.4, 0.6], [0.1, 0.9], [0.1, 0.9]])
    transition = fixed_transition(2, 0.98)
    assert filter_stream(log10_p, transition).belief.argmax(axis=1).tolist() == [0, 0, 0, 0, 1]
    assert forward_backward(log10_p, transition, np.ones(5)).argmax(axis=1).tolist() == [0, 0, 1, 1, 1]
    assert viterbi(log10_p, transition, np.ones(5)).tolist() == [0, 0, 1, 1, 1]


def test_nothing_is_nothing() -> None:
    nothing, none = np.empty((0, 2)), np.empty(0)
    assert forward_backward(nothing, fixed_transition(2), none).shape == (0, 2)
    assert viterbi(nothing, fixed_transition(2), none).shape == (0,)
