"""docs/vision.md: its example runs as it is printed."""

import re
import runpy
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from placerec.cli import commands

PAGE = Path(__file__).resolve().parents[2] / "docs/vision.md"


def placerec(arguments: list[str]) -> str:
    expanded = [name for text in arguments for name in (sorted(map(str, Path().glob(text))) if "*" in text else [text])]
    result = CliRunner().invoke(commands, expanded, prog_name="placerec")
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_matrix_computed_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    section = PAGE.read_text(encoding="utf-8").partition("### A matrix computed elsewhere")[2]
    program, robot = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    Path("features.py").write_text(program, encoding="utf-8")
    lines = re.findall(
        r"^    ((?:placerec|python) .*)", re.sub(r"```.*?```", "", section, flags=re.DOTALL), re.MULTILINE
    )
    assert len(lines) == 8
    names = {}
    for line in lines:
        command, *arguments = shlex.split(line)
        if command == "python":
            names = runpy.run_path(arguments[0])
        else:
            shown = placerec(arguments)
    told = re.search(r"recognises (\d+) % of the (\d+) test frames \(majority class (\d+) %\)", section)
    assert told is not None
    accuracy, majority = re.findall(r"(\d+\.\d) %", shown)[:2]
    assert f"{told[2]} judged" in shown
    # Rounding differs between machines, and with it a word here and there.
    assert float(accuracy) == pytest.approx(int(told[1]), abs=3)
    assert round(float(majority)) == int(told[3])
    names["image"] = names["placerec"].read_gray(sorted(Path("lab/seq3_night3/std_cam").iterdir())[0])
    Path("robot.py").write_text(robot, encoding="utf-8")
    assert (
        runpy.run_path("robot.py", names)["belief"].word
        == Path("tokens/seq3_night3.tsv").read_text().splitlines()[1].split("\t")[3]
    )
