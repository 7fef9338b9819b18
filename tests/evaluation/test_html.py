"""An evaluation as a notebook shows it, and as tables of columns."""

import re

from helpers.small_world import PLACES, beliefs_of

from placerec.evaluation.metrics import evaluate
from placerec.hohmm import Beliefs


def judged(names: tuple[str, ...] = PLACES) -> Beliefs:
    hall, kitchen, office = names
    return beliefs_of("run", names, [hall] * 3 + [kitchen, office], [hall, hall, office, kitchen, kitchen])


def test_a_notebook_shows_what_was_taken_for_what() -> None:
    text = evaluate([judged()])._repr_html_()
    assert "<b>60.0 %</b> of 5 frames right (always hall: 60.0 %); balanced 55.6 %" in text
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", text)]
    assert rows == [
        ["true, and taken for", *PLACES, "recall", "precision"],
        ["hall", "2", "0", "1", "66.7 %", "100.0 %"],
        ["kitchen", "0", "1", "0", "100.0 %", "50.0 %"],
        ["office", "0", "1", "0", "0.0 %", "0.0 %"],
    ]
    shares = ["0.67", "0.00", "0.33", *("0.00", "1.00", "0.00"), *("0.00", "1.00", "0.00")]
    assert re.findall(r"rgba\(0,114,178,(\S+)\)", text) == shares


def test_names_are_escaped() -> None:
    text = evaluate([judged(("<b>x", "k&", "o"))])._repr_html_()
    assert "<b>x" not in text.replace("&lt;b&gt;x", "")
    assert "k&amp;" in text


def test_many_places_are_told_in_words() -> None:
    names = [f"place{i}" for i in range(40)]
    text = evaluate([beliefs_of("run", names, names, names)])._repr_html_()
    assert text.endswith("; 40 places</p></div>")
    assert "<table" not in text


def test_a_row_for_each_place() -> None:
    evaluation = evaluate([judged()])
    assert evaluation.to_dict() == {
        "place": list(PLACES),
        "frames": [3, 1, 1],
        "precision": [1.0, 0.5, 0.0],
        "recall": [2 / 3, 1.0, 0.0],
    }
