"""The tables of docs/recognizer.md on several dictionaries, and the program that makes them."""

import importlib
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import ModuleType

import pytest
from helpers.small_world import write_images

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS / "make"))
    return importlib.import_module("weights")


def test_means_are_over_frames_in_a_set_then_over_sets_and_spread_over_seeds(program: ModuleType) -> None:
    def result(of: str, fold: int, seed: int, frames: int, accuracy: float) -> object:
        return program.Result("method", "ours", of, fold, seed, frames, accuracy, 0.1, accuracy / 2, None)

    results = [result("a", 0, 0, 30, 0.5), result("a", 1, 0, 10, 0.9), result("b", 0, 0, 7, 0.8)]
    results += [result("a", 0, 1, 30, 0.5), result("a", 1, 1, 10, 0.5), result("b", 0, 1, 7, 0.8)]
    head, lines = program.table(results, "method", ["a", "b", "c"])
    assert head == ("method", "a", "b", "mean")
    assert lines == [("`ours`", "55.0, 0.100, 0.28", "80.0, 0.100, 0.40", "67.5 ± 3.5, 0.338 ± 0.018")]
    assert program.table(results, "variant", ["a", "b"])[1] == []
    page = (
        "A\n<!-- table: weights methods -->\nold\n<!-- end of table -->\n<!-- table: b -->\nc\n<!-- end of table -->\n"
    )
    assert set(program.tables([]).values()) == {""}
    made = program.filled(page, {"weights methods": "new\n"})
    assert made == page.replace("old", "new")


def test_the_tables_are_those_that_the_program_makes(program: ModuleType) -> None:
    page = program.PAGE.read_text(encoding="utf-8")
    slots = {slot[2] for slot in program.SLOT.finditer(page)}
    assert slots == {"weights methods", "weights variants", "weights light"}
    if program.RESULTS.exists():
        made = program.tables(program.read_results(program.RESULTS))
        assert program.filled(page, made) == page


def test_every_fold_leaves_sequences_to_learn_from(program: ModuleType) -> None:
    assert all(len(set(folds)) == len(folds) for folds in program.FOLDS.values())
    assert len({variant.name for variant in program.VARIANTS}) == len(program.VARIANTS)


def test_results_are_kept_and_read_as_they_were(
    program: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    for seed in range(3):
        write_images(tmp_path / "data/tiny" / f"run{seed}", seed)
    monkeypatch.setattr(program, "FOLDS", {"tiny": (("run0",), ("run[12]",))})
    monkeypatch.setattr(program, "METHODS", ("majority", "naive-bayes"))
    chosen = [one for one in program.VARIANTS if one.name in ("the default", "memory 0") or one.short]
    variants = [replace(one, words={"views": ("gist",), "sizes": (2,)}) for one in chosen]
    monkeypatch.setattr(program, "VARIANTS", variants)
    results = list(program.run(tmp_path / "data", ["tiny"], [0], tmp_path / "work"))
    names = {("method", "majority"), ("method", "naive-bayes"), *(("variant", one.name) for one in variants)}
    assert {(one.kind, one.name, one.fold) for one in results} == {(*a, b) for a, b in product(names, (0, 1))}
    assert {(one.fold, one.frames) for one in results} == {(0, 12), (1, 24)}
    assert all(one.accuracy == 0.5 for one in results if one.name == "majority")
    (tmp_path / "weights.csv").write_text(program.format_results(results), encoding="utf-8")
    for found, expected in zip(program.read_results(tmp_path / "weights.csv"), results, strict=True):
        assert found[:6] == expected[:6]
        assert found[6:] == pytest.approx(expected[6:], abs=1e-6)

    def refuse(*args: object) -> None:
        raise AssertionError("done again")

    monkeypatch.setattr(program, "compared", refuse)
    monkeypatch.setattr(program, "varied", refuse)
    assert list(program.run(tmp_path / "data", ["tiny"], [0], tmp_path / "work")) == results
