"""The whole comparison on images of two places: its files, its memory, and what it refuses."""

import csv
import json
import logging
import shutil
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.errors import EvaluationError, MissingExtraError, OutputError, PlacerecError
from placerec.experiments import store
from placerec.experiments.comparison import benchmark, methods, run as run_module
from placerec.experiments.comparison.benchmark import Benchmark, MethodRun
from placerec.experiments.comparison.methods import ComparedMethod, method_of
from placerec.experiments.comparison.results import Comparison, format_comparison
from placerec.experiments.comparison.run import compare
from placerec.figures.evaluation import evaluate_files
from placerec.vision import Dictionary

for package in ("sklearn", "matplotlib"):
    pytest.importorskip(package)

COLUMNS = (
    "method,accuracy,accuracy_low,accuracy_high,balanced_accuracy,"
    "change_latency_frames,ece,microseconds_per_frame,log_loss"
)
METHODS = (
    *("hohmm", "majority", "mtd@tuned", "pronobis2007", "torralba2003", "ullah2008", "ullah2008-hmm@tuned", "knn"),
    "logistic-hmm@pn",
)
TIMINGS = ("microseconds_per_frame",)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compare") / "runs"
    for seed in range(5):
        write_images(folder / f"run{seed}", seed)
    return folder


def run(runs: Path, out: Path, **options: object) -> Comparison:
    chosen = {"methods": METHODS, "size": 3} | options
    return compare([runs], [runs / "run3", runs / "run4"], out, **chosen)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def done(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Comparison]:
    out = tmp_path_factory.mktemp("compare") / "out"
    return out, run(runs, out)


def rows(out: Path) -> dict[str, dict[str, str]]:
    with (out / "methods.csv").open(encoding="utf-8", newline="") as file:
        return {row["method"]: row for row in csv.DictReader(file)}


def untimed(out: Path) -> dict[str, bytes | dict[str, dict[str, str]]]:
    """The content of everything but the cache, its pictures and its timings."""
    files: dict[str, bytes | dict[str, dict[str, str]]] = {
        str(path.relative_to(out)): path.read_bytes() for path in (out / "beliefs").rglob("*.tsv")
    }
    table = {name: {k: v for k, v in row.items() if k not in TIMINGS} for name, row in rows(out).items()}
    return files | {"methods.csv": table, "pairs.csv": (out / "pairs.csv").read_bytes()}


def test_every_method_has_a_line_with_what_evaluate_says(done: tuple[Path, Comparison]) -> None:
    out, found = done
    assert (out / "methods.csv").read_text(encoding="utf-8").splitlines()[0] == COLUMNS
    table = rows(out)
    assert tuple(table) == METHODS
    for name, row in table.items():
        evaluation = evaluate_files([out / "beliefs" / name])
        assert float(row["accuracy"]) == pytest.approx(evaluation.accuracy, abs=1e-6)
        assert float(row["balanced_accuracy"]) == pytest.approx(evaluation.balanced_accuracy, abs=1e-6)
        assert float(row["ece"]) == pytest.approx(evaluation.ece, abs=1e-6)
        assert float(row["log_loss"]) == pytest.approx(evaluation.log_loss, abs=1e-6)
        assert float(row["change_latency_frames"]) == evaluation.change_latency_frames
        assert float(row["accuracy_low"]) <= float(row["accuracy"]) <= float(row["accuracy_high"])
        assert float(row["microseconds_per_frame"]) > 0
        assert sorted(path.name for path in (out / "beliefs" / name).glob("*.tsv")) == ["run3.tsv", "run4.tsv"]
    columns = found.to_dict()
    assert columns["method"] == [*METHODS]
    assert columns["accuracy"] == pytest.approx([float(row["accuracy"]) for row in table.values()], abs=1e-6)
    assert set(COLUMNS.split(",")) <= set(columns)
    assert all(float(row["accuracy"]) > 0.8 for name, row in table.items() if name != "majority")
    assert float(table["majority"]["accuracy"]) == found.majority == 0.5


def test_the_table_for_a_terminal_is_straight(done: tuple[Path, Comparison]) -> None:
    header, *lines, last = format_comparison(done[1]).splitlines()
    assert {line.index("%") for line in lines} == {header.index("accuracy") + len("accuracy") - 1}
    assert [line.split()[0] for line in lines] == [
        score.method for score in sorted(done[1].scores, key=lambda score: (-score.accuracy, score.method))
    ]
    assert last.startswith("24 frames; always 'hall'")


