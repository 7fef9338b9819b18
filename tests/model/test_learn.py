"""`placerec learn`: from images to a model in one go, the files of the single commands to the byte."""

from dataclasses import replace
from pathlib import Path

import pytest
from helpers.small_world import write_images

from placerec import learn
from placerec.errors import ModelError, VisionError
from placerec.hohmm.weights import LEAST_GROUPS
from placerec.learning import format_learned
from placerec.methods import decode
from placerec.model import ModelOptions, load_model, train_lm
from placerec.model.learn import weigher
from placerec.vision import (
    DescriptorSpec,
    DictionarySetOptions,
    describe_sources,
    train_dictionary,
)
from placerec.words.tokenize import tokenize

WORDS = DictionarySetOptions(sizes=(2, 3), components=6)


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    return [write_images(tmp_path / "runs" / f"run{seed}", seed, 16) for seed in range(4)]


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize(("least", "views"), [(LEAST_GROUPS, 4), (3, 3)])
def test_it_writes_what_the_single_commands_write(
    tmp_path: Path, runs: list[Path], monkeypatch: pytest.MonkeyPatch, least: int, views: int
) -> None:
    monkeypatch.setattr("placerec.hohmm.weights.LEAST_GROUPS", least)
    training = runs[:3]
    found = learn(training, tmp_path / "model", words=WORDS)
    # Of three sequences each is a group.
    assert len(found.dictionaries.options.views) == views
    words = replace(WORDS, views=found.dictionaries.options.views)
    describe_sources(training, tmp_path / "descriptors.npz", spec=DescriptorSpec(kind=words.kind()))
    train_dictionary(training, tmp_path / "words.npz", options=words)
    tokenize(training, tmp_path / "words.npz", tmp_path / "tokens")
    weigh = weigher([tmp_path / "tokens"], tmp_path / "words.npz", tmp_path / "descriptors.npz", ModelOptions())
    train_lm([tmp_path / "tokens"], tmp_path / "steps", weigh=weigh)
    learned, steps = files(tmp_path / "model"), files(tmp_path / "steps")
    assert learned.pop("words.npz") == (tmp_path / "words.npz").read_bytes()
    tokens = {name: learned.pop(name) for name in [*learned] if name.startswith("tokens/")}
    assert {name.removeprefix("tokens/"): data for name, data in tokens.items()} == files(tmp_path / "tokens")
    assert learned == steps


def test_a_model_with_its_words_decodes_images(tmp_path: Path, runs: list[Path]) -> None:
    learn(runs[:3], tmp_path / "model", words=WORDS)
    [alone] = decode([runs[3]], tmp_path / "model")
    [named] = decode([runs[3]], tmp_path / "model", words=tmp_path / "model/words.npz")
    assert alone.belief.tobytes() == named.belief.tobytes()
    [stream] = decode([tmp_path / "model/tokens/run1.tsv"], tmp_path / "model")
    assert len(stream) == 16


def test_tests_train_nothing_and_are_judged(tmp_path: Path, runs: list[Path]) -> None:
    found = learn([tmp_path / "runs"], tmp_path / "model", test=[runs[3]], words=WORDS)
    assert found.dictionaries.sequences == ("run0", "run1", "run2")
    assert found.evaluation is not None
    assert found.evaluation.frames == 16
    assert sorted(path.name for path in (tmp_path / "model/beliefs").iterdir()) == ["beliefs.json", "run3.tsv"]
    evidence = load_model(tmp_path / "model").description.evidence
    assert evidence == found.evidence
    assert evidence.words
    lines = format_learned(found).splitlines()
    assert [line.split()[0] for line in lines] == ["words", "places", "weights", "tests", "model"]
    assert "majority class 50.0 %" in lines[3]
    assert lines[0].endswith(" frames of 3 sequences; in brackets the log loss without a view")
    assert lines[3].endswith(" on 16 frames of 1 sequence")


def test_again_it_replaces_what_it_made(tmp_path: Path, runs: list[Path]) -> None:
    learn(runs[:3], tmp_path / "model", test=[runs[3]], words=WORDS)
    learn(runs[:3], tmp_path / "model", words=WORDS)
    first = files(tmp_path / "model")
    assert not (tmp_path / "model/beliefs").exists()
    learn(runs[:3], tmp_path / "model", words=WORDS)
    assert files(tmp_path / "model") == first


def test_what_it_cannot_learn_from_is_named(tmp_path: Path, runs: list[Path]) -> None:
    with pytest.raises(ModelError, match="every sequence is to be left out"):
        learn(runs[:1], tmp_path / "model", test=runs[:1], words=WORDS)
    for run in runs:
        (run / "localization/places.lst").unlink()
    with pytest.raises((ModelError, VisionError), match="no labelled frame found"):
        learn(runs, tmp_path / "model", words=WORDS)
    assert not (tmp_path / "model").exists()


def test_descriptors_that_lack_frames_are_refused(tmp_path: Path, runs: list[Path]) -> None:
    train_dictionary(runs[:3], tmp_path / "words.npz", options=WORDS)
    tokenize(runs[:3], tmp_path / "words.npz", tmp_path / "tokens")
    describe_sources(runs[:2], tmp_path / "two.npz")
    with pytest.raises(VisionError, match=r"two\.npz: has no rows for the sequence 'run2'"):
        weigher([tmp_path / "tokens"], tmp_path / "words.npz", tmp_path / "two.npz", ModelOptions())


def test_dictionaries_that_did_not_make_the_words_are_refused(tmp_path: Path, runs: list[Path]) -> None:
    for name, options in (("words", WORDS), ("others", replace(WORDS, seed=1))):
        train_dictionary(runs[:3], tmp_path / f"{name}.npz", options=options)
    tokenize(runs[:3], tmp_path / "words.npz", tmp_path / "tokens")
    describe_sources(runs[:3], tmp_path / "all.npz")
    with pytest.raises(
        VisionError, match=r"others\.npz: did not make the words in .*tokens; name the words\.npz that "
    ):
        weigher([tmp_path / "tokens"], tmp_path / "others.npz", tmp_path / "all.npz", ModelOptions())


def test_where_some_sequences_give_no_dictionary_that_is_said_and_nothing_is_weighed(
    tmp_path: Path, runs: list[Path], caplog: pytest.LogCaptureFixture
) -> None:
    (runs[1] / "localization/places.lst").unlink()
    words = replace(WORDS, views=("pn",))
    evidence = learn(runs[:2], tmp_path / "model", words=words).evidence
    assert (evidence.weights.alpha, evidence.weights.memory, evidence.weights.log_loss) == (1 / 2, 0.0, None)
    assert "the weight of words cannot be learned: without some of the sequences, the view pn cannot be" in caplog.text
