"""The temperature: found again where it is known, never a change of decision, and robust where data is poor."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError
from placerec.hohmm.calibration import Calibration, fit_calibration

beliefs = arrays(np.float64, (5, 3), elements=st.floats(0, 1)).filter(lambda rows: bool((rows.sum(axis=1) > 0).all()))


def normal(rows: Floats) -> Floats:
    whole: Floats = rows / rows.sum(axis=1, keepdims=True)
    return whole


def loss(belief: Floats, truth: Ints) -> float:
    return float(-np.log(belief[np.arange(len(truth)), truth]).mean())


def test_a_belief_by_hand() -> None:
    # 0.8 : 0.2 is 4 : 1; at temperature 2 it is 2 : 1.
    halved = Calibration(2.0, 1, 0.0, 0.0).apply(np.array([0.8, 0.2]))
    assert halved == pytest.approx([2 / 3, 1 / 3])


@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
def test_the_temperature_that_made_the_beliefs_is_found(temperature: float) -> None:
    rng = np.random.Generator(np.random.PCG64(0))
    honest = rng.dirichlet([0.6] * 4, 40_000)
    truth = (rng.random((40_000, 1)) > honest.cumsum(axis=1)).sum(axis=1).clip(max=3)
    found = fit_calibration(normal(honest**temperature), truth)
    assert found.temperature == pytest.approx(temperature, rel=0.03)
    assert found.log_loss_after == pytest.approx(loss(honest, truth), abs=2e-4)
    assert found.log_loss_before == pytest.approx(loss(normal(honest**temperature), truth), rel=1e-4)
    assert found.frames == 40_000


@given(beliefs, st.floats(0.1, 20))
def test_no_decision_changes_and_rows_sum_to_one(rows: Floats, temperature: float) -> None:
    belief = normal(rows)
    found = Calibration(temperature, 1, 0.0, 0.0).apply(belief)
    assert found.sum(axis=1) == pytest.approx(1, abs=1e-12)
    best = belief.argmax(axis=1)
    assert (found[np.arange(5), best] == found.max(axis=1)).all()
    assert (found > 0).all()


@given(beliefs, arrays(np.int64, 5, elements=st.integers(0, 2)))
def test_no_other_temperature_is_better(rows: Floats, truth: Ints) -> None:
    belief = normal(rows)
    found = fit_calibration(belief, truth)

    def total(exponent: float) -> float:
        """The frames' losses, and what keeps few of them from an extreme."""
        return 5 * loss(Calibration(1 / exponent, 1, 0.0, 0.0).apply(belief), truth) + (exponent - 1) ** 2 / 2

    best = total(1 / found.temperature)
    assert all(best <= total(exponent) + 1e-6 for exponent in (0.02, 0.1, 0.5, 0.9, 1.0, 1.1, 2.0, 10.0))


def test_beliefs_of_0_and_1_are_fitted() -> None:
    sure = np.eye(2)[[0, 0, 0, 0, 1]]
    found = fit_calibration(sure, np.array([0, 0, 0, 1, 1]))
    # One in five is wrong: a belief of 0.8 is right, and the smallest belief 1e-15 to the power of 0.04 is a quarter.
    assert found.temperature == pytest.approx(np.log(1e15) / np.log(4), rel=0.03)
    assert found.apply(sure)[0] == pytest.approx([0.8, 0.2], abs=0.01)


def test_no_loss_is_below_zero() -> None:
    """-0.0 would be printed as -0.000."""
    found = fit_calibration(np.ones((3, 1)), np.zeros(3, np.int64))
    assert [math.copysign(1, loss) for loss in (found.log_loss_before, found.log_loss_after)] == [1, 1]


def test_many_places_at_a_low_temperature_stay_probabilities() -> None:
    even = np.full(200, 1 / 200)
    assert Calibration(0.01, 1, 0.0, 0.0).apply(even) == pytest.approx(even)


def test_a_few_frames_that_are_right_make_nobody_infinitely_sure() -> None:
    found = fit_calibration(np.array([[0.9, 0.1]] * 3), np.zeros(3, np.int64))
    assert 0.5 < found.temperature < 1


def test_a_place_that_was_never_true_keeps_its_part() -> None:
    found = fit_calibration(np.array([[0.6, 0.3, 0.1], [0.3, 0.6, 0.1]]), np.array([0, 1]))
    assert (found.apply(np.array([0.1, 0.1, 0.8])) > 0).all()


def test_nothing_to_fit_on_is_an_error() -> None:
    with pytest.raises(ModelError, match="no labelled frame of a known place to calibrate on"):
        fit_calibration(np.empty((0, 2)), np.empty(0, np.int64))


def test_json_and_back() -> None:
    found = Calibration(1.5, 7, 0.5, 0.25)
    assert Calibration.from_json(json.loads(json.dumps(vars(found) | {"more": 1}))) == found


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "the calibration lacks or garbles 'temperature'; run `placerec calibrate` again"),
        ({"temperature": 0.0}, "the calibration's temperature 0 is not above 0; run `placerec calibrate` again"),
        ({"temperature": float("nan")}, "the calibration's temperature nan is not above 0"),
        ({"frames": None}, "the calibration lacks or garbles int()"),
    ],
)
def test_a_broken_calibration_is_refused(values: dict[str, object], message: str) -> None:
    whole = vars(Calibration(1.5, 7, 0.5, 0.25))
    with pytest.raises(ModelError) as raised:
        Calibration.from_json({**whole, **values} if values else {})
    assert message in str(raised.value)
