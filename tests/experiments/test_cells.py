"""A cell is what the commands give on the same streams."""

import csv
from pathlib import Path

import numpy as np
import pytest
from helpers.small_experiment import write_grid

from placerec.experiments.grid.cells import CellJob, GridCell, believe_cell, describe_data
from placerec.experiments.grid.config import read_config
from placerec.experiments.grid.run import run_grid
from placerec.figures.evaluation import evaluate_files
from placerec.hohmm import Beliefs, read_beliefs
from placerec.methods import decode
from placerec.model import Decoding, ModelOptions, train_lm
from placerec.words import WordStream, parse_selection

TRANSITIONS = {"fixed": Decoding(stay=0.9, per="frame"), "learned": Decoding(transition="learned")}


def late_frames(beliefs: Beliefs) -> int:
    """Wrong frames since the last change of place, until one is right, one frame at a time."""
    late, before, waiting = 0, "", False
    for truth, best in zip(beliefs.truth, beliefs.best, strict=True):
        waiting = truth != best and (waiting or before not in ("", truth))
        late += waiting
        before = truth
    return late


def test_rows_are_those_of_the_commands(tmp_path: Path) -> None:
    path = write_grid(tmp_path)
    path.write_text(path.read_text() + '[options]\nstay = 0.9\nper = "frame"\n')
    _, results = run_grid(read_config(path), tmp_path / "out")
    assert len(results.rows) == 2 * 2 * 3 * 2
    tokens = [tmp_path / "tokens" / f"run{i}.tsv" for i in (1, 2, 3)]
    for row in results.rows:
        options = ModelOptions(order=row.order, smoothing=row.smoothing, select=parse_selection(row.select))
        train_lm(tokens[:2], tmp_path / "model", options=options, as_in_paper=True)
        decode(tokens[2:], tmp_path / "model", out=tmp_path / "beliefs", options=TRANSITIONS[row.transition])
        found = evaluate_files([tmp_path / "beliefs"])
        assert (row.frames, row.accuracy) == (found.frames, found.accuracy)
        assert row.balanced_accuracy == found.balanced_accuracy
        assert row.majority_accuracy == found.majority_accuracy
        assert row.change_latency_frames == found.change_latency_frames
        assert row.log_loss == pytest.approx(found.log_loss, rel=1e-6)
        assert row.sequences["run3"].right == round(found.accuracy * found.frames)
        assert row.sequences["run3"].late == late_frames(read_beliefs(tmp_path / "beliefs" / "run3.tsv"))
    with (tmp_path / "out" / "results.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["accuracy"] for row in rows] == [f"{row.accuracy:.6f}" for row in results.rows]
    assert list(rows[0])[:12] == [
        *("size", "seed", "fold", "smoothing", "select", "order", "transition", "frames"),
        *("accuracy", "balanced_accuracy", "majority_accuracy", "same_word_run"),
    ]


def test_beliefs_are_those_of_decode_to_the_last_digit(tmp_path: Path) -> None:
    write_grid(tmp_path)
    tokens = tuple(tmp_path / "tokens" / f"run{i}.tsv" for i in (1, 2, 3))
    for cell in (GridCell("witten-bell", 3, "fixed"), GridCell("lidstone-backoff", 2, "learned")):
        job = CellJob(tokens[:2], tokens[2:], "compress:2", (cell,), 0.9, "frame", tmp_path / "kept.json")
        options = ModelOptions(order=cell.order, smoothing=cell.smoothing, select=parse_selection("compress:2"))
        train_lm(tokens[:2], tmp_path / "model", options=options, as_in_paper=True)
        (wanted,) = decode(tokens[2:], tmp_path / "model", options=TRANSITIONS[cell.transition])
        (found,) = believe_cell(job, cell)
        assert np.array_equal(found.belief, wanted.belief)
        assert found.best == wanted.best


def test_runs_of_words_are_cut_at_the_ends_of_sequences() -> None:
    streams = [WordStream.of("a", ["x", "x", "y"], ["p", "", "q"]), WordStream.of("b", ["y", "y", "y"])]
    assert describe_data(streams, []) == {"same_word_run": 6 / 3, "train": {"p": 1, "q": 1}, "test": {}}


def test_frame_wise_is_each_word_alone(tmp_path: Path) -> None:
    (tmp_path / "tokens").mkdir()
    for name, words in (("run1", "aabbb"), ("run3", "abbac")):
        lines = "".join(f"{place}\t{word}\n" for place, word in zip("KKHHH", words, strict=True))
        (tmp_path / "tokens" / f"{name}.tsv").write_text("place\tword\n" + lines)
    (tmp_path / "tokens" / "vocab.txt").write_text("a\nb\nc\n")
    _, results = run_grid(read_config(write_grid(tmp_path)), tmp_path / "out")
    # a is of K, b of H; c is of neither, and a little less improbable in K, which was seen less.
    assert {row.sequences["run3"].frame_wise for row in results.rows} == {2}
    assert {row.frame_wise_accuracy for row in results.rows} == {2 / 5}
    assert {row.sequences["run3"].majority for row in results.rows} == {3}
