"""Linear support vector machines: decisions are scikit-learn's, beliefs their softmax, the filter the project's."""

import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers.point_clouds import clouds

from placerec.errors import MissingExtraError
from placerec.hohmm import filter_stream, learned_transition
from placerec.methods import ullah2008
from placerec.methods.descriptors import DescriptorTrainingSet, through_filter
from placerec.methods.margins import frame_by_frame, likelihoods


def machine_margins(training: DescriptorTrainingSet, points: np.ndarray) -> np.ndarray:
    svm = pytest.importorskip("sklearn.svm")
    scale = np.sqrt((training.points**2).mean(axis=0).sum())
    found = svm.LinearSVC(dual=False, random_state=0).fit(training.points / scale, training.truth)
    margins: np.ndarray = found.decision_function(points / scale)
    return margins if margins.ndim == 2 else np.stack([-margins, margins], axis=1)


def of_places(training: DescriptorTrainingSet, *columns: int) -> DescriptorTrainingSet:
    kept = np.isin(training.truth, columns)
    return replace(
        training, points=training.points[kept], truth=training.truth[kept], sequences=training.sequences[kept]
    )


@pytest.mark.parametrize("columns", [(0, 1, 2), (0, 1)])
def test_beliefs_are_the_softmax_of_the_margins(columns: tuple[int, ...]) -> None:
    places = len(columns)
    training, test = (of_places(clouds(seed, sequences=n, apart=1.5), *columns) for seed, n in ((1, 3), (2, 1)))
    training = replace(training, places=training.places[:places], steps=training.steps[:places, :places])
    expected = machine_margins(training, test.points)
    step = frame_by_frame(ullah2008.choose(training)(training))()
    belief = np.array([step(point) for point in test.points])
    np.testing.assert_allclose(belief.sum(axis=1), 1)
    assert (belief.argmax(axis=1) == expected.argmax(axis=1)).all()
    # One temperature explains all odds.
    odds = np.log(belief[:, 1:] / belief[:, :1])
    ratios = (expected[:, 1:] - expected[:, :1]) / odds
    np.testing.assert_allclose(ratios, ratios[0, 0], rtol=1e-6)


def test_the_temperature_is_lower_where_margins_can_be_trusted() -> None:
    pytest.importorskip("sklearn")
    sure, unsure = (
        frame_by_frame(ullah2008.choose(one)(one))() for one in (clouds(1, apart=6.0), clouds(1, apart=0.3))
    )
    assert sure(np.array([6.0, 0, 0, 0]))[0] > 0.95
    assert unsure(np.array([0.3, 0, 0, 0])).max() < 0.6


def test_the_filter_gets_beliefs_over_shares() -> None:
    pytest.importorskip("sklearn")
    training, test = clouds(1, apart=1.5), clouds(2, sequences=1, apart=1.5)
    training = of_places(training, 0, 1, 2)
    keep = np.ones(len(training.truth), bool)
    keep[np.flatnonzero(training.truth == 1)[::2]] = False
    training = replace(
        training, points=training.points[keep], truth=training.truth[keep], sequences=training.sequences[keep]
    )
    chosen = ullah2008.choose(training)
    alone, through = frame_by_frame(chosen(training))(), through_filter(training, partial(likelihoods, chosen))()
    shares = np.bincount(training.truth) / len(training.truth)
    log10_p = np.log10(np.array([alone(point) for point in test.points]) / shares)
    expected = filter_stream(log10_p, learned_transition(training.steps)).belief
    np.testing.assert_allclose(np.array([through(point) for point in test.points]), expected, atol=1e-9)


def test_a_place_that_a_fold_lacks_and_a_single_sequence_do_no_harm() -> None:
    pytest.importorskip("sklearn")
    training = clouds(1)
    only_there = replace(training, truth=np.where(training.sequences == 2, training.truth, training.truth % 2))
    for training in (only_there, clouds(1, sequences=1)):
        belief = frame_by_frame(ullah2008.choose(training)(training))()(training.points[0])
        assert np.isfinite(belief).all()


def test_without_scikit_learn_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(
        MissingExtraError, match=r"ullah2008 needs the package scikit-learn, .*-m pip install scikit-learn"
    ):
        ullah2008.choose(clouds())
