"""One decision to read: as text, as a page, and what is said of files that hold none."""

import json
from pathlib import Path
from typing import Any

import pytest

from placerec.errors import EvaluationError
from placerec.inspection.decision import decision_page, format_decision, inspect_decision

DECISION: dict[str, Any] = {
    "frame": "t12.5_a",
    "time": 12.5,
    "place": "hall",
    "word": "w07",
    "history": ["w05", "w06"],
    "best_before": "hall",
    "best": "kitchen",
    "rival": "hall",
    "places": {
        "hall": {"log10_p": -2.0, "order": 1, "backoffs": [-0.30103, 0.0], "before": 0.75, "after": 0.2},
        "kitchen": {"log10_p": -0.69897, "order": 3, "backoffs": [], "before": 0.25, "after": 0.8},
        "<b>": {"log10_p": None, "order": 1, "backoffs": [None], "before": 0.0, "after": 0.0},
    },
    "for": [{"word": "w07", "frames": ["t12.5_a", "t11.0_b"], "ago": [3, 0], "log10_odds": 1.0}],
    "against": [{"word": "w02", "frames": ["t11.5_c"], "ago": [2], "log10_odds": -0.30103}],
}
TEXT = """\
Frame t12.5_a at 12.5 s: kitchen
The word w07 was seen after w05 w06. The belief in kitchen went from 0.25 to 0.8, and it is the most probable place; \
before it, hall was. The frame is labelled hall.

place    p of the word  answered by  back-off  belief before  after
kitchen  0.2            w05 w06 w07  -         0.25           0.8
hall     0.01           w07          0.5 x 1   0.75           0.2
<b>      0              w07          0         0              0

kitchen against hall: the words of the last 20 selected frames that moved the odds most, as far as the filter still \
remembers them.
         word  odds   selected words ago
for      w07   x 10   3, 0
against  w02   x 0.5  2"""


def write(path: Path, *decisions: object) -> Path:
    path.write_text("".join(json.dumps(one) + "\n" for one in decisions))
    return path


def test_a_decision_as_text() -> None:
    assert format_decision(DECISION) == TEXT


def test_what_is_not_known_is_not_told() -> None:
    first = DECISION | {"time": None, "place": None, "history": [], "best_before": "kitchen", "rival": None}
    first |= {"for": [], "against": [], "unknown": {"log10_ratio": 1.0, "before": 0.2, "after": 0.5}}
    first["places"] = {"kitchen": DECISION["places"]["kitchen"] | {"order": 1}}
    assert format_decision(first).split("\n")[:3] == [
        "Frame t12.5_a: kitchen",
        "The word w07 was seen, the first word. The belief in kitchen went from 0.25 to 0.8, and it is the most "
        "probable place, as before.",
        "That the place is none of these went from 0.2 to 0.5: the frame multiplied the odds by 10.",
    ]
    assert "against" not in format_decision(first)
    assert "What the last words say" not in decision_page(first, "run1")


def test_a_page_says_the_same(tmp_path: Path) -> None:
    path = write(tmp_path / "run1.explain.jsonl", DECISION)
    found = inspect_decision(path, "t12.5_a", out=tmp_path / "page.html")
    assert found == DECISION
    page = (tmp_path / "page.html").read_text()
    assert page == decision_page(DECISION, "run1")
    assert "<h1>run1: kitchen</h1>" in page
    assert "&lt;b&gt;" in page
    assert "<b>" not in page
    for cell in ("w05 w06 w07", "0.5 x 1", "x 10", "3, 0"):
        assert f">{cell}</td>" in page


def test_a_frame_is_found_by_the_beginning_of_its_name(tmp_path: Path) -> None:
    other = DECISION | {"frame": "t12.5_ab"}
    path = write(tmp_path / "run1.explain.jsonl", DECISION, other, DECISION | {"frame": "t13"})
    assert inspect_decision(path, "t13")["frame"] == "t13"
    assert inspect_decision(path, "t12.5_ab") == other
    assert inspect_decision(path, "t12.5_a") == DECISION
    with pytest.raises(EvaluationError, match=r"jsonl: 3 selected frames begin with 't1', 't12\.5_a' first; give more"):
        inspect_decision(path, "t1")
    with pytest.raises(EvaluationError, match=r"jsonl: no selected frame 'x'; the column `selected` of the beliefs"):
        inspect_decision(path, "x")


@pytest.mark.parametrize(
    ("line", "missing"),
    [
        ("{", "all"),
        ("7", "all"),
        ("[]", "frame, time, place"),
        ('{"frame": "1", "best": "hall"}', "time, place, word"),
    ],
)
def test_lines_that_are_no_decision_are_named(tmp_path: Path, line: str, missing: str) -> None:
    path = tmp_path / "run1.explain.jsonl"
    path.write_text(json.dumps(DECISION) + "\n" + line + "\n")
    with pytest.raises(EvaluationError, match=rf"jsonl:2: a decision is expected, and {missing}.* `placerec dec"):
        inspect_decision(path, "t12.5_a")
    with pytest.raises(EvaluationError, match=r"none\.jsonl: no such file"):
        inspect_decision(tmp_path / "none.jsonl", "1")
