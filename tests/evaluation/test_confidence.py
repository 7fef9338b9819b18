"""Curves of trust: equal to their definitions, ties included."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from placerec.evaluation.confidence import COVERAGES, new_places, reliability, risk_coverage

frames = st.lists(st.tuples(st.sampled_from([0.0, 0.2, 0.5, 0.50001, 1.0]), st.booleans()), min_size=1, max_size=30)


def columns(pairs: list[tuple[float, bool]]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    return np.array([score for score, _ in pairs]), np.array([hit for _, hit in pairs], dtype=np.bool_)


@given(frames)
def test_auroc_is_the_share_of_pairs_that_are_told_apart(pairs: list[tuple[float, bool]]) -> None:
    new = [score for score, is_new in pairs if is_new]
    known = [score for score, is_new in pairs if not is_new]
    found = new_places(*columns(pairs))
    assert (found.new, found.known) == (len(new), len(known))
    if not new or not known:
        assert found.auroc is None
        return
    wins = sum((a > b) + 0.5 * (a == b) for a in new for b in known)
    assert found.auroc == pytest.approx(wins / (len(new) * len(known)), abs=1e-12)
    ends = [(curve[0], curve[-1]) for curve in (found.false_alarms, found.detections)]
    assert ends == [(0, 1), (0, 1)]


@given(frames)
def test_the_surest_frames_are_kept_and_equals_come_in_the_mean_order(pairs: list[tuple[float, bool]]) -> None:
    found = risk_coverage(*columns(pairs))
    # In the mean over all orders of equals, each of them holds the same part of their right answers.
    shared = {score: np.mean([right for other, right in pairs if other == score]) for score, _ in pairs}
    best_first = [float(shared[score]) for score in sorted((score for score, _ in pairs), reverse=True)]
    sums = np.cumsum(best_first)
    kept = np.arange(1, len(pairs) + 1)
    assert found.area == pytest.approx((sums / kept).mean())
    wanted = np.array(COVERAGES) * len(pairs)
    expected = np.interp(wanted, [0, *kept], [0, *sums]) / wanted
    assert found.accuracy == pytest.approx(expected)
    assert found.accuracy[-1] == pytest.approx(np.mean([right for _, right in pairs]))


def test_reliability_of_a_case_worked_by_hand() -> None:
    # (12/15, 13/15] holds 0.85 twice, right once; (14/15, 1] holds 0.95, right.
    found = reliability(np.array([0.85, 0.95, 0.85]), np.array([True, True, False]))
    assert found.frames.tolist() == [0] * 12 + [2, 0, 1]
    assert found.belief[[12, 14]] == pytest.approx([0.85, 0.95])
    assert found.accuracy[[12, 14]] == pytest.approx([0.5, 1.0])
    assert found.error == pytest.approx((2 * 0.35 + 0.05) / 3)
    assert found.to_json()["accuracy"] == [None] * 12 + [0.5, None, 1.0]
