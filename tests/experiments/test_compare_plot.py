"""The picture of a comparison: every method, what can be told of them, the same bytes for the same numbers."""

from pathlib import Path

import pytest
from helpers.pictures import drawn_texts

from placerec.evaluation.bootstrap import Pair
from placerec.experiments.comparison.figure import plot_comparison
from placerec.experiments.comparison.results import Comparison, MethodScore
from placerec.experiments.cost import FrontEndCost

pytest.importorskip("matplotlib")
MARKED = "the best, or cannot be told from it"


def comparison(*scores: MethodScore, pairs: tuple[Pair, ...] = ()) -> Comparison:
    return Comparison(scores, pairs, 120, 0.4, "a$b$ hall", (3, "sequences"), FrontEndCost(6500.0, 120.0))


def score(name: str, accuracy: float, cost: float, consulted: float | None = None) -> MethodScore:
    return MethodScore(name, accuracy, accuracy - 0.05, accuracy + 0.02, accuracy, None, 0.1, cost, 0.3, consulted)


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
    texts = drawn_texts(tmp_path / "one.svg")
    for text in ("90.0 %", "91.0 %", "always “a$b$ hall”: 40.0 %", "descriptors", "the method sees"):
        assert text in texts, text
    assert [text for text in texts if text in ("hohmm", "knn", "pronobis2007")] == ["knn", "hohmm", "pronobis2007"]
    assert not any("majority" in text for text in texts)
    assert any("Fewer than 6" in text for text in texts)
    assert MARKED not in texts
    assert any("second descriptor, for 25.0 %" in text for text in texts)


def test_majority_alone_is_a_line(tmp_path: Path) -> None:
    plot_comparison(comparison(score("majority", 0.4, 0.5)), tmp_path / "line.png")
    assert (tmp_path / "line.png").stat().st_size > 1000


def test_methods_that_cannot_be_told_from_the_best_are_marked(tmp_path: Path) -> None:
    chance, real = (Pair("hohmm", "knn", -0.01, -0.03, 0.02, 9), Pair("knn", "mtd", 0.4, 0.3, 0.5, 9))
    found = comparison(
        score("hohmm", 0.9, 12.0), score("knn", 0.91, 90.0), score("mtd", 0.5, 1.0), pairs=(chance, real)
    )
    assert found.not_told_from_best() == {"knn", "hohmm"}
    plot_comparison(found, tmp_path / "one.svg")
    assert MARKED in drawn_texts(tmp_path / "one.svg")


def test_long_names_make_room_for_themselves(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    drawn: list[float] = []

    def left_of_names(figure: Figure) -> float:
        renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
        labels = figure.axes[0].get_yticklabels()
        return float(min(label.get_window_extent(renderer).x0 for label in labels))

    saved = Figure.savefig

    def savefig(figure: Figure, *args: object, **options: object) -> None:
        saved(figure, *args, **options)  # type: ignore[arg-type]
        drawn.append(left_of_names(figure))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        for name in ("hohmm", "ullah2008-hmm@views-tuned", "ullah2008-hmm@gist+lbp+ranks:half-tuned"):
            plot_comparison(comparison(score(name, 0.9, 12.0)), tmp_path / "one.png")
    assert len(drawn) == 3
    assert min(drawn) > 0
