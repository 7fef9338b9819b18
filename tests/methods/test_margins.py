"""Machines that give margins: what is chosen and by which frames, their softmax, and the regression and the kernels."""

import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers.point_clouds import clouds

from placerec.errors import MissingExtraError
from placerec.hohmm import filter_stream, learned_transition
from placerec.methods import logistic, rbf_svm
from placerec.methods.descriptors import DescriptorTrainingSet, PointStepFunction, through_filter
from placerec.methods.margins import FitMargins, Margins, best_machine, frame_by_frame, likelihoods

CHOOSE = {"logistic": logistic.choose, "rbf-svm": rbf_svm.choose}


def scores_of(name: str, training: DescriptorTrainingSet) -> PointStepFunction:
    return CHOOSE[name](training)(training)


def told(training: DescriptorTrainingSet, noise: float, seen: list[int]) -> FitMargins:
    """A machine that knows each point's place, disturbed by noise; `seen` gets how many points each one learns from."""
    known = {row.tobytes(): place for row, place in zip(np.round(training.points, 9), training.truth, strict=True)}
    scale = np.sqrt((training.points**2).mean(axis=0).sum())
    rng = np.random.default_rng(0)

    def machine(points: np.ndarray, truth: np.ndarray) -> Margins:
        seen.append(len(points))
        columns = np.unique(truth)

        def margins(asked: np.ndarray) -> np.ndarray:
            places = np.array([known[row.tobytes()] for row in np.round(asked * scale, 9)])
            found: np.ndarray = np.equal.outer(places, columns) + noise * rng.normal(size=(len(asked), len(columns)))
            return found

        return margins

    return machine


def test_the_machine_with_the_least_log_loss_on_held_out_sequences_is_taken() -> None:
    training = clouds(1)
    seen: list[int] = []
    scores = best_machine(training, [told(training, noise, seen) for noise in (9.0, 0.0, 1.0)], 10)(training)
    assert seen == [60, 60, 60] * 3 + [90]
    beliefs = np.array([frame_by_frame(scores)()(point) for point in training.points])
    assert (beliefs.argmax(axis=1) == training.truth).all()
    assert beliefs[np.arange(90), training.truth].min() > 0.9


def test_of_many_frames_every_second_or_third_alone_chooses() -> None:
    training = clouds(1)
    seen: list[int] = []
    best_machine(training, [told(training, 0.0, seen)], 10, most=40)(training)
    assert seen == [20, 20, 20, 90]


@pytest.mark.parametrize("name", CHOOSE)
def test_beliefs_sum_to_one_and_the_filter_gets_them_over_shares(name: str) -> None:
    pytest.importorskip("sklearn")
    training, test = clouds(1, apart=1.5), clouds(2, sequences=1, apart=1.5)
    scores = scores_of(name, training)
    belief = np.array([frame_by_frame(scores)()(point) for point in test.points])
    np.testing.assert_allclose(belief.sum(axis=1), 1)
    assert (belief.argmax(axis=1) == test.truth).mean() > 0.6
    step = through_filter(training, partial(likelihoods, CHOOSE[name](training)))()
    log10_p = np.log10(belief / (np.bincount(training.truth) / len(training.truth)))
    expected = filter_stream(log10_p, learned_transition(training.steps)).belief
    np.testing.assert_allclose(np.array([step(point) for point in test.points]), expected, atol=1e-9)


def decisions(scores: PointStepFunction, points: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.array([scores(point) for point in points]).argmax(axis=1)
    return found


@pytest.mark.parametrize("places", [2, 3])
def test_the_regression_is_that_of_scikit_learn(monkeypatch: pytest.MonkeyPatch, places: int) -> None:
    linear_model = pytest.importorskip("sklearn.linear_model")
    monkeypatch.setattr(logistic, "STRENGTHS", (10.0,))
    training, test = (of_first(clouds(seed, apart=1.0), places) for seed in (1, 2))
    scale = np.sqrt((training.points**2).mean(axis=0).sum())
    found = linear_model.LogisticRegression(C=10.0, max_iter=2000).fit(training.points / scale, training.truth)
    assert (decisions(scores_of("logistic", training), test.points) == found.predict(test.points / scale)).all()


def of_first(training: DescriptorTrainingSet, places: int) -> DescriptorTrainingSet:
    kept = training.truth < places
    return DescriptorTrainingSet(
        training.points[kept],
        training.truth[kept],
        training.sequences[kept],
        training.places[:places],
        training.steps[:places, :places],
    )


@pytest.mark.parametrize("places", [2, 3])
def test_the_kernel_machines_are_those_of_scikit_learn(monkeypatch: pytest.MonkeyPatch, places: int) -> None:
    svm = pytest.importorskip("sklearn.svm")
    monkeypatch.setattr(rbf_svm, "STRENGTHS", (1.0,))
    monkeypatch.setattr(rbf_svm, "GAMMAS", (0.5,))
    training, test = (of_first(clouds(seed, apart=1.0), places) for seed in (1, 2))
    scale = np.sqrt((training.points**2).mean(axis=0).sum())
    machines = [svm.SVC(C=1.0, gamma=0.5).fit(training.points / scale, training.truth == c) for c in range(places)]
    margins = np.stack([one.decision_function(test.points / scale) for one in machines], axis=1)
    scores = scores_of("rbf-svm", training)
    ours = np.array([scores(point) for point in test.points])
    # One temperature explains all of them.
    np.testing.assert_allclose(ours, margins * (ours[0, 0] / margins[0, 0]), rtol=1e-6, atol=1e-9)


def test_the_kernel_is_as_narrow_as_the_training_asks_for_and_noise_is_not_believed() -> None:
    """A ring in a ring, which no plane parts; and the same labels on points that tell nothing."""
    pytest.importorskip("sklearn")
    rng = np.random.default_rng(0)
    angle, number, truth = rng.uniform(0, 2 * np.pi, 200), np.repeat(np.arange(4), 50), np.arange(200) % 2
    rings = (1.0 + truth)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    training = DescriptorTrainingSet(rings, truth, number, ("in", "out"), np.ones((2, 2), np.int64))
    belief = true_beliefs(scores_of("rbf-svm", training), training)
    assert belief.min() > 0.8
    noise = replace(training, points=rng.normal(size=(200, 2)))
    for name in CHOOSE:
        assert true_beliefs(scores_of(name, noise), noise).max() < 0.8


def true_beliefs(scores: PointStepFunction, training: DescriptorTrainingSet) -> np.ndarray:
    """The belief in the place of each training frame."""
    beliefs = np.array([frame_by_frame(scores)()(point) for point in training.points])
    return beliefs[np.arange(len(beliefs)), training.truth]


@pytest.mark.parametrize("name", CHOOSE)
def test_a_place_that_a_fold_lacks_and_a_single_sequence_do_no_harm(name: str) -> None:
    pytest.importorskip("sklearn")
    training = clouds(1)
    only_there = replace(training, truth=np.where(training.sequences == 2, training.truth, training.truth % 2))
    for training in (only_there, clouds(1, sequences=1)):
        assert np.isfinite(scores_of(name, training)(training.points[0])).all()


@pytest.mark.parametrize("name", CHOOSE)
def test_without_scikit_learn_the_extra_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(
        MissingExtraError, match=rf"{name} needs the package scikit-learn, .*-m pip install scikit-learn"
    ):
        CHOOSE[name](clouds())
