"""The tables of docs/vision.md on descriptors and projections, and the programs that make them."""

import importlib
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.frames.table import FrameTable
from placerec.vision import Descriptors, DescriptorSpec, DictionaryOptions, DictionarySet, DictionarySetOptions
from placerec.vision.pca import project

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS / "make"))
    return importlib.import_module("descriptors")


@pytest.fixture
def projections(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS / "make"))
    return importlib.import_module("projections")


def drive(frames: int = 300, width: int = 12) -> Descriptors:
    """Two sequences through three places, with a drift that is slow in one direction and fast in the others."""
    rng = np.random.default_rng(0)
    steps = rng.normal(size=(frames, width)) * np.linspace(1, 3, width)
    rows = 0.7 * np.cumsum(steps, axis=0) / np.sqrt(np.arange(1, frames + 1))[:, None] + steps
    places = [("", "hall", "room", "hall")[i * 4 // frames] for i in range(frames)]
    half = frames // 2
    names = [f"{i:03}.png" for i in range(frames)]
    tables = [
        FrameTable.of(name, names[of], places=places[of]) for name, of in (("a", slice(half)), ("b", slice(half, None)))
    ]
    return Descriptors(DescriptorSpec(kind="npy", columns=width), rows.astype(np.float32), FrameTable.concat(tables))


@pytest.mark.parametrize("projection", ["plain", "pn", "half"])
def test_projections_that_placerec_has_are_those_of_placerec(projections: ModuleType, projection: str) -> None:
    frames = drive()
    found = projections.learned(frames, projection, DictionaryOptions(4, seed=3))
    options = DictionarySetOptions((projection,), (4,), seed=3)
    made = DictionarySet.fit(frames.values, spec=frames.spec, places=frames.table.places, options=options)
    assert found.fingerprint == made.fingerprint


def test_a_visit_ends_where_the_place_or_the_sequence_does(projections: ModuleType) -> None:
    numbers = projections.visit_numbers(drive(16)).tolist()
    assert numbers == [-1] * 4 + [1] * 4 + [2] * 4 + [3] * 4
    sequences, places = ("a", "a", "a", "b", "b"), ("hall", "", "hall", "hall", "hall")
    parts = [
        FrameTable.of(name, [f"{i}.png"], places=[place])
        for i, (name, place) in enumerate(zip(sequences, places, strict=True))
    ]
    frames = Descriptors(DescriptorSpec(kind="npy", columns=1), np.zeros((5, 1), np.float32), FrameTable.concat(parts))
    assert projections.visit_numbers(frames).tolist() == [0, -1, 2, 3, 3]


def test_slow_features_move_alike_in_every_direction(projections: ModuleType) -> None:
    frames = drive(4000)
    apart = projections.APART
    pca = projections.learned(frames, "slow", DictionaryOptions(2, epochs=1)).pca
    codes = project(frames.values, pca).astype(float)
    own = np.array(frames.sequences)
    steps = (codes[apart:] - codes[:-apart])[own[apart:] == own[:-apart]]
    covariance = steps.T @ steps / len(steps)
    assert np.allclose(
        covariance,
        np.eye(len(covariance)) * np.trace(covariance) / len(covariance),
        rtol=0,
        atol=0.1 * covariance[0, 0],
    )


def test_a_tenth_of_the_mean_variance_is_added(projections: ModuleType) -> None:
    frames = drive()
    codes = project(frames.values, projections.learned(frames, "tenth", DictionaryOptions(2, epochs=1)).pca).astype(
        float
    )
    plain = project(frames.values, projections.learned(frames, "plain", DictionaryOptions(2, epochs=1)).pca).astype(
        float
    )

    def within(values: np.ndarray) -> np.ndarray:
        labels = np.array(frames.places)
        apart = np.concatenate([values[labels == one] - values[labels == one].mean(axis=0) for one in ("hall", "room")])
        return np.asarray(apart.T @ apart / len(apart))

    # Where the variance is v of a mean m, it becomes v / (v + m / 10).
    variances = np.linalg.eigvalsh(within(plain))
    expected = variances / (variances + 0.1 * variances.mean())
    assert np.sort(np.linalg.eigvalsh(within(codes))) == pytest.approx(np.sort(expected), rel=1e-4)


def test_means_are_over_frames_in_a_set_then_over_sets(program: ModuleType) -> None:
    def result(view: str, of: str, fold: int, frames: int, accuracy: float) -> object:
        figures = dict.fromkeys(program.FIGURES, accuracy) | {"frames": frames, "dim": accuracy - 0.1 * fold}
        return program.Result("descriptor", view, 20, 0, of, fold, figures)

    first, second = list(program.FOLDS)[:2]
    results = [result("gist", first, 0, 30, 0.5), result("gist", first, 1, 10, 0.9), result("gist", second, 0, 7, 0.8)]
    head, lines = program.by_set(results, "descriptor")
    assert head == ("descriptor", first, second, "mean")
    assert lines == [("`gist`", "60.0 / 60.0 / 60.0, 0.600", "80.0 / 80.0 / 80.0, 0.800", "70.0 / 70.0 / 70.0, 0.700")]
    head, lines = program.in_light(results)
    assert head == ("descriptor", "as it is", "dim", "warm", "lamp", "exposure")
    assert lines == [("`gist`", "70.0", "68.8 (-2.5)", *["70.0 (+0.0)"] * 3)]
    assert program.by_set(results, "projection")[1] == []


def test_the_tables_are_those_that_the_program_makes(program: ModuleType) -> None:
    page = program.PAGE.read_text(encoding="utf-8")
    slots = {slot[2] for slot in importlib.import_module("experiment_page").SLOT.finditer(page)}
    assert {"descriptors", "projections"} <= slots <= program.tables([], []).keys()
    if program.RESULTS.exists():
        made = program.tables(program.read_results(program.RESULTS), json.loads(program.COSTS.read_text("utf-8")))
        assert slots == made.keys()
        assert "" not in made.values()
        assert program.filled(page, made) == page


def test_results_are_kept_and_read_as_they_were(
    program: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    for seed in range(3):
        write_images(tmp_path / "data/tiny" / f"run{seed}", seed)
    for name, value in {"FOLDS": {"tiny": (("run[01]",),)}, "MADE": ["ranks", "gist"], "SIZE": 2}.items():
        monkeypatch.setattr(program, name, value)
    for name, value in {"SIZES": (2,), "SEEDS": 1, "CHANGED": 2, "DEFAULT_KIND": "gist+ranks"}.items():
        monkeypatch.setattr(program, name, value)
    results = list(program.run(tmp_path / "data", ["tiny"], None, tmp_path / "work"))
    views = ["ranks", "ranks:pn", "gist", "gist:pn", "gist+ranks:pn"]
    assert [one.view for one in results] == [*views, *views, "plain", "pn", "visits", "half", "slow", "tenth"]
    assert {one.figures["frames"] for one in results} == {24}
    for view in views:
        own = [one.figures for one in results if one.view == view]
        assert {*own[0], *own[1]} == {*program.FIGURES}
    (tmp_path / "results.csv").write_text(program.format_results(results), encoding="utf-8")
    for found, expected in zip(program.read_results(tmp_path / "results.csv"), results, strict=True):
        assert found[:-1] == expected[:-1]
        assert found.figures == pytest.approx(expected.figures, abs=1e-6)

    def refuse(*args: object) -> None:
        raise AssertionError("done again")

    monkeypatch.setattr(program, "figures", refuse)
    assert list(program.run(tmp_path / "data", ["tiny"], None, tmp_path / "work")) == results
