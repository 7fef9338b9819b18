"""What an experiment writes beside its rows: figure, tables, claims, and a page that needs nothing else."""

import csv
import json
import re
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from helpers.small_experiment import CONFIG, write_grid
from helpers.small_world import write_images
from helpers.typed_commands import done, placerec

from placerec.experiments.grid import report
from placerec.experiments.grid.cells import GridJob
from placerec.experiments.grid.claims import CLAIMS
from placerec.experiments.grid.config import Config
from placerec.experiments.grid.report import markdown, ranked
from placerec.experiments.grid.results import Results
from placerec.experiments.grid.run import experiment
from placerec.figures.evaluation import evaluate_files

IMAGES = """
[data]
sequences = ["runs/*"]
test = ["c"]
[grid]
order = [1, 2]
smoothing = ["witten-bell"]
select = ["none", "unique"]
size = [2]
transition = ["fixed", "learned"]
seeds = 1
[options]
stay = 0.9
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate("abc"):
        write_images(root / "runs" / name, seed)
    path = write_grid(root, IMAGES)
    result = done("experiment", path, "-o", root / "out", "--jobs", 1)
    assert result.stdout == ""
    assert result.stderr.endswith(f"results.csv: 8 rows; now open {root / 'out' / 'report.html'}\n")
    return root


def test_everything_is_there(world: Path) -> None:
    names = {path.name for path in (world / "out").iterdir()}
    figures = {f"figure{of}{suffix}" for of in ("", "-learned") for suffix in (".png", ".svg")}
    files = {"results.csv", "sequences.csv", "learned.csv", "tables.md", "claims.md", "report.html"}
    assert names == {"cache", *files, *figures}


def test_the_page_needs_no_network_and_no_second_file(world: Path) -> None:
    page = (world / "out" / "report.html").read_text(encoding="utf-8")
    addresses = re.findall(r'(?:src|srcset|href)="([^"]{0,20})', page)
    # Two figures, each for two widths; strips, on paper alone; two confusion matrices; the words.
    assert len(addresses) >= 7
    # The frames of the test run, which are pointed at.
    assert page.count('"data:image/webp') == 12
    assert all(address.startswith("data:image/") for address in addresses)
    for text in ("Do it again", "numpy ", "The words", "Belief over time", "What is confused", "stay = 0.9"):
        assert text in page


def test_every_claim_is_judged_for_every_kind_of_transitions(world: Path) -> None:
    text = (world / "out" / "claims.md").read_text(encoding="utf-8")
    for name in CLAIMS:
        # The verdicts, and twice the numbers.
        assert len(re.findall(rf"^\| {name} \|", text, re.MULTILINE)) == 3
    assert "1 test sequence; a verdict needs 6 or more" in text


def test_tables_count_images_and_runs(world: Path) -> None:
    text = (world / "out" / "tables.md").read_text(encoding="utf-8")
    assert "| test | training | 12 | 12 | 24 |" in text
    assert "| test | testing | 6 | 6 | 12 |" in text


def test_the_commands_of_the_page_give_the_best_row(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (world / "out" / "report.html").read_text(encoding="utf-8")
    lines = [
        line
        for line in re.findall(r"^(?:<pre>)?placerec ([a-z-]+ .*?)(?:</pre>)?$", page, re.MULTILINE)
        if "experiment" not in line
    ]
    *steps, learn = [line.split()[0] for line in lines]
    assert (steps, learn) == (["train-words", "tokenize", "train-lm", "decode", "evaluate"], "learn")
    monkeypatch.chdir(world)
    for line in lines:
        done(*shlex.split(line), "-q")
    results = experiment(world / "grid.toml", world / "out")
    best = ranked(results)[0]
    (row,) = [
        r for r in results.rows if (r.select, r.order, r.transition) == (best.select, best.order, best.transition)
    ]
    assert evaluate_files([world / "beliefs"]).accuracy == row.accuracy
    (learned,) = results.learned
    found = evaluate_files([world / "learned/beliefs"])
    assert (found.frames, found.accuracy, found.log_loss, found.ece) == pytest.approx(
        (learned.frames, learned.accuracy, learned.log_loss, learned.ece), abs=1e-6
    )
    evidence = json.loads((world / "learned/model.json").read_text())["evidence"]
    assert (evidence["alpha"], evidence["memory"]) == (learned.alpha, learned.memory)


def test_what_learn_makes_is_beside_the_grid(world: Path) -> None:
    with (world / "out/learned.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["seed"], row["fold"], row["frames"]) == ("0", "test", "12")
    accuracy = f"{100 * int(row['right']) / 12:.1f}"
    line = f"| several | placerec learn | none | 2 | learned | {accuracy} |  |  |"
    assert line in (world / "out/tables.md").read_text(encoding="utf-8")
    assert "placerec learn (several dictionaries" in (world / "out/figure.svg").read_text(encoding="utf-8")


def test_as_in_the_paper_the_grid_is_alone(world: Path, tmp_path: Path) -> None:
    shutil.copytree(world / "out", tmp_path / "out")
    config = world / "paper.toml"
    config.write_text(IMAGES + "as_in_paper = true\n", encoding="utf-8")
    results = experiment(config, tmp_path / "out")
    assert results.learned == []
    assert not (tmp_path / "out/learned.csv").exists()
    for name in ("results.csv", "sequences.csv"):
        assert (tmp_path / "out" / name).read_bytes() == (world / "out" / name).read_bytes()
    for name in ("tables.md", "report.html", "figure.svg"):
        assert "placerec learn (" not in (tmp_path / "out" / name).read_text(encoding="utf-8")


def test_what_is_there_is_not_made_again(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages: list[Path] = []
    real = report._write

    def write(results: Results, plan: Config, config: Path, jobs: Sequence[GridJob], out: Path) -> None:
        pages.append(out)
        real(results, plan, config, jobs, out)

    monkeypatch.setattr(report, "_write", write)
    page = world / "out" / "report.html"
    whole = page.read_bytes()
    experiment(world / "grid.toml", world / "out")
    assert (pages, page.read_bytes()) == ([], whole)
    page.write_bytes(whole[:1000])
    experiment(world / "grid.toml", world / "out")
    assert (len(pages), page.read_bytes()) == (1, whole)
    (world / "grid.toml").write_text((world / "grid.toml").read_text() + "# A note.\n")
    experiment(world / "grid.toml", world / "out")
    assert len(pages) == 2
    assert b"# A note." in page.read_bytes()


def test_several_folds_have_rows_strips_and_tables(tmp_path: Path) -> None:
    results = experiment(
        write_grid(tmp_path, CONFIG.replace('test = ["run3"]', 'split = "leave-one-out"')), tmp_path / "o"
    )
    assert sorted({row.fold for row in results.rows}) == ["run1", "run2", "run3"]
    assert all(list(row.sequences) == [row.fold] for row in results.rows)
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    assert "3 folds, 180 labelled test frames, 1 seed." in page
    assert "The words" not in page


def test_a_bar_in_a_cell_does_not_end_it() -> None:
    assert markdown((("a", "b"), [("x|y", "z")])) == "| a | b |\n| --- | --- |\n| x\\|y | z |\n"


def test_a_mistake_is_one_line_and_status_1(tmp_path: Path) -> None:
    path = write_grid(tmp_path, CONFIG.replace("size = [4]", "size = [1]"))
    result = placerec("experiment", path, "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert result.stderr.startswith(f"placerec: {path}: [grid] size = 1 cannot be used; give a whole number")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
