"""The tables of docs/systems.md, and the program that makes them."""

import csv
import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from helpers.small_world import write_images

from placerec.experiments.comparison.methods import DEFAULT
from placerec.experiments.comparison.run import check_methods

DOCS = Path(__file__).parents[2] / "docs"
pytest.importorskip("sklearn")
pytest.importorskip("matplotlib")


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS / "make"))
    return importlib.import_module("systems")


def test_peers_are_on_every_view_with_names_that_compare_knows(program: ModuleType) -> None:
    assert check_methods(program.METHODS) == [*program.METHODS]
    assert {*DEFAULT} < {*program.METHODS}
    assert {"knn@lbp:pn", "rbf-svm-hmm@tuned", "logistic-hmm@ranks:pn-tuned", "ullah2008@views"} < {*program.METHODS}
    assert next(name for name in DEFAULT if not program.draws(name)) == "ullah2008"
    assert program.draws("hohmm")
    assert program.draws("torralba2003@pn-tuned")


def test_the_command_writes_tables_between_the_marks_of_a_page(tmp_path: Path) -> None:
    for seed in range(3):
        write_images(tmp_path / "go2home" / f"run{seed}", seed)
    (tmp_path / "page.md").write_text(
        "A\n<!-- table: go2home -->\nold\n<!-- end of table -->\n<!-- table: other -->\nkept\n<!-- end of table -->\n"
    )
    command = (DOCS / "make/systems.py", tmp_path / "go2home", "-o", tmp_path / "page", "--work", tmp_path / "work")
    more = ("--methods", "wu2009,knn@lbp:pn,knn@views,knn", "--seeds", "2", "--size", "2")
    subprocess.run([sys.executable, *command, *more], check=True, capture_output=True)
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert page.startswith("A\n<!-- table: go2home -->\n**go2home**: 36 test frames, 3 sequences; always `")
    assert page.endswith("<!-- table: other -->\nkept\n<!-- end of table -->\n")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| `")]
    assert sorted(rows) == ["`knn@views`", "`knn`", "`wu2009`"]
    with (tmp_path / "page/go2home/methods.csv").open(encoding="utf-8", newline="") as file:
        found = {row["method"]: row for row in csv.DictReader(file)}
    assert [*found] == ["wu2009", "knn", "knn@lbp:pn", "knn@views"]
    # Of a map of its own each method that draws, and no other one.
    for seed, beliefs in ((0, {*found}), (1, {"wu2009"})):
        for fold in range(3):
            out = tmp_path / f"work/go2home/size2-seed{seed}-fold{fold}-of-3/beliefs"
            assert {path.name for path in out.iterdir()} == beliefs


def test_the_summary_is_the_mean_over_sets(program: ModuleType, tmp_path: Path) -> None:
    for name, figures in (("a", "0.9,0.1,0.4"), ("b", "0.8,0.3,0.2")):
        (tmp_path / name).mkdir()
        lines = [f"{method},{figures}" for method in ("hohmm", "knn@views", "rbf-svm-hmm@lbp:pn-tuned")]
        text = "\n".join(["method,accuracy,ece,log_loss", *lines, ""])
        (tmp_path / name / "methods.csv").write_text(text, encoding="utf-8")
    _, _, *rows = program.summary([tmp_path / "a", tmp_path / "b"]).splitlines()
    cells = {row.split(" | ")[0]: row.strip("| ").split(" | ") for row in rows}
    assert cells["| `hohmm`"][-1] == "85.0, 0.200, 0.30"
    assert cells["| `knn`"][-1] == "85.0, 0.200, 0.30"
    assert sum("85.0" in row for row in rows) == 3


def test_the_tables_of_the_page_are_those_of_the_files(program: ModuleType) -> None:
    page = (DOCS / "systems.md").read_text(encoding="utf-8")
    tables = {slot[2]: slot[3] for slot in importlib.import_module("experiment_page").SLOT.finditer(page)}
    assert tables.pop("summary") == program.summary([DOCS / "systems" / name for name in program.SUMMARY])
    assert {*program.SUMMARY} < {*tables} == {path.name for path in (DOCS / "systems").iterdir()}
    for name, table in tables.items():
        with (DOCS / "systems" / name / "methods.csv").open(encoding="utf-8", newline="") as file:
            scores = {row["method"]: row for row in csv.DictReader(file)}
        rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| `")]
        assert len(rows) > 40
        assert scores.keys() == {*program.METHODS}
        for method, right, *_, ece, loss, _ in rows:
            row = scores[method.split("`")[1]]
            # The file's six digits were rounded before.
            assert float(right) == pytest.approx(100 * float(row["accuracy"]), abs=0.0502)
            assert float(ece) == pytest.approx(float(row["ece"]), abs=0.000502)
            assert float(loss) == pytest.approx(float(row["log_loss"]), abs=0.00502)
