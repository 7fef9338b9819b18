"""Folds by the names of sequences: every sequence once, no test sequence in training, COLD's numbering."""

from pathlib import Path

import pytest

from placerec.errors import ExperimentError
from placerec.experiments.grid.run import find_images
from placerec.experiments.grid.splits import (
    LIGHT,
    SPLITS,
    Fold,
    cold_saarbruecken_b,
    in_simulated_light,
    leave_one_illumination_out,
    leave_one_out,
    named_tests,
)
from placerec.vision.light import LIGHTS

PART_B = [f"seq{path}_{light}{run}" for path in "34" for light in ("cloudy", "night", "sunny") for run in "123"]


def test_named_tests() -> None:
    assert named_tests(["a1", "a2", "b1"], ["a*"]) == [Fold("test", ("b1",), ("a1", "a2"))]
    with pytest.raises(ExperimentError, match=r"'c\*' is the name of no sequence; they are a1, a2, b1"):
        named_tests(["a1", "a2", "b1"], ["a*", "c*"])
    with pytest.raises(ExperimentError, match=r"all sequences test .a1, a2.*none is left to train"):
        named_tests(["a1", "a2"], ["*"])


def test_leave_one_out() -> None:
    names = ["a", "b", "c"]
    assert leave_one_out(names) == [
        Fold("a", ("b", "c"), ("a",)),
        Fold("b", ("a", "c"), ("b",)),
        Fold("c", ("a", "b"), ("c",)),
    ]
    with pytest.raises(ExperimentError, match="none is left to train"):
        leave_one_out(["a"])


def test_leave_one_illumination_out() -> None:
    folds = leave_one_illumination_out(PART_B)
    assert [fold.name for fold in folds] == ["cloudy", "night", "sunny"]
    for fold in folds:
        assert all(fold.name in name for name in fold.test)
        assert not any(fold.name in name for name in fold.train)
        assert sorted((*fold.train, *fold.test)) == sorted(PART_B)
    assert leave_one_illumination_out(["dum_cloudy1", "min_night2"])[0] == Fold(
        "cloudy", ("min_night2",), ("dum_cloudy1",)
    )
    with pytest.raises(ExperimentError, match="'run7' does not; leave that sequence out, or name the tests"):
        leave_one_illumination_out([*PART_B, "run7"])
    with pytest.raises(ExperimentError, match="none is left to train"):
        leave_one_illumination_out(["seq1_night1", "seq1_night2"])


def test_every_fold_once_in_each_simulated_light() -> None:
    folds = in_simulated_light(named_tests(["a", "b", "c"], ["a", "b"]))
    assert folds == [Fold(f"test-simulated-{light}", ("c",), ("a", "b"), light) for light in LIGHTS]
    assert [fold.light for fold in in_simulated_light(leave_one_out(["a", "b"]))] == [*LIGHTS, *LIGHTS]
    assert LIGHT not in SPLITS


@pytest.mark.parametrize("prefix", ["", "part_b-", "cold-saarbruecken_part_b_"])
def test_cold_saarbruecken_b_is_the_papers(prefix: str) -> None:
    names = [prefix + name for name in PART_B]
    (fold,) = cold_saarbruecken_b([*names, "seq1_cloudy1", "seq2_night4"])
    assert (fold.name, len(fold.train), len(fold.test)) == ("test", 12, 6)
    assert all(name.endswith("3") for name in fold.test)
    assert sorted((*fold.train, *fold.test)) == sorted(names)


def test_only_runs_1_to_3_of_part_b_train_and_test() -> None:
    (fold,) = cold_saarbruecken_b([*PART_B, "seq3_cloudy12", "seq4_sunny23", "seq4_night4", "seq3_cloudy123"])
    assert sorted((*fold.train, *fold.test)) == sorted(PART_B)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (PART_B[:-1], "seq4_sunny3 is there not; complete them, or name the tests"),
        ([*PART_B, "b-seq3_night2"], "seq3_night2 is there 2 times; complete"),
        ([*PART_B, "run1"], "needs COLD's names .seq3_cloudy1., and 'run1' is none"),
    ],
)
def test_cold_saarbruecken_b_refuses_other_names(names: list[str], told: str) -> None:
    with pytest.raises(ExperimentError, match=told):
        cold_saarbruecken_b(names)


def cold_tree(root: Path) -> None:
    """Saarbruecken as its archives unpack: both parts, one sequence in a folder of its own name, other files beside."""
    a = [f"seq1_{light}{run}" for light in ("cloudy", "night") for run in "123"]
    for part, names in (("part_a", a), ("part_b", PART_B)):
        for name in names:
            folder = root / part / name / (name if name == "seq4_night2" else "")
            (folder / "std_cam").mkdir(parents=True)
            (folder / "localization").mkdir()
            image = "t1152903982.078005_x2.2899201_y-0.2742010_a0.0025221.jpeg"
            (folder / "std_cam" / image).touch()
            (folder / "localization" / "places.lst").write_text(f"{image} CR-B\n")
    (root / "part_b" / "README.txt").touch()


def test_the_preset_takes_part_b_of_colds_layout(tmp_path: Path) -> None:
    cold_tree(tmp_path / "saarbruecken")
    names = [one.name for one in find_images(["saarbruecken/part_*"], tmp_path)]
    (fold,) = cold_saarbruecken_b(names)
    assert sorted(fold.test) == [f"seq{path}_{light}3" for path in "34" for light in ("cloudy", "night", "sunny")]
    assert len(fold.train) == 12
    assert [one.name for one in find_images([f"{tmp_path}/saarbruecken/*/seq3_*1"], tmp_path)] == [
        "seq3_cloudy1",
        "seq3_night1",
        "seq3_sunny1",
    ]
    with pytest.raises(ExperimentError, match=r"saarbruecken/seq\* is no folder; name folders of images"):
        find_images(["saarbruecken/seq*"], tmp_path)
