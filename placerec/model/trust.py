"""What a MODEL/ folder knows of how far to trust its recognizer: its calibration, and what speaks for a new place."""

import json
import logging
import math
from collections.abc import Mapping
from typing import Any

from placerec.errors import ModelError
from placerec.hohmm import Calibration
from placerec.hohmm.emissions import MARKERS
from placerec.hohmm.unknown import UnknownModel, unknown_model, word_runs
from placerec.model.decoding import Decoding, describe_decoding
from placerec.model.load import PlaceModels
from placerec.model.record import read_distances
from placerec.model.train import MODEL_JSON, PlaceFiles
from placerec.words import read_sentences

log = logging.getLogger(__name__)


def calibration_of(model: PlaceModels, options: Decoding) -> Calibration:
    """The calibration in model.json; ModelError if there is none, or none that can be used.

    If it was fitted with other options than `options`, a warning names them. It is no error, since a temperature
    changes no decision.
    """
    stored = _stored(model)
    if stored is None:
        raise ModelError(
            f"{model.path}: is not calibrated; run `placerec calibrate {model.path} TOKENS...` on labelled sequences "
            "that trained neither the words nor the model"
        )
    try:
        calibration = Calibration.from_json(stored)
    except ModelError as error:
        raise ModelError(f"{model.path / MODEL_JSON}: {error}") from error
    fitted, asked = stored.get("options"), describe_decoding(model, options)
    if fitted != asked:
        fitted = fitted if isinstance(fitted, Mapping) else {}
        differ = [name for name in asked if fitted.get(name) != asked[name]]
        was = ", ".join(f"{name} {json.dumps(fitted.get(name))}" for name in differ)
        log.warning("%s: was calibrated for other options (%s); calibrate with those of now", model.path, was)
    return calibration


def unknown_model_of(model: PlaceModels) -> UnknownModel:
    """What a place that is none of the model's is weighed with: its sentences, distances, and those of the calibration.

    Raises StreamError or ModelError for a folder without sentences, and for a model.json that holds no such numbers.
    """
    first = next(iter(model.models.values()))
    vocabulary = sum(word not in MARKERS for word in first.words)
    runs = word_runs([read_sentences(PlaceFiles.of(model.path, place).sentences) for place in model.models])
    histograms = read_distances(model.path / MODEL_JSON, model.description)
    return unknown_model(vocabulary, runs, histograms, measured=_measured(model))


def _measured(model: PlaceModels) -> tuple[float, float] | None:
    stored = (_stored(model) or {}).get("distances")
    if stored is None:
        return None
    try:
        shift, variance = float(stored["shift"]), float(stored["variance"])
    except (KeyError, TypeError, ValueError):
        shift = variance = math.nan
    if not (math.isfinite(shift) and 0 <= variance < math.inf):
        raise ModelError(
            f"{model.path / MODEL_JSON}: the calibration's distances are no shift and variance; "
            "run `placerec calibrate` again"
        )
    return shift, variance


def _stored(model: PlaceModels) -> Mapping[str, Any] | None:
    stored = model.description.get("calibration")
    if stored is not None and not isinstance(stored, Mapping):
        raise ModelError(f"{model.path / MODEL_JSON}: 'calibration' is none; run `placerec calibrate` again")
    return stored
