"""docs/experiment.md against the csv files beside it, and the program that makes both."""

import csv
import importlib
import re
from collections import Counter
from itertools import product
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from helpers.small_world import write_tokens

from placerec.experiments.grid.config import read_config
from placerec.experiments.grid.report import PAPER_RUNS
from placerec.experiments.grid.results import COLUMNS, SEQUENCE_COLUMNS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "experiment.md"
FOLDERS = sorted(path.parent for path in (DOCS / "experiment").glob("*/results.csv"))
KEY = ("size", "seed", "fold", "smoothing", "select", "order", "transition")
# What the paper prints: the chance to stay, and its runs of the same word.
GIVEN = {"0.99", *map(str, PAPER_RUNS.values())}
TINY = """
[data]
tokens = "data/tiny/{seed}"
split = "leave-one-out"
[grid]
order = [1, 2]
smoothing = ["witten-bell"]
select = ["none"]
size = [2]
transition = ["fixed", "learned"]
seeds = 2
"""
each_set = pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS / "make"))
    return importlib.import_module("experiment_page")


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def key(row: dict[str, str]) -> tuple[int | str, ...]:
    return tuple(int(row[name]) if row[name].isdigit() else row[name] for name in KEY)


def test_every_config_has_results() -> None:
    assert [folder.name for folder in FOLDERS] == sorted(path.stem for path in (DOCS / "experiment").glob("*.toml"))
    assert len(FOLDERS) == 4


def test_the_tables_are_those_that_the_program_makes(program: ModuleType) -> None:
    page, made = PAGE.read_text(encoding="utf-8"), program.tables(program.read_all())
    assert sorted(slot[2] for slot in program.SLOT.finditer(page)) == sorted(made)
    assert program.filled(page, made) == page


def test_no_table_mixes_real_and_synthetic_sets(program: ModuleType) -> None:
    slots = {slot[2]: slot[3].splitlines() for slot in program.SLOT.finditer(PAGE.read_text(encoding="utf-8"))}
    heads = {name: lines[0] for name, lines in slots.items() if name.endswith("verdicts")}
    assert "synthetic" not in heads.pop("real verdicts")
    assert set(re.findall(r"(\S+), (?:fixed|learned)", heads.pop("synthetic verdicts"))) == {"synthetic"}
    assert not heads


def test_numbers_in_the_text_are_in_a_table_of_their_section(program: ModuleType) -> None:
    sections = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert len(sections) > 5
    for section in sections:
        tables = "".join(slot[3] for slot in program.SLOT.finditer(section))
        numbers = set(re.findall(r"\d+\.\d+", program.SLOT.sub("", section)))
        assert numbers <= {*re.findall(r"\d+\.\d+", tables), *GIVEN}, section.splitlines()[0]


@each_set
def test_a_grid_is_whole_sorted_and_small(folder: Path) -> None:
    rows, plan = read(folder / "results.csv"), read_config(folder.with_suffix(".toml"))
    assert tuple(rows[0]) == COLUMNS
    assert COLUMNS[:12] == (*KEY, "frames", "accuracy", "balanced_accuracy", "majority_accuracy", "same_word_run")
    keys = [key(row) for row in rows]
    assert keys == sorted(keys)
    folds = {row["fold"] for row in rows}
    axes = (plan.size, range(plan.seeds), folds, plan.smoothing, plan.select, plan.order, plan.transition)
    assert set(keys) == set(product(*axes))
    assert len(set(keys)) == len(keys)
    assert all(0 <= float(row["accuracy"]) <= 1 for row in rows)
    assert all(path.stat().st_size < 1_000_000 for path in folder.iterdir())


@each_set
def test_sequences_sum_to_the_rows(folder: Path) -> None:
    counts: dict[tuple[int | str, ...], list[list[int]]] = {}
    lines = read(folder / "sequences.csv")
    assert ",".join(lines[0]) == ",".join(SEQUENCE_COLUMNS)
    for line in lines:
        counts.setdefault(key(line), []).append([int(number) for number in list(line.values())[8:]])
    for row in read(folder / "results.csv"):
        frames, right, alone, majority, late = map(sum, zip(*counts.pop(key(row)), strict=True))
        assert frames == int(row["frames"])
        assert late <= frames - right
        shares = [float(row[f"{name}accuracy"]) for name in ("", "frame_wise_", "majority_")]
        assert shares == pytest.approx([right / frames, alone / frames, majority / frames], abs=1e-6)
    assert not counts


@each_set
def test_a_table_is_that_of_plain_sums(program: ModuleType, folder: Path) -> None:
    rows = read(folder / "results.csv")
    _, lines = program.selection_table(program.read_rows(folder))
    assert len(lines) == 10
    for line in lines:
        for transition, number in (("fixed", line[2]), ("learned", line[6])):
            own = [r for r in rows if [r["smoothing"], r["select"], r["transition"]] == [*line[:2], transition]]
            right, frames = Counter[str](), Counter[str]()
            for row in own:
                right[row["seed"]] += round(int(row["frames"]) * float(row["accuracy"]))
                frames[row["seed"]] += int(row["frames"])
            seeds = [100 * right[seed] / frames[seed] for seed in frames]
            assert number == f"{np.mean(seeds):.1f} ± {np.std(seeds, ddof=1):.1f}"


def test_what_learn_makes_is_the_mean_over_seeds_of_all_folds(program: ModuleType, tmp_path: Path) -> None:
    assert program.learned_line(tmp_path / "learned.csv") == ""
    rows = ["seed,fold,frames,right,log_loss", "0,a,30,30,0.1", "0,b,10,2,0.5", "1,a,30,27,0.2", "1,b,10,1,0.6"]
    (tmp_path / "learned.csv").write_text("".join(f"{row}\n" for row in rows), encoding="utf-8")
    told = "The system of `placerec learn` on the same folds, 2 seeds: 75.0 ± 7.1 % right, log loss 0.25."
    assert program.learned_line(tmp_path / "learned.csv") == f"\n{told}\n"


def test_a_run_is_kept_and_read_as_it_was(program: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for seed in "01":
        write_tokens(tmp_path / "sets" / "tiny" / seed)
    monkeypatch.setattr(program, "FOLDER", tmp_path / "docs")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "tiny.toml").write_text(TINY, encoding="utf-8")
    program.run("tiny", tmp_path / "sets", tmp_path / "work", 1)
    kept = tmp_path / "docs" / "tiny"
    assert {path.name for path in kept.iterdir()} == set(program.KEPT)
    rows, found = read(kept / "results.csv"), program.read_all()["tiny"]
    assert len(found) == len(rows) == 2 * 2 * 2 * 3
    for row, one in zip(rows, found, strict=True):
        assert [str(getattr(one, name)) for name in KEY] == [row[name] for name in KEY]
        assert f"{one.accuracy:.6f} {one.frame_wise_accuracy:.6f} {one.log_loss:.6f}" == (
            f"{row['accuracy']} {row['frame_wise_accuracy']} {row['log_loss']}"
        )
