"""`compare` with dictionaries of one's own, and with descriptors that were computed elsewhere."""

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.errors import EvaluationError, ExperimentError, VisionError
from placerec.evaluation.metrics import evaluate
from placerec.experiments.comparison.run import compare
from placerec.hohmm import read_beliefs
from placerec.methods import decode
from placerec.model import train_lm
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions, describe_sources, train_dictionary
from placerec.words.tokenize import tokenize

pytest.importorskip("matplotlib")

METHODS = ("hohmm", "hohmm-single", "torralba2003")
WORDS = DictionarySetOptions(sizes=(2, 3), components=6)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compare") / "runs"
    for seed in range(4):
        write_images(folder / f"run{seed}", seed)
    return folder


@pytest.fixture(scope="module")
def words(runs: Path) -> Path:
    train_dictionary([runs / f"run{seed}" for seed in (0, 2, 3)], runs.parent / "words.npz", options=WORDS)
    return runs.parent / "words.npz"


@pytest.fixture(scope="module")
def described(runs: Path) -> Path:
    """The descriptors of all runs, by name."""
    describe_sources([runs], runs.parent / "all.npz")
    return runs.parent / "all.npz"


def beliefs(out: Path, method: str, test: str = "run1") -> bytes:
    return (out / "beliefs" / method / f"{test}.tsv").read_bytes()


def test_own_words_are_those_of_the_single_commands(tmp_path: Path, runs: Path, words: Path) -> None:
    compare([runs], [runs / "run1"], tmp_path / "out", methods=METHODS, words=words)
    tokenize([runs], words, tmp_path / "tokens")
    streams = [tmp_path / "tokens" / f"run{seed}.tsv" for seed in (0, 2, 3)]
    train_lm(streams, tmp_path / "model")
    decode([tmp_path / "tokens/run1.tsv"], tmp_path / "model", out=tmp_path / "beliefs")
    expected, found = (read_beliefs(path) for path in (tmp_path / "beliefs/run1.tsv", _file(tmp_path / "out", "hohmm")))
    assert found.words == expected.words
    np.testing.assert_allclose(found.belief, expected.belief, atol=1e-6)
    # The others have the first dictionary alone, which is of the view plain.
    assert read_beliefs(_file(tmp_path / "out", "hohmm-single")).words == expected.words


def _file(out: Path, method: str) -> Path:
    return out / "beliefs" / method / "run1.tsv"


def test_a_test_that_trained_own_words_is_told(
    tmp_path: Path, runs: Path, words: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        compare([runs], [runs / "run3"], tmp_path / "out", methods=["majority"], words=words)
    assert "run3: trained the words, and tells nothing of what is new to them; test on others" in caplog.text


def test_given_descriptors_are_as_good_as_those_computed_here(tmp_path: Path, runs: Path, described: Path) -> None:
    compare([runs], [runs / "run1"], tmp_path / "here", methods=METHODS, size=3)
    found = compare([runs], [runs / "run1"], tmp_path / "named", methods=METHODS, size=3, matrix=described)
    with np.load(described) as archive:
        np.save(tmp_path / "rows.npy", archive["descriptors"])
    # The rows of a .npy are in the order of TRAIN, whichever sequences test.
    compare([runs], [runs / "run1"], tmp_path / "rows", methods=METHODS, size=3, matrix=tmp_path / "rows.npy")
    for method in METHODS:
        # What is described here for hohmm is more than GIST.
        assert (beliefs(tmp_path / "here", method) == beliefs(tmp_path / "named", method)) == (method != "hohmm")
        assert beliefs(tmp_path / "named", method) == beliefs(tmp_path / "rows", method)
    assert np.isnan(found.cost.descriptor)
    assert 0 < found.cost.word < np.inf
    assert "computed elsewhere" in (tmp_path / "named/methods.svg").read_text(encoding="utf-8")


def test_without_names_methods_are_all_that_describe_no_image_themselves(
    tmp_path: Path, runs: Path, described: Path
) -> None:
    pytest.importorskip("sklearn")
    found = compare([runs], [runs / "run1"], tmp_path / "out", size=2, matrix=described)
    names = {score.method for score in found.scores}
    assert "pronobis2007" not in names
    assert {"hohmm", "pronobis2010", "rbf-svm-hmm@pn-tuned"} < names


def test_own_words_of_given_descriptors(tmp_path: Path, runs: Path) -> None:
    rows = np.random.default_rng(0).random((48, 7), np.float32)
    np.save(tmp_path / "rows.npy", rows)
    options = DictionarySetOptions(views=("plain",), sizes=(3,), components=5)
    made = DictionarySet.fit(rows, spec=DescriptorSpec(kind="npy", columns=7), options=options)
    made.save(tmp_path / "words.npz")
    how = {"methods": ["hohmm", "wu2009"], "words": tmp_path / "words.npz"}
    found = compare([runs], [runs / "run1"], tmp_path / "out", matrix=tmp_path / "rows.npy", **how)  # type: ignore[arg-type]
    assert evaluate([read_beliefs(_file(tmp_path / "out", "hohmm"))]).frames == found.frames == 12
    model = next(path for path in (tmp_path / "out/cache/models").iterdir() if (path / "words.npz").exists())
    assert json.loads((model / "model.json").read_text())["evidence"]["redone"] == "models, transitions"
    with pytest.raises(
        EvaluationError, match=r"words\.npz: is of descriptors that were computed elsewhere; --descriptor"
    ):
        compare([runs], [runs / "run1"], tmp_path / "none", **how)  # type: ignore[arg-type]


def test_what_cannot_be_used_is_refused(tmp_path: Path, runs: Path, words: Path, described: Path) -> None:
    tests = [runs / "run1"]
    with pytest.raises(
        EvaluationError, match="pronobis2007 describes images itself, and the descriptors come from else"
    ):
        compare([runs], tests, tmp_path / "out", methods=["pronobis2007"], matrix=described)
    normalised = DictionarySetOptions(views=("pn",), sizes=(2,), components=6)
    train_dictionary([runs], tmp_path / "pn.npz", options=normalised)
    with pytest.raises(EvaluationError, match=r"pn\.npz: has no dictionary of the view plain, which most methods use"):
        compare([runs], tests, tmp_path / "out", words=tmp_path / "pn.npz")
    with pytest.raises(VisionError, match=r"all\.npz: is not wanted, for the dictionary is of gist descriptors"):
        compare([runs], tests, tmp_path / "out", words=words, matrix=described)
    with np.load(described) as archive:
        kept = archive["sequences"] != "run2"
        lacking = {name: archive[name][kept] for name in ("descriptors", "sequences", "frames")}
    np.savez(tmp_path / "lacking.npz", **lacking)
    with pytest.raises(VisionError, match=r"lacking\.npz: has no rows for the sequence 'run2'"):
        compare([runs], tests, tmp_path / "out", matrix=tmp_path / "lacking.npz")
    lacking["sequences"] = np.append(lacking["sequences"], "run2")
    lacking["frames"] = np.append(lacking["frames"], "other.png")
    lacking["descriptors"] = np.concatenate([lacking["descriptors"], lacking["descriptors"][:1]])
    np.savez(tmp_path / "other.npz", **lacking)
    with pytest.raises(ExperimentError, match=r"run2: .*other\.npz has no row for its frames; leave the sequence out"):
        compare([runs], tests, tmp_path / "out", matrix=tmp_path / "other.npz")
