"""A MODEL/ folder, read back."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from placerec.errors import ModelError, PlacerecError
from placerec.files import read_text
from placerec.frames.places import check_place
from placerec.lm import BackoffModel, read_arpa
from placerec.model.train import FORMAT
from placerec.words import Selection, parse_selection


@dataclass(frozen=True)
class PlaceModels:
    """The language models of a MODEL/ folder, one per place in order, and what model.json says of them."""

    path: Path
    models: Mapping[str, BackoffModel] = field(repr=False)
    selection: Selection
    description: Mapping[str, Any] = field(repr=False)


def load_model(path: Path | str) -> PlaceModels:
    """Read a MODEL/ folder; ModelError or LanguageModelError, naming the file, for anything missing or broken."""
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise ModelError(f"{path}: is a file, and the folder of a model is expected; name the folder")
    if not path.exists():
        raise ModelError(f"{path}: no such model folder; `placerec train-lm TOKENS... -o {path}` makes one")
    description = read_description(path / "model.json")
    models = {}
    for place in description["places"]:
        arpa = path / f"{place}.arpa"
        if not arpa.exists():
            raise ModelError(f"{arpa}: missing, though model.json lists the place {place!r}; train the model again")
        models[place] = read_arpa(arpa)
    return PlaceModels(path, models, parse_selection(description["select"]), description)


def read_description(path: Path) -> dict[str, Any]:
    """What model.json says; ModelError unless everything that `load_model` uses is there and usable."""
    remedy = "train the model again"
    if not path.exists():
        raise ModelError(f"{path}: missing, so {path.parent} is no model of train-lm; {remedy}")
    try:
        description = json.loads(read_text(path, ModelError))
    except ValueError as error:
        raise ModelError(f"{path}: is no JSON ({error}); {remedy}") from error
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise ModelError(f"{path}: is not of the format {FORMAT!r}; {remedy}")
    places, dictionary = description.get("places"), description.get("dictionary", 0)
    if not isinstance(places, list) or not places or len(set(map(str, places))) < len(places):
        raise ModelError(f"{path}: 'places' must list the names of places, each once; {remedy}")
    for place in places:
        if reason := check_place(str(place)):
            raise ModelError(f"{path}: place {place!r} {reason}; {remedy}")
    if dictionary is not None and not isinstance(dictionary, str):
        raise ModelError(f"{path}: 'dictionary' must be a fingerprint or null; {remedy}")
    try:
        parse_selection(str(description.get("select")))
    except PlacerecError as error:
        raise ModelError(f"{path}: {error}; {remedy}") from error
    return description