def test_every_two_methods_have_a_verdict(done: tuple[Path, Comparison]) -> None:
    out, found = done
    lines = (out / "pairs.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "first,second,difference,difference_low,difference_high,verdict"
    assert len(lines) - 1 == len(METHODS) * (len(METHODS) - 1) // 2
    assert {line.rsplit(",", 1)[1] for line in lines[1:]} <= {"holds", "cannot tell"}
    accuracy = {score.method: score.accuracy for score in found.scores}
    for pair in found.pairs:
        assert pair.difference == pytest.approx(accuracy[pair.first] - accuracy[pair.second])


def test_a_second_run_does_nothing_again(
    runs: Path, done: tuple[Path, Comparison], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    shutil.copytree(done[0], out)

    def refuse(*args: object, **options: object) -> None:
        raise AssertionError("done again")

    monkeypatch.setattr(store, "describe", refuse)
    monkeypatch.setattr(Dictionary, "fit", refuse)
    monkeypatch.setattr(methods, "timed", refuse)
    monkeypatch.setattr(benchmark, "train_model", refuse)
    run(runs, out)
    for name in ("methods.csv", "pairs.csv", "methods.png"):
        assert (out / name).read_bytes() == (done[0] / name).read_bytes()


def test_a_killed_run_goes_on_where_it_was(
    runs: Path, done: tuple[Path, Comparison], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    asked: list[str] = []

    def killed(name: str, method: ComparedMethod, benchmark: Benchmark) -> MethodRun:
        asked.append(name)
        if asked == ["hohmm", "majority", "mtd@tuned"]:
            raise KeyboardInterrupt
        return method.run(benchmark)

    monkeypatch.setattr(
        run_module, "method_of", lambda name: replace(method_of(name), run=partial(killed, name, method_of(name)))
    )
    with pytest.raises(KeyboardInterrupt):
        run(runs, out, cache=done[0] / "cache")
    assert not (out / "methods.csv").exists()
    run(runs, out, cache=done[0] / "cache")
    assert asked[3:] == list(METHODS[2:])
    assert untimed(out) == untimed(done[0])


def test_other_labels_or_images_are_not_taken_from_the_memory(
    runs: Path, done: tuple[Path, Comparison], tmp_path: Path
) -> None:
    out, again = tmp_path / "out", tmp_path / "runs"
    shutil.copytree(done[0], out)
    shutil.copytree(runs, again)
    places = again / "run4/localization/places.lst"
    places.write_text(places.read_text(encoding="utf-8").replace(" kitchen", " hall"), encoding="utf-8")
    before = sorted((out / "cache/descriptors").iterdir())
    found = run(again, out)
    # No image is described again for a label.
    assert sorted((out / "cache/descriptors").iterdir()) == before
    assert found.majority == 0.75
    assert set(evaluate_files([out / "beliefs/knn/run4.tsv"]).per_place) == {"hall", "kitchen"}
    assert evaluate_files([out / "beliefs/knn/run4.tsv"]).per_place["kitchen"].frames == 0


def test_test_sequences_train_nothing(runs: Path, done: tuple[Path, Comparison], tmp_path: Path) -> None:
    named = [runs / f"run{seed}" for seed in range(3)]
    tests = [runs / "run3", runs / "run4"]
    compare(named, tests, tmp_path / "out", methods=METHODS, size=3, cache=done[0] / "cache")
    assert untimed(tmp_path / "out") == untimed(done[0])


def test_a_single_test_sequence_says_what_its_interval_is(
    runs: Path, tmp_path: Path, done: tuple[Path, Comparison], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="placerec"):
        found = compare(
            [runs], [runs / "run4"], tmp_path / "out", methods=["majority"], size=3, cache=done[0] / "cache"
        )
    assert found.drawn == (2, "visits")
    assert "over its 2 visits" in caplog.text
    assert not (tmp_path / "out/cache").exists()


def test_progress_tells_frames_and_methods(runs: Path, tmp_path: Path) -> None:
    from collections.abc import Callable, Iterator
    from contextlib import contextmanager

    seen: dict[str, list[tuple[int, int]]] = {}

    @contextmanager
    def bar(label: str) -> Iterator[Callable[[int, int], None]]:
        yield lambda done, total: seen.setdefault(label, []).append((done, total))

    compare([runs / "run0"], [runs / "run1"], tmp_path / "out", methods=["hohmm", "majority"], size=2, progress=bar)
    assert list(seen) == ["describe (gist+lbp+ranks)", "methods", "pictures"]
    assert seen["describe (gist+lbp+ranks)"] == [(12, 24), (24, 24)]
    assert seen["methods"] == [(1, 2), (2, 2)]


@pytest.mark.parametrize("methods", [["hohmm", "svm"], []])
def test_unknown_methods_and_none_are_refused_before_any_work(runs: Path, tmp_path: Path, methods: list[str]) -> None:
    with pytest.raises(EvaluationError, match=r"choose from hohmm, hohmm-single, hohmm-paper, .*ullah2008.*knn"):
        run(runs, tmp_path / "out", methods=methods)
    assert not (tmp_path / "out").exists()


def test_without_scikit_learn_only_its_methods_are_refused(
    runs: Path, done: tuple[Path, Comparison], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(MissingExtraError, match=r"ullah2008 needs .*scikit-learn.*--methods"):
        run(runs, tmp_path / "out")
    run(runs, tmp_path / "out", methods=["majority", "torralba2003"], cache=done[0] / "cache")


def test_without_matplotlib_it_is_said_at_once(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"matplotlib.* pip install matplotlib"):
        run(runs, tmp_path / "out")


def test_sequences_that_nothing_can_be_compared_on_are_refused(runs: Path, tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="none is left to learn from"):
        compare([runs / "run0"], [runs], tmp_path / "out")
    bare = tmp_path / "bare"
    shutil.copytree(runs / "run0", bare)
    shutil.rmtree(bare / "localization")
    with pytest.raises(EvaluationError, match=r"no frame of .*bare has a label"):
        compare([runs], [bare], tmp_path / "out")
    with pytest.raises(EvaluationError, match="name 0 places"):
        compare([bare], [runs / "run0"], tmp_path / "out")
    with pytest.raises(PlacerecError, match="no such file or folder"):
        compare([runs], [runs / "run9"], tmp_path / "out")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="file: cannot be written"):
        run(runs, tmp_path / "file")
    with pytest.raises(OutputError, match="file/cache: cannot be written"):
        run(runs, tmp_path / "out", cache=tmp_path / "file/cache")


def test_equal_names_get_their_parents_in_front(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "run4", tmp_path / "other/run0")
    compare([runs / "run0"], [tmp_path / "other/run0"], tmp_path / "out", methods=["majority"], size=2)
    assert (tmp_path / "out/beliefs/majority/other-run0.tsv").exists()


def test_the_cost_of_the_cascade_has_its_second_looks(done: tuple[Path, Comparison]) -> None:
    facts = json.loads((done[0] / "beliefs/pronobis2007/run.json").read_text(encoding="utf-8"))
    (score,) = (score for score in done[1].scores if score.method == "pronobis2007")
    assert score.consulted == facts["consulted"]
    assert 0 <= facts["consulted"] <= 1
    costs = [json.loads(path.read_text(encoding="utf-8")) for path in (done[0] / "cache/costs").iterdir()]
    assert len(costs) >= 2
    least = facts["consulted"] * min(cost["descriptor"] for cost in costs)
    assert score.microseconds_per_frame >= least
    assert np.isfinite(score.microseconds_per_frame)


def test_tests_that_trained_or_stay_in_one_place_and_strange_labels_are_told(
    runs: Path, done: tuple[Path, Comparison], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shutil.copytree(runs / "run0", tmp_path / "again")
    shutil.copytree(runs / "run4", tmp_path / "still")
    places = tmp_path / "still/localization/places.lst"
    places.write_text(places.read_text(encoding="utf-8").replace(" kitchen", " halll").replace(" hall\n", " halll\n"))
    for test in ("again", "still"):
        compare([runs], [tmp_path / test], tmp_path / "out", methods=["majority"], size=3, cache=done[0] / "cache")
    told = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert "again: trained the words and the models, and tells nothing of what is new to them; test on others" in told
    assert "12 test frames are of 'halll', which the models do not know; the nearest name is 'hall'" in told
    assert sum("one place throughout" in text for text in told) == 1
