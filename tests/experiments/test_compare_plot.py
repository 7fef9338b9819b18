"""The picture of a comparison: labels that do not overlap, the same bytes for the same numbers."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.experiments.comparison.benchmark import FrontEndCost
from placerec.experiments.comparison.results import Comparison, MethodScore, plot_comparison, spread

pytest.importorskip("matplotlib")


def comparison(*scores: MethodScore) -> Comparison:
    return Comparison(scores, (), 120, 0.4, "a$b$ hall", (3, "sequences"), FrontEndCost(6500.0, 120.0))


def score(name: str, accuracy: float, cost: float, consulted: float | None = None) -> MethodScore:
    return MethodScore(name, accuracy, accuracy - 0.05, accuracy + 0.02, accuracy, None, 0.1, cost, 0.3, consulted)


@given(st.lists(st.floats(0, 1), max_size=20))
def test_labels_are_apart_in_order_and_inside(wanted: list[float]) -> None:
    apart = 0.04
    placed = spread(np.sort(np.array(wanted, np.float64)), apart)
    assert len(placed) == len(wanted)
    assert (np.diff(placed) >= apart - 1e-9).all()
    assert ((placed >= -1e-9) & (placed <= 1 + 1e-9)).all()


def test_labels_with_room_stay_where_they_are_wanted() -> None:
    assert spread(np.array([0.1, 0.5, 0.9]), 0.05).tolist() == pytest.approx([0.1, 0.5, 0.9])
    # Three that want the same place stand around it.
    assert spread(np.full(3, 0.5), 0.1).tolist() == pytest.approx([0.4, 0.5, 0.6])


def test_the_picture_names_every_method_and_the_majority(tmp_path: Path) -> None:
    found = comparison(
        score("hohmm", 0.9, 12.0),
        score("majority", 0.4, 0.0),
        score("knn", 0.91, 90.0),
        score("pronobis2007", 0.7, 0.0, 0.25),
    )
    plot_comparison(found, tmp_path / "one.svg")
    plot_comparison(found, tmp_path / "two.svg")
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    texts = re.findall(r"<!-- (.*?) -->", (tmp_path / "one.svg").read_text(encoding="utf-8"))
    for text in ("hohmm  90.0 %", "knn  91.0 %", "always “a$b$ hall”: 40.0 %", "descriptors"):
        assert text in texts, text
    assert not any("majority" in text for text in texts)
    assert any("second descriptor, for 25.0 %" in text for text in texts)


def test_majority_alone_is_a_line(tmp_path: Path) -> None:
    plot_comparison(comparison(score("majority", 0.4, 0.5)), tmp_path / "line.png")
    assert (tmp_path / "line.png").stat().st_size > 1000
