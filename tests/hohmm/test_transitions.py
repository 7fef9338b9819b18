"""Transitions: closed forms are repeated multiplication, counts become probabilities, files are read or refused."""

from pathlib import Path

import numpy as np
import pytest
from helpers import plain_filter
from helpers.filter_cases import transitions
from hypothesis import given, strategies as st

from placerec.errors import ModelError
from placerec.hohmm import Transition, fixed_transition, learned_transition, prediction, read_transitions

kinds = st.integers(1, 4).flatmap(transitions)


@given(kinds, st.integers(0, 300))
def test_steps_are_repeated_multiplication(transition: Transition, steps: int) -> None:
    assert transition.over(steps) == pytest.approx(plain_filter.power(transition.matrix, steps), abs=1e-12)


@given(st.integers(1, 6), st.sampled_from([0.5, 0.9, 0.99, 1 - 1e-9, 1.0]), st.floats(0, 1e6), st.floats(0, 1e6))
def test_parts_of_a_step_add_up(places: int, stay: float, one: float, other: float) -> None:
    transition = fixed_transition(places, max(stay, 1 / places), "second")
    both = transition.over(one) @ transition.over(other)
    assert transition.over(one + other) == pytest.approx(both, abs=1e-10)
    assert both.sum(axis=1) == pytest.approx(np.ones(places), abs=1e-12)


def test_many_steps_forget_where_they_began() -> None:
    counts = [[99, 1, 0], [2, 90, 8], [0, 5, 95]]
    after = learned_transition(counts).over(10**12)
    assert after == pytest.approx(after[[1, 2, 0]], abs=1e-12)
    assert after.sum(axis=1) == pytest.approx(np.ones(3), abs=1e-12)
    assert fixed_transition(4, 0.999999).over(1e12) == pytest.approx(np.full((4, 4), 0.25), abs=1e-12)


def test_the_smallest_change_is_not_lost() -> None:
    # Half a unit in the last place of 1: the chance to be elsewhere is known to all digits.
    transition = fixed_transition(2, 1 - 2.0**-53)
    assert transition.over(2)[0, 1] == pytest.approx(2 * 2.0**-53, rel=1e-12)


@given(kinds, st.lists(st.integers(0, 9), min_size=1, max_size=9), st.booleans(), st.integers(0, 2**32))
def test_arrays_and_plain_floats_predict_alike(
    transition: Transition, elapsed: list[int], backwards: bool, seed: int
) -> None:
    C = len(transition.matrix)
    belief = np.random.default_rng(seed).dirichlet(np.ones(C), len(elapsed)).T
    steps = prediction.transition_steps(transition, np.array(elapsed, float), backwards=backwards)
    with np.errstate(divide="ignore"):
        logs = prediction.predict_logs(steps, np.log(belief), slice(None))
    states = belief.copy()
    steps.predict(states, slice(None))
    for t, count in enumerate(elapsed):
        matrix = plain_filter.power(transition.matrix, count)
        expected = (matrix @ belief[:, t]) if backwards else (belief[:, t] @ matrix)
        assert states[:, t] == pytest.approx(expected, abs=1e-12)
        assert np.exp(logs[:, t]) == pytest.approx(expected, abs=1e-12)
        if not backwards:
            predict = prediction.predictor(transition, count)
            plainly = predict([prediction.safe_log(b) for b in belief[:, t].tolist()])
            assert np.exp(plainly) == pytest.approx(expected, abs=1e-12)


def test_counts_become_probabilities() -> None:
    learned = learned_transition([[8, 1], [0, 0]])
    assert learned.per == "frame"
    assert learned.matrix == pytest.approx(np.array([[8.5 / 10, 1.5 / 10], [0.5, 0.5]]))
    assert learned_transition([[7]]).matrix.tolist() == [[1.0]]


def test_wrong_transitions_are_refused() -> None:
    with pytest.raises(ModelError, match=r"^stay probability 1\.5 is not between 0 and 1"):
        fixed_transition(3, 1.5)
    with pytest.raises(ModelError, match="transitions per 'hour' are unknown; choose update, frame, second"):
        fixed_transition(3, 0.9, "hour")  # type: ignore[arg-type]
    # A place that is left more often than at random swings: there is no half of such a step.
    with pytest.raises(ModelError, match="transitions per second need parts of a step"):
        fixed_transition(3, 0.3, "second")
    with pytest.raises(ModelError, match="transitions per second need parts of a step"):
        Transition(np.eye(2), "second")
    assert fixed_transition(3, 1 / 3, "second").over(0.5) == pytest.approx(np.full((3, 3), 1 / 3))


def test_a_file_is_read_in_the_order_of_the_places(tmp_path: Path) -> None:
    path = tmp_path / "steps.tsv"
    path.write_text("hall\tkitchen\tattic\n0.9\t0.1\t0\n\n0.333\t0.333\t0.333\r\n0\t0.5\t0.5\n")
    matrix = read_transitions(path, ("attic", "hall", "kitchen"))
    third = 1 / 3
    assert matrix == pytest.approx(np.array([[0.5, 0, 0.5], [0, 0.9, 0.1], [third, third, third]]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"steps\.tsv: is empty; a header of places"),
        ("hall\n1\n", r"steps\.tsv:1: the header is 'hall'; the model's places, 'hall attic', are expected"),
        ("hall\thall\n1\t0\n1\t0\n", r"steps\.tsv:1: the header is 'hall hall'"),
        ("hall\tattic\n1\t0\n", r"steps\.tsv: 1 rows of probabilities for 2 places; one per place is needed"),
        ("hall\tattic\n1\t0\n1\n", r"steps\.tsv:3: 1 fields found, 2 expected as in the header"),
        ("hall\tattic\nhall\t1\t0\nattic\t0\t1\n", r"steps\.tsv:2: 3 fields found, 2 expected as in the header"),
        ("hall\tattic\n1\t0\n\n0\tx\n", r"steps\.tsv:4: 'x' under 'attic' is no probability from 0 to 1"),
        ("hall\tattic\n1\t0\nnan\t1\n", r"steps\.tsv:3: 'nan' under 'hall' is no probability"),
        ("hall\tattic\n1.5\t-0.5\n0\t1\n", r"steps\.tsv:2: '1\.5' under 'hall' is no probability"),
        ("hall\tattic\n0.5\t0.4\n0\t1\n", r"steps\.tsv:2: the probabilities sum to 0\.9, not to 1"),
    ],
)
def test_a_file_that_is_none_is_named(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "steps.tsv"
    path.write_text(text)
    with pytest.raises(ModelError, match=message):
        read_transitions(path, ("hall", "attic"))
