"""What keys do to stretches, as functions without a page: each case is computed by the module in a browser."""

from pathlib import Path
from typing import Any

import pytest

from placerec.page.assets import in_one

PAGE = """<!doctype html><meta charset="utf-8"><script>{script}
window.made = {{ stretchAt, pieceAt, labelled, split, joined, movedBorder, renamed, framesOf, gaps }};</script>"""
BOTH: list[Any] = [[0, 4, "k"], [4, 10, "h"]]
APART: list[Any] = [[0, 2, "k"], [6, 8, "h"]]


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Any:
    (tmp_path / "page.html").write_text(PAGE.format(script=in_one("stretches.js")), encoding="utf-8")
    browser.get((tmp_path / "page.html").as_uri())
    return browser


def test_every_change_gives_another_list(page: Any) -> None:
    cases: list[tuple[str, list[Any], list[Any], Any]] = [
        ("labelled", BOTH, [2, 6, ""], [[0, 2, "k"], [6, 10, "h"]]),
        ("labelled", BOTH, [4, 10, "k"], [[0, 10, "k"]]),
        ("labelled", APART, [1, 7, "x"], [[0, 1, "k"], [1, 7, "x"], [7, 8, "h"]]),
        ("labelled", APART, [3, 3, "x"], APART),
        ("labelled", [[0, 2, "k"], [6, 8, "k"]], [2, 6, "k"], [[0, 8, "k"]]),
        ("split", BOTH, [6], [[0, 4, "k"], [4, 6, "h"], [6, 10, "h"]]),
        ("split", BOTH, [4], BOTH),
        ("joined", BOTH, [1, 10], [[0, 10, "k"]]),
        ("joined", APART, [1, 10], [[0, 6, "k"], [6, 8, "h"]]),
        ("joined", APART, [7, 10], [[0, 2, "k"], [6, 10, "h"]]),
        ("joined", APART, [4, 10], APART),
        ("movedBorder", BOTH, [4, 6, 10], [[0, 6, "k"], [6, 10, "h"]]),
        ("movedBorder", BOTH, [4, 20, 10], [[0, 9, "k"], [9, 10, "h"]]),
        ("movedBorder", BOTH, [4, -3, 10], [[0, 1, "k"], [1, 10, "h"]]),
        ("movedBorder", BOTH, [10, 7, 10], [[0, 4, "k"], [4, 7, "h"]]),
        ("movedBorder", APART, [6, 1, 10], [[0, 2, "k"], [2, 8, "h"]]),
        ("movedBorder", APART, [2, 9, 10], [[0, 6, "k"], [6, 8, "h"]]),
        ("movedBorder", BOTH, [5, 6, 10], BOTH),
        ("renamed", BOTH, ["h", "x"], [[0, 4, "k"], [4, 10, "x"]]),
        ("gaps", APART, [10], [[2, 6], [8, 10]]),
        ("gaps", [], [3], [[0, 3]]),
        ("pieceAt", APART, [4, 10], [2, 6, ""]),
        ("pieceAt", APART, [6, 10], [6, 8, "h"]),
        ("pieceAt", APART, [9, 10], [8, 10, ""]),
    ]
    for name, given, rest, expected in cases:
        call = "const given = arguments[1]; return [made[arguments[0]](given, ...arguments[2]), given]"
        found, left = page.execute_script(call, name, given, rest)
        assert found == expected, (name, given, rest)
        assert left == given
