"""The Python programs that the pages show are right in their types: a reader's editor underlines nothing."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXAMPLES = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs/examples").glob("*.py")))
# What the text beside a snippet speaks of.
BESIDE = {"vision": 'image = placerec.read_gray("frame.png")\n'}


def programs(page: Path) -> list[str]:
    """The programs of a page: a snippet that imports nothing goes on with the one before it.

    Those that quote a program of docs/examples are left out: mypy sees that program as a whole.
    """
    found: list[str] = []
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        if block in EXAMPLES:
            continue
        if re.search(r"^(?:import|from) ", block, re.MULTILINE):
            found.append(block)
        else:
            found[-1] += BESIDE.get(page.stem, "") + block
    return found


def checked(folder: Path) -> str:
    """What mypy says of the programs in a folder."""
    run = [sys.executable, "-m", "mypy", "--config-file=", "--check-untyped-defs", "--cache-dir", str(folder / "cache")]
    return subprocess.run([*run, str(folder)], capture_output=True, text=True, cwd=folder).stdout


def test_the_snippets_are_right_in_their_types(tmp_path: Path) -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    named = {page.stem: programs(page) for page in pages}
    assert {name for name, found in named.items() if found} >= {"README", "extend", "live", "tutorial", "vision"}
    for name, found in named.items():
        for number, program in enumerate(found):
            (tmp_path / f"{name}_{number}.py").write_text(program, encoding="utf-8")
    (tmp_path / "wrong.py").write_text("import placerec\nplacerec.read_arpa(3)\n", encoding="utf-8")
    said = checked(tmp_path)
    assert re.fullmatch(r"wrong\.py:2: error: .*\nFound 1 error in 1 file \(checked \d+ source files\)\n", said), said
