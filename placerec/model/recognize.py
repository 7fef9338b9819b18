"""The recognizer of a MODEL/ folder."""

import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from placerec.errors import ModelError
from placerec.hohmm import Calibration, Emissions, Recognizer, SeparateEmissions
from placerec.hohmm.evidence import MARKERS
from placerec.hohmm.unknown import UnknownModel, unknown_model, word_runs
from placerec.lm.external import kenlm_scorer
from placerec.model.decoding import PAPER, Decoding, check_online, describe_decoding, transition_of
from placerec.model.folder import PlaceModels, load_model
from placerec.words import WordStream
from placerec.words.folder import check_dictionary, read_streams, stream_files

if TYPE_CHECKING:
    from placerec.vision import Dictionary

log = logging.getLogger(__name__)


def load_recognizer(
    path: Path | str,
    *,
    options: Decoding = PAPER,
    dictionary: "Dictionary | None" = None,
    scorer: str = "native",
) -> Recognizer:
    """The recognizer of a MODEL/ folder.

    `options`: its transitions, what ends a sequence, and what else is asked of it. `dictionary`: what turns images into
    words. `scorer`: `native`, or `kenlm` (MissingExtraError where it is not installed). Raises ModelError if the
    dictionary is not the one that made the training words, for options that need later words (give them to the
    recognizer's `decode`), and as `transition_of`, `calibration_of` and `unknown_model_of` do.
    """
    check_online(options)
    return make_recognizer(load_model(path), options=options, dictionary=dictionary, scorer=scorer)


def make_recognizer(
    model: PlaceModels,
    *,
    options: Decoding = PAPER,
    dictionary: "Dictionary | None" = None,
    scorer: str = "native",
    emissions: Emissions | None = None,
) -> Recognizer:
    """The recognizer of a model that is loaded; see `load_recognizer`. `emissions`: in place of the models' own."""
    check_words(model, dictionary)
    if scorer not in ("native", "kenlm"):
        raise ModelError(f"scorer {scorer!r} is unknown; choose native or kenlm")
    return Recognizer(
        model.models,
        selection=model.selection,
        transition=transition_of(model, options),
        dictionary=dictionary,
        max_gap=options.max_gap,
        emissions=_kenlm(model) if scorer == "kenlm" else emissions,
        calibration=calibration_of(model, options) if options.calibrated else None,
        unknown=unknown_model_of(model) if options.unknown else None,
        explain=options.explain,
    )


def check_words(model: PlaceModels, dictionary: "Dictionary | None") -> None:
    """Raise ModelError if `dictionary` is known not to be the one that made the words of `model`."""
    trained_on = model.description.dictionary
    if dictionary is not None and trained_on is not None and dictionary.fingerprint != trained_on:
        raise ModelError(
            f"{model.folder}: was trained on the words of another dictionary than the one given; "
            "give the words.npz of its training, or train it again"
        )


def token_streams(sources: Sequence[Path | str], model: PlaceModels) -> list[WordStream]:
    """The token streams that `sources` name; StreamError if they are in other words than those of `model`."""
    check_dictionary(stream_files(sources), model.description.dictionary, model.folder.path)
    return read_streams(sources)


def _kenlm(model: PlaceModels) -> SeparateEmissions:
    scorers = [kenlm_scorer(model.folder.place(place).arpa) for place in model.models]
    return SeparateEmissions(scorers, max(one.order for one in model.models.values()))


def calibration_of(model: PlaceModels, options: Decoding) -> Calibration:
    """The calibration in model.json; ModelError if there is none, or none that can be used.

    If it was fitted with other options than `options`, a warning names them. It is no error, since a temperature
    changes no decision.
    """
    stored = model.description.calibration
    if stored is None:
        raise ModelError(
            f"{model.folder}: is not calibrated; run `placerec calibrate {model.folder} TOKENS...` on labelled "
            "sequences that trained neither the words nor the model"
        )
    (calibration, fitted), asked = stored, describe_decoding(model, options)
    if fitted != asked:
        differ = [name for name in asked if fitted.get(name) != asked[name]]
        was = ", ".join(f"{name} {json.dumps(fitted.get(name))}" for name in differ)
        log.warning("%s: was calibrated for other options (%s); calibrate with those of now", model.folder, was)
    return calibration


def unknown_model_of(model: PlaceModels) -> UnknownModel:
    """What a place that is none of the model's is weighed with: its sentences, distances, and those of the calibration.

    Raises StreamError or ModelError for a folder without sentences, and for a model.json that holds no such numbers.
    """
    first = next(iter(model.models.values()))
    vocabulary = sum(word not in MARKERS for word in first.words)
    runs = word_runs(model.folder.sentences(list(model.models)).values())
    description = model.description
    return unknown_model(vocabulary, runs, description.distances, measured=description.measured_distances)
