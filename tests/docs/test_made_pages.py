"""Pages and pictures that programs make are current, and what the paper's page names is there."""

import re
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from placerec.reference import backed_off

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
METHOD = (DOCS / "method.md").read_text(encoding="utf-8")
ROOMS = sorted(path.stem for path in (ROOT / "placerec").iterdir() if not path.stem.startswith("_"))
NAMED = sorted(set(re.findall(rf"`((?:{'|'.join(ROOMS)})(?:\.[a-zA-Z_]\w+)+)`", METHOD)) - {"model.json"})
READING = re.compile(r"\bA(\d+)\b")


def made(*command: str | Path) -> str:
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True).stdout


def test_the_commands_page_is_current() -> None:
    assert made(DOCS / "make/commands.py") == (DOCS / "commands.md").read_text(encoding="utf-8")


def test_the_pictures_of_the_concepts_are_current(tmp_path: Path) -> None:
    made(DOCS / "make/concepts.py", tmp_path)
    kept = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "concepts").glob("*.svg")}
    assert len(kept) == 5
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == kept
    page = (DOCS / "concepts.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\(concepts/(\w+\.svg)\)", page)) == sorted(kept)


def test_the_concepts_page_says_what_the_example_computes() -> None:
    models = runpy.run_path(str(DOCS / "make/concepts.py"))["models"]()
    alone, after = (
        backed_off(models["kitchen"], "w2", history) / backed_off(models["corridor"], "w2", history)
        for history in ((), ("w1",))
    )
    page = (DOCS / "concepts.md").read_text(encoding="utf-8")
    assert f"alone it speaks for the kitchen {alone:.1f} to 1, after `w1` {after:.1f} to 1" in page


def test_letters_of_the_pictures_can_be_read_at_half_their_size() -> None:
    for path in (DOCS / "concepts").glob("*.svg"):
        text = path.read_text(encoding="utf-8")
        assert 'viewBox="0 0 720 ' in text
        assert min(map(int, re.findall(r'font-size="(\d+)"', text))) >= 26


def test_the_method_page_names_functions() -> None:
    assert len(NAMED) > 40


@pytest.mark.parametrize("name", NAMED)
def test_what_the_method_page_names_exists(name: str) -> None:
    module, inside = f"placerec.{name}", list[str]()
    while not (ROOT / module.replace(".", "/")).with_suffix(".py").exists():
        module, _, last = module.rpartition(".")
        assert module, f"no file of the package is meant by {name}"
        inside.insert(0, last)
    assert inside, "a function is meant, not a module"
    found = import_module(module)
    for part in inside:
        found = getattr(found, part)
    assert callable(found)


def test_every_reading_that_the_code_names_is_explained() -> None:
    explained = set(re.findall(r"^\| A(\d+) \|", METHOD, re.MULTILINE)) | set(READING.findall(METHOD))
    code = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "placerec").rglob("*.py")))
    named = set(READING.findall(" ".join(re.findall(r"readings? ((?:A\d+[ ,to\n-]*)+)", code))))
    assert len(named) > 10
    assert named - explained == set()
    assert explained >= {str(i) for i in range(1, 34)}
