"""A MODEL/ folder read back, broken ones named."""

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from helpers.small_world import PLACES, VOCABULARY, write_world

from placerec.errors import LanguageModelError, ModelError, PlacerecError
from placerec.model import Decoding, ModelOptions, load_model, load_recognizer, train_lm
from placerec.words import Selection


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Tokens of three runs, and a model of the first two."""
    return write_world(tmp_path)


def refused(message: str, model: Path, error: type[PlacerecError] = ModelError) -> None:
    with pytest.raises(error, match=re.escape(message)):
        load_recognizer(model)


def test_a_model_is_read_back(world: Path) -> None:
    train_lm([world / "tokens"], world / "model", options=ModelOptions(3, select=Selection("compress", 2)))
    model = load_model(world / "model")
    assert list(model.models) == list(PLACES)
    assert {one.order for one in model.models.values()} == {3}
    assert model.description.selection == Selection("compress", 2)
    assert load_recognizer(world / "model").places == PLACES


def test_missing_or_broken_model_files_are_named(world: Path) -> None:
    model = world / "model"
    refused("nothing: no such model folder; `placerec train-lm TOKENS... -o ", world / "nothing")
    refused("model.json: is a file, and the folder of a model is expected; name the folder", model / "model.json")
    whole = (model / "hall.arpa").read_text()
    (model / "hall.arpa").write_text(whole[: len(whole) // 2])
    refused("hall.arpa:", model, LanguageModelError)
    (model / "hall.arpa").write_text("")
    refused("hall.arpa:1: the file ends where an ARPA file", model, LanguageModelError)
    (model / "hall.arpa").unlink()
    refused("hall.arpa: missing, though model.json lists the place 'hall'; train the model again", model)
    (model / "model.json").unlink()
    refused("model.json: missing, so ", model)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "placerec model 9"}, "is not of the format 'placerec model 1'"),
        ({"places": None}, "'places' must list the names of places, each once"),
        ({"places": []}, "'places' must list the names of places, each once"),
        ({"places": "hall"}, "'places' must list the names of places, each once"),
        ({"places": ["hall", "hall"]}, "'places' must list the names of places, each once"),
        ({"places": ["../hall"]}, "place '../hall' starts with a dot"),
        ({"places": ["/hall"]}, "place '/hall' holds a /"),
        ({"select": 7}, "selection '7' is unknown"),
        ({"dictionary": 7}, "'dictionary' must be a fingerprint or null"),
    ],
)
def test_a_model_json_that_cannot_be_used_is_named(world: Path, change: dict[str, Any], message: str) -> None:
    path = world / "model/model.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ModelError, match=rf"model\.json: {re.escape(message)}.*; train the model again$"):
        load_model(world / "model")


@pytest.mark.parametrize("text", ["{", "", "[]", "7", "null", "{}"])
def test_a_model_json_that_is_none_is_named(world: Path, text: str) -> None:
    (world / "model/model.json").write_text(text)
    with pytest.raises(ModelError, match=r"model\.json: is n.*; train the model again$"):
        load_model(world / "model")


def test_models_of_two_vocabularies_are_refused(world: Path) -> None:
    path = world / "model/hall.arpa"
    path.write_text(path.read_text().replace("w05", "x05"))
    refused("w05", world / "model")


def test_unknown_scorers_and_probabilities_are_refused(world: Path) -> None:
    with pytest.raises(ModelError, match="scorer 'magic' is unknown; choose native or kenlm"):
        load_recognizer(world / "none", scorer="magic")  # type: ignore[arg-type]
    for stay in (-0.1, 1.1, math.nan):
        with pytest.raises(ModelError, match="is not between 0 and 1"):
            load_recognizer(world / "model", options=Decoding(stay=stay))


def test_all_words_are_known_to_the_recognizer(world: Path) -> None:
    recognizer = load_recognizer(world / "model")
    assert all(word in recognizer for word in VOCABULARY)
    assert not any(word in recognizer for word in ("", "zz", "<s>", "</s>", "<unk>"))
