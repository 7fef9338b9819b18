"""A MODEL/ folder, read back: a recognizer from its ARPA files."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from placerec.errors import ModelError, PlacerecError
from placerec.files import read_text
from placerec.hohmm import Recognizer, fixed_transition
from placerec.lm import BackoffModel, read_arpa
from placerec.lm.external import kenlm_scorer
from placerec.model.train import FORMAT
from placerec.words import Selection, parse_selection

if TYPE_CHECKING:
    from placerec.vision import Dictionary


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
    if not path.is_dir():
        raise ModelError(f"{path}: no such model folder; `placerec train-lm TOKENS... -o {path}` makes one")
    description = _read_description(path / "model.json")
    models = {}
    for place in description["places"]:
        arpa = path / f"{place}.arpa"
        if not arpa.exists():
            raise ModelError(f"{arpa}: missing, though model.json lists the place {place!r}; train the model again")
        models[place] = read_arpa(arpa)
    return PlaceModels(path, models, parse_selection(description["select"]), description)


def load_recognizer(
    path: Path | str, *, stay: float = 0.99, dictionary: "Dictionary | None" = None, scorer: str = "native"
) -> Recognizer:
    """The recognizer of a MODEL/ folder.

    `stay`: the probability of staying in a place at each selected word (p_e of the paper). `dictionary`: what turns
    images into words. `scorer`: `native`, or `kenlm` (MissingExtraError where it is not installed). Raises ModelError
    if the dictionary is not the one that made the training words.
    """
    model = load_model(path)
    trained_on = model.description["dictionary"]
    if dictionary is not None and trained_on is not None and dictionary.fingerprint != trained_on:
        raise ModelError(f"{path}: was trained on the words of another dictionary than the one given; tokenize again")
    if scorer not in ("native", "kenlm"):
        raise ModelError(f"scorer {scorer!r} is unknown; choose native or kenlm")
    scorers = {place: kenlm_scorer(model.path / f"{place}.arpa") for place in model.models} if scorer == "kenlm" else {}
    return Recognizer(
        model.models,
        selection=model.selection,
        transition=fixed_transition(len(model.models), stay),
        dictionary=dictionary,
        scorers=scorers,
    )


def _read_description(path: Path) -> dict[str, Any]:
    try:
        description = json.loads(read_text(path, ModelError))
        if description["format"] != FORMAT:
            raise ModelError(f"{path}: format {description['format']!r} is not {FORMAT!r}; train the model again")
        places = description["places"]
        if not places or not all(isinstance(place, str) and Path(place).name == place for place in places):
            raise ModelError(f"{path}: 'places' must list the names of places")
        parse_selection(description["select"])
        description["dictionary"]
    except PlacerecError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise ModelError(
            f"{path}: is no model description ({type(error).__name__}: {error}); train the model again"
        ) from error
    checked: dict[str, Any] = description
    return checked
