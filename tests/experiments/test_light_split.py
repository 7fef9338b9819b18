"""The split `light`: learned from frames as they are, tested in each simulated light, which every page says."""

import csv
import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from helpers.pictures import drawn_texts
from helpers.small_experiment import write_grid
from helpers.small_world import write_images
from helpers.typed_commands import done, fails

from placerec.evaluation.metrics import evaluate
from placerec.experiments.grid import relit
from placerec.experiments.grid.config import read_config
from placerec.experiments.grid.report import ranked
from placerec.experiments.grid.results import Results, by_seed, scores
from placerec.experiments.grid.run import experiment, run_grid
from placerec.figures.evaluation import evaluate_files
from placerec.frames import Sequence
from placerec.methods import decode
from placerec.model import Decoding, ModelOptions, train_lm
from placerec.vision import DictionaryOptions, train_dictionary
from placerec.vision.light import LIGHTS, relight, relight_sequence
from placerec.words.tokenize import tokenize

CONFIG = """
[data]
sequences = ["runs/*"]
split = "light"
test = ["c"]
[grid]
order = [1, 2]
smoothing = ["witten-bell"]
select = ["none"]
size = [3]
transition = ["learned"]
seeds = 1
"""
FOLDS = [f"test-simulated-{light}" for light in LIGHTS]
World = tuple[Path, Results]
LEARNED = Decoding(transition="learned", alpha=1.0, memory=0.0)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate("abc"):
        write_images(root / "runs" / name, seed)
    return root, experiment(write_grid(root, CONFIG), root / "out")


def test_a_fold_is_the_relit_recording_decoded_by_what_plain_frames_taught(world: World, tmp_path: Path) -> None:
    root, results = world
    training = [root / "runs" / name for name in "ab"]
    train_dictionary(training, tmp_path / "words.npz", options=DictionaryOptions(size=3))
    tokenize(training, tmp_path / "words.npz", tmp_path / "tokens")
    train_lm([tmp_path / "tokens"], tmp_path / "model", options=ModelOptions(2), as_in_paper=True)
    for light in LIGHTS:
        relight([root / "runs/c"], tmp_path / light, light)
        tokenize([tmp_path / light], tmp_path / "words.npz", tmp_path / f"tokens-{light}")
        beliefs = decode([tmp_path / f"tokens-{light}"], tmp_path / "model", options=LEARNED)
        (row,) = [row for row in results.rows if (row.fold, row.order) == (f"test-simulated-{light}", 2)]
        found = evaluate(beliefs)
        assert (row.frames, row.accuracy) == (12, found.accuracy)
        assert row.log_loss == pytest.approx(found.log_loss)


def test_each_drive_counts_once_with_its_frames_in_every_light(world: World) -> None:
    _, results = world
    assert list(dict.fromkeys(row.fold for row in results.rows)) == sorted(FOLDS)
    found = scores(results.rows, draws=5)
    assert found.sequences == ("c",)
    for (size, smoothing, select, order, _), shares in by_seed(results.rows).items():
        cell = found.take(size=[size], smoothing=[smoothing], select=[select], order=[order])
        assert cell.ravel() == pytest.approx(np.full(6, 100 * shares[0]))
    majority = np.mean([row.majority_accuracy for row in results.rows])
    assert found.majority == pytest.approx(np.full(6, 100 * majority))


def test_everything_that_is_shown_says_that_the_light_is_simulated(world: World) -> None:
    root, results = world
    tables, claims = ((root / "out" / name).read_text(encoding="utf-8") for name in ("tables.md", "claims.md"))
    page = (root / "out/report.html").read_text(encoding="utf-8")
    said = "Tests are frames in simulated light, as placerec relight makes it; training frames are as they are."
    for text in (tables, claims, page):
        assert said in text
    assert "(light: tests are c)" in page
    assert "learned transitions, simulated light" in drawn_texts(root / "out/figure.svg")
    for fold in FOLDS:
        assert f"| {fold} | testing | 6 | 6 | 12 |" in tables
        assert f"c, simulated: {fold.rpartition('-')[2]}" in page
    with (root / "out/learned.csv").open(encoding="utf-8", newline="") as file:
        learned = {row["fold"]: row for row in csv.DictReader(file)}
    best = ranked(results)[0]
    for light in LIGHTS:
        fold = f"test-simulated-{light}"
        (row,) = [row for row in results.rows if row.setting == best and row.fold == fold]
        cells = [100 * row.accuracy, row.log_loss, 100 * float(learned[fold]["accuracy"])]
        line = (
            f"| {light} | {cells[0]:.1f} | {cells[1]:.3f} | {cells[2]:.1f} | {float(learned[fold]['log_loss']):.3f} |"
        )
        assert line in tables


def test_the_commands_of_the_page_give_the_row_of_the_first_light(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, results = world
    page = (root / "out/report.html").read_text(encoding="utf-8")
    steps = re.findall(r"^(?:<pre>)?placerec ((?:train-words|tokenize|train-lm|decode) .*)$", page, re.MULTILINE)
    assert len(steps) == 4
    monkeypatch.chdir(root)
    for step in steps:
        done(*shlex.split(step), "-q")
    (row,) = [row for row in results.rows if (row.setting, row.fold) == (ranked(results)[0], "test-simulated-dim")]
    assert evaluate_files([root / "beliefs"]).accuracy == row.accuracy


def test_what_is_kept_is_not_relit_again(world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root, results = world
    shutil.copytree(root / "out", tmp_path / "out")
    written: list[str] = []

    def write(sequence: Sequence, folder: Path, light: str, *, seed: int) -> Iterator[bool]:
        written.append(light)
        return relight_sequence(sequence, folder, light, seed=seed)

    monkeypatch.setattr(relit, "relight_sequence", write)
    _, again = run_grid(read_config(root / "grid.toml"), tmp_path / "out")
    assert (written, again.rows) == ([], results.rows)
    shutil.rmtree(next((tmp_path / "out/cache/relit").iterdir()))
    _, again = run_grid(read_config(root / "grid.toml"), tmp_path / "out")
    assert (len(written), again.rows) == (1, results.rows)


def test_without_named_tests_every_sequence_is_the_test(tmp_path: Path) -> None:
    for seed, name in enumerate("ab"):
        write_images(tmp_path / "runs" / name, seed)
    _, results = run_grid(read_config(write_grid(tmp_path, CONFIG.replace('test = ["c"]', ""))), tmp_path / "out")
    assert {(row.fold, *row.sequences) for row in results.rows} == {
        (f"{name}-simulated-{light}", name) for name in "ab" for light in LIGHTS
    }


def test_a_sequence_without_an_image_is_told(tmp_path: Path) -> None:
    for seed, name in enumerate("abc"):
        write_images(tmp_path / "runs" / name, seed)
    for path in (tmp_path / "runs/c/std_cam").iterdir():
        path.write_text("no picture")
    path = write_grid(tmp_path, CONFIG)
    fails("c: none of its images can be read; leave the sequence out", "experiment", path, "-o", tmp_path / "out")
