"""The figure of rows whose numbers are known."""

from pathlib import Path

import pytest
from helpers.small_experiment import CONFIG, write_grid

from placerec.experiments.grid.config import read_config
from placerec.experiments.grid.figure import draw_figure
from placerec.experiments.grid.results import Row, SequenceCount, Setting, by_seed


def row(seed: int, fold: str, right: int, order: int = 1) -> Row:
    counts = {f"run-{fold}": SequenceCount(100, right, 50, 30, 0)}
    return Row(4, seed, fold, "witten-bell", "none", order, "fixed", 100, 0, 0, 0, 0, None, 0, 0, counts)


def test_a_seed_is_one_number_over_all_folds() -> None:
    rows = [row(0, "a", 60), row(0, "b", 80), row(1, "a", 90), row(1, "b", 90)]
    assert by_seed(rows) == {Setting(4, "witten-bell", "none", 1, "fixed"): [0.7, 0.9]}
    assert by_seed(rows, lambda one: one.majority) == {Setting(4, "witten-bell", "none", 1, "fixed"): [0.3, 0.3]}


@pytest.mark.parametrize("narrow", [False, True])
def test_dots_and_lines_are_where_the_numbers_are(tmp_path: Path, narrow: bool) -> None:
    text = CONFIG.replace(', "lidstone-backoff"', "").replace('"none", "compress:3", "unique"', '"none"')
    plan = read_config(write_grid(tmp_path, text))
    rows = [row(seed, "a", 60 + 10 * order + 4 * seed, order) for seed in (0, 1) for order in (1, 3)]
    for suffix in (".svg", ".png"):
        for name in ("one", "two"):
            draw_figure(rows, plan, tmp_path / f"{name}{suffix}", title="Two seeds", narrow=narrow)
        assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()
    drawn = (tmp_path / "one.svg").read_text(encoding="utf-8")
    for text in ("Two seeds", "S = 4, witten-bell", "n = 1", "n = 3", "selection of words (dots)", "naive Bayes"):
        assert f"<!-- {text}" in drawn or text in drawn
