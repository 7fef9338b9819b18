"""Calibration of a MODEL/ folder on labelled sequences that trained nothing of it."""

import logging
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError, counted
from placerec.files import held_folder
from placerec.hohmm import Beliefs
from placerec.hohmm.calibration import Calibration, fit_calibration
from placerec.hohmm.unknown import measure_distances
from placerec.model.decoding import AS_LEARNED, Decoding, describe_decoding, make_recognizer, token_streams
from placerec.model.folder import PlaceModels, load_model
from placerec.words import WordStream
from placerec.words.folder import TokenMaker, dictionary_of, stream_files
from placerec.words.stream import column_of

log = logging.getLogger(__name__)


def calibrate(model: Path | str, tokens: Sequence[Path | str], *, options: Decoding = AS_LEARNED) -> Calibration:
    """`placerec calibrate`: fit a temperature to the beliefs in labelled `tokens`, and keep it in model.json.

    `options`: the calibration holds for decoding with these. Frames without a label, and those of
    places that the model does not know, are left out and counted. Raises ModelError for sequences that trained the
    model, and if no frame is left; model.json is then as it was.
    """
    path = Path(model)
    with held_folder(path) if path.is_dir() else nullcontext():
        models = load_model(path)
        streams = token_streams(tokens, models)
        _refuse_training(models, dictionary_of(stream_files(tokens)), streams)
        recognizer = make_recognizer(models, options=options)
        decoded = [recognizer.decode(stream, smooth=options.smooth, lag=options.lag) for stream in streams]
        calibration = fit_calibration(*_judged(models, decoded))
        models.description.write(
            calibration={
                **vars(calibration),
                **_measured(models, streams),
                "options": describe_decoding(models, options),
                "sequences": [stream.name for stream in streams],
            }
        )
    losses = calibration.log_loss_before, calibration.log_loss_after
    log.info("%s: temperature %g, log loss %.3f -> %.3f on these frames", model, calibration.temperature, *losses)
    return calibration


def _refuse_training(models: PlaceModels, maker: TokenMaker | None, streams: Sequence[WordStream]) -> None:
    trained = models.description.trained_on
    seen = maker.trained_on if maker else frozenset()
    for stream in streams:
        if stream.name in trained or stream.name in seen:
            what = "models" if stream.name in trained else "words"
            raise ModelError(
                f"{stream.name}: trained the {what} of {models.folder}, which is surer of it than of anything new; "
                "calibrate on labelled sequences that trained neither the words nor the models"
            )


def _judged(models: PlaceModels, decoded: Sequence[Beliefs]) -> tuple[Floats, Ints]:
    """The beliefs (n, C) of all frames that are labelled with a place of the model, and its column (n,)."""
    labels = [label for beliefs in decoded for label in beliefs.truth]
    truth = _columns(models, labels)
    usable = truth >= 0
    unlabelled, strange = labels.count(""), int((~usable).sum()) - labels.count("")
    left_out = [f"{counted(unlabelled, 'frame')} without a label"] if unlabelled else []
    left_out += [f"{counted(strange, 'frame')} of places that the model does not know"] if strange else []
    if left_out:
        log.info("left out: %s", ", ".join(left_out))
    if not usable.any():
        names = ", ".join(beliefs.name for beliefs in decoded[:3]) + (", ..." if len(decoded) > 3 else "")
        raise ModelError(
            f"{names}: no frame is labelled with a place of {models.folder}; calibration needs labelled sequences"
        )
    return np.concatenate([beliefs.belief for beliefs in decoded])[usable], truth[usable]


def _columns(models: PlaceModels, labels: Sequence[str]) -> Ints:
    column = {place: number for number, place in enumerate(models.models)}
    return np.array([column.get(label, -1) for label in labels], dtype=np.int64)


def _measured(models: PlaceModels, streams: Sequence[WordStream]) -> dict[str, dict[str, float] | None]:
    """How the distances of these frames differ from those in training, for `unknown`, as model.json names them.

    None for a dictionary without distances.
    """
    truth = _columns(models, [label for stream in streams for label in stream.places])
    found: dict[str, dict[str, float] | None] = {}
    for name, one in models.dictionaries.items():
        histograms, measured = one.description.distances, None
        own = [stream.in_dictionary(name) for stream in streams if name in stream.dictionaries]
        if histograms and len(own) == len(streams):
            distances = np.concatenate([stream.distances for stream in own])
            measured = measure_distances(distances[truth >= 0], truth[truth >= 0], histograms)
        title = column_of(name).replace("word", "distances")
        found[title] = measured and dict(zip(("shift", "variance"), measured, strict=True))
    return found
