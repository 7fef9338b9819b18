"""The page on the code's layout against the folders that are there."""

import re
from importlib import import_module
from pathlib import Path

import pytest
from test_package import ALLOWED, COMMON, LINE

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
FILES = [*(ROOT / "placerec").glob("*.py"), *(path.parent for path in (ROOT / "placerec").glob("*/__init__.py"))]
ROOMS = sorted(path.stem for path in FILES if not path.stem.startswith("_"))
NAMED = sorted(set(re.findall(rf"`((?:{'|'.join(ROOMS)})(?:\.[a-zA-Z_]\w+)+)`", PAGE)))


def test_the_table_has_the_rooms_in_the_order_in_which_they_may_import() -> None:
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE) == list(LINE)


def test_every_room_and_module_has_its_place() -> None:
    assert set(ROOMS) == set(LINE) | COMMON | {"lab", "reference", "srilm"}
    assert set(ALLOWED) >= set(ROOMS)
    aside, base = re.findall(r"^(Three stand aside\..*|Everyone may use the base: .*)$", PAGE, re.MULTILINE)
    assert {"lab", "reference", "srilm"} <= set(re.findall(r"`(\w+)`", aside))
    assert set(re.findall(r"`(\w+)`", base)) == COMMON


@pytest.mark.parametrize("name", NAMED)
def test_what_the_page_names_exists(name: str) -> None:
    module, found = "placerec", import_module("placerec")
    for part in name.split("."):
        module = f"{module}.{part}"
        path = ROOT / module.replace(".", "/")
        found = import_module(module) if path.is_dir() or path.with_suffix(".py").exists() else getattr(found, part)
    assert found is not None


def test_the_page_tells_where_to_add_what_people_add() -> None:
    assert len(NAMED) > 25
    said = re.findall(r"^- \*\*An? (\w+)\*\*", PAGE, re.MULTILINE)
    assert said == ["descriptor", "method", "smoothing", "input", "command"]
    words = len(PAGE.split())
    assert words < 1200, f"one page, and it has {words} words"
