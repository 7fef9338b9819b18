"""What is read from a MODEL/ folder, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import PLACES, VOCABULARY, run_through, write_tokens
from helpers.training_sets import training_set_of

from placerec.errors import ModelError
from placerec.methods import make_training_set, read_training_set
from placerec.model import ModelOptions, load_model, train_lm
from placerec.words import place_steps, place_triples


@pytest.fixture
def tokens(tmp_path: Path) -> Path:
    return write_tokens(tmp_path / "tokens", ["run1", "run2"])


def test_a_lesson_is_what_was_trained_on(tokens: Path, tmp_path: Path) -> None:
    train_lm([tokens], tmp_path / "model")
    training = read_training_set(load_model(tmp_path / "model"))
    runs = [run_through("run1", 0), run_through("run2", 1)]
    assert (training.places, training.vocabulary) == (PLACES, VOCABULARY)
    assert [len(visits) for visits in training.sentences] == [4, 4, 4]
    for c, place in enumerate(PLACES):
        words = [word for run in runs for word, label in zip(run.words, run.places, strict=True) if label == place]
        assert [VOCABULARY[i] for visit in training.sentences[c] for i in visit] == words
        assert training.counts[c].tolist() == [words.count(word) for word in VOCABULARY]
    np.testing.assert_array_equal(training.steps, sum(place_steps(run, PLACES) for run in runs))
    np.testing.assert_array_equal(training.triples, sum(place_triples(run, PLACES) for run in runs))
    np.testing.assert_allclose(training.prior, 1 / 3)


@pytest.mark.parametrize(
    ("smoothing", "delta", "expected"),
    [("witten-bell", None, 1), ("absolute", 0.3, 1), ("lidstone", 0.3, 0.3), ("lidstone-backoff", None, 1)],
)
def test_the_delta_is_the_models_where_it_adds_one(
    smoothing: str, delta: float | None, expected: float, tokens: Path, tmp_path: Path
) -> None:
    train_lm([tokens], tmp_path / "model", options=ModelOptions(2, smoothing, delta))
    assert read_training_set(load_model(tmp_path / "model")).delta == expected


def test_sentences_tell_no_steps(tokens: Path, tmp_path: Path) -> None:
    train_lm([tokens], tmp_path / "model")
    train_lm([tmp_path / "model/sentences"], tmp_path / "other", vocabulary=tokens / "vocab.txt")
    training = read_training_set(load_model(tmp_path / "other"))
    assert (training.steps, training.triples) == (None, None)


def test_an_edited_folder_is_refused(tokens: Path, tmp_path: Path) -> None:
    train_lm([tokens], tmp_path / "model")
    path = tmp_path / "model/sentences/hall.txt"
    path.write_text(path.read_text() + "zz\n")
    with pytest.raises(ModelError, match="the word 'zz' of the sentences is not in the vocabulary"):
        read_training_set(load_model(tmp_path / "model"))


def test_an_empty_place_is_possible() -> None:
    training = training_set_of([[[0, 1]], []], 2)
    np.testing.assert_allclose(training.prior, [2.5 / 3, 0.5 / 3])
    assert make_training_set({"a": []}, ["w"]).prior.tolist() == [1]
