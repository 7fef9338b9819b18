"""docs/library.md as a file: what to use for what, and two programs that run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.small_world import write_images

import placerec

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "library.md").read_text(encoding="utf-8")


def program(name: str, *arguments: object, folder: Path) -> list[str]:
    """The lines that a program of docs/examples prints."""
    command = [sys.executable, str(DOCS / f"examples/{name}.py"), *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_table_leads_to_every_public_name() -> None:
    table = PAGE.partition("## What for what")[2].partition("## Two programs")[0]
    rows = re.findall(r"^\| ([^|*]+) \| (`.*) \|$", table, re.MULTILINE)
    assert len(rows) > 25
    named = {name for _, cell in rows for code in re.findall("`([^`]+)`", cell) for name in re.findall(r"\b\w+", code)}
    assert set(placerec.__all__) - {"__version__"} <= named
    # What begins a piece of code is a name of the package, or goes on with one.
    for _, cell in rows:
        for first in re.findall(r"`(\w+)", cell):
            assert first in placerec.__all__ or first == "frames", first


@pytest.mark.parametrize(("name", "lines"), [("robot", 15), ("next_words", 12)])
def test_the_page_quotes_its_programs(name: str, lines: int) -> None:
    text = (DOCS / f"examples/{name}.py").read_text(encoding="utf-8")
    assert PAGE.count(f"```python\n{text}```\n") == 1
    assert text.count("\n") <= lines
    assert f"python docs/examples/{name}.py" in PAGE


def test_the_robot_says_when_it_comes_into_another_place(tmp_path: Path) -> None:
    for seed in range(3):
        write_images(tmp_path / f"runs/run{seed}", seed)
    words = placerec.DictionarySetOptions(sizes=(3,))
    spec = placerec.DescriptorSpec(image_size=16)
    placerec.learn([tmp_path / "runs"], tmp_path / "model", spec=spec, words=words)
    drive = write_images(tmp_path / "drive", 3, frames=4)
    for path in (drive / "std_cam").iterdir():
        # A tenth of the time: the robot plays it at its own pace.
        path.rename(path.with_name(path.name.replace("t100", "t1000.").replace(".000000_x", "00000_x")))
    lines = program("robot", "model", "drive", folder=tmp_path)
    told = [re.fullmatch(r"1000\.\d s: (\w+), believed (?:0\.\d\d|1\.00)", line) for line in lines]
    assert [line and line[1] for line in told] == ["hall", "kitchen"]


def test_the_ngram_program_makes_a_model_and_says_what_comes_next(tmp_path: Path) -> None:
    (tmp_path / "text.txt").write_text("the cat sat\nthe cat ran\nthe dog sat\n", encoding="utf-8")
    lines = program("next_words", "text.txt", "the", folder=tmp_path)
    model = placerec.read_arpa(tmp_path / "text.arpa")
    assert len(lines) == 5
    for line in lines:
        p, *words = line.split()
        assert float(p) == pytest.approx(10 ** model.log10_p(words[-1], words[:-1]), abs=6e-5)
    assert lines[0].endswith(" the cat")
