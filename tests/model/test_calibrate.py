"""Calibration of a model folder: what it is fitted on, what it leaves in model.json, what it refuses."""

import json
import logging
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import run_through, with_columns, write_world

from placerec.errors import ModelError, StreamError
from placerec.evaluation.metrics import evaluate
from placerec.hohmm import Calibration
from placerec.methods import decode
from placerec.model import Decoding, calibrate, load_model
from placerec.words import write_stream

STAY_09 = {
    "transition": "fixed",
    "stay": 0.9,
    "per": "update",
    "max_gap": None,
    "smooth": False,
    "lag": None,
}
NAMES = tuple(f"run{number}" for number in range(1, 6))


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Tokens of five runs, and a model of the first two."""
    return write_world(tmp_path, NAMES)


def described(model: Path) -> dict[str, Any]:
    description: dict[str, Any] = json.loads((model / "model.json").read_text())
    return description


def test_the_temperature_is_kept_with_what_it_was_fitted_on(world: Path) -> None:
    before = described(world / "model")
    found = calibrate(
        world / "model", [world / "tokens/run3.tsv", world / "tokens/run4.tsv"], options=Decoding(stay=0.9)
    )
    after = described(world / "model")
    kept = after.pop("calibration")
    before.pop("calibration", None)
    assert after == before
    assert Calibration.from_json(kept) == found
    assert (kept["options"], kept["sequences"], kept["frames"]) == (STAY_09, ["run3", "run4"], 120)
    load_model(world / "model")


def test_the_loss_is_that_of_what_decode_gives(world: Path) -> None:
    found = calibrate(world / "model", [world / "tokens/run3.tsv"])
    (beliefs,) = decode([world / "tokens/run3.tsv"], world / "model")
    assert evaluate([beliefs]).log_loss == pytest.approx(found.log_loss_before, rel=1e-5)
    calibrated = evaluate([replace(beliefs, belief=found.apply(beliefs.belief))])
    assert calibrated.log_loss == pytest.approx(found.log_loss_after, rel=1e-5)
    assert calibrated.log_loss <= found.log_loss_before + 1e-6
    assert calibrated.accuracy == evaluate([beliefs]).accuracy


def test_a_second_calibration_replaces_the_first(world: Path) -> None:
    calibrate(world / "model", [world / "tokens/run3.tsv"])
    first = (world / "model/model.json").read_bytes()
    calibrate(world / "model", [world / "tokens/run4.tsv"])
    assert described(world / "model")["calibration"]["sequences"] == ["run4"]
    calibrate(world / "model", [world / "tokens/run3.tsv"])
    assert (world / "model/model.json").read_bytes() == first


def test_distances_are_measured_where_training_had_them(world: Path) -> None:
    path = world / "model/model.json"
    description = described(world / "model")
    # Training: log2 distances of 0.0625 in all places. Held out: 2, an octave out, and one frame without.
    description["distances"] = {place: {"0": 5} for place in description["places"]}
    path.write_text(json.dumps(description))
    stream = run_through("run3", 2)
    write_stream(replace(stream, distances=np.array([np.nan, *[2.0] * 59])), world / "run3.tsv")
    calibrate(world / "model", [world / "run3.tsv"])
    measured = described(world / "model")["calibration"]["distances"]
    assert measured == pytest.approx({"shift": 1 - 1 / 16, "variance": 0})
    calibrate(world / "model", [world / "tokens/run4.tsv"])
    assert described(world / "model")["calibration"]["distances"] is None


@pytest.mark.parametrize("as_record", [False, True])
def test_training_sequences_are_refused_with_the_reason(world: Path, as_record: bool) -> None:
    path = world / "model/model.json"
    description = described(world / "model")
    listed = [{"name": name, "visits": {"hall": 2}} for name in ("run1", "run2")] if as_record else ["run1", "run2"]
    path.write_text(json.dumps(description | {"sequences": listed}))
    before = path.read_bytes()
    with pytest.raises(ModelError) as raised:
        calibrate(world / "model", [world / "tokens/run3.tsv", world / "tokens/run2.tsv"])
    assert str(raised.value) == (
        f"run2: trained the models of {world / 'model'}, which is surer of it than of anything new; "
        "calibrate on labelled sequences that trained neither the words nor the models"
    )
    assert path.read_bytes() == before


def test_sequences_that_trained_the_words_are_refused(world: Path) -> None:
    about = {"dictionary": "0" * 64, "trained_on": ["run1", "run3"]}
    (world / "tokens/tokens.json").write_text(json.dumps(about))
    with pytest.raises(ModelError, match=r"^run3: trained the words of "):
        calibrate(world / "model", [world / "tokens/run4.tsv", world / "tokens/run3.tsv"])
    calibrate(world / "model", [world / "tokens/run4.tsv"])
    (world / "tokens/tokens.json").write_text(json.dumps(about | {"trained_on": 3}))
    with pytest.raises(StreamError, match=r"tokens.json: is no description of tokens; tokenize again"):
        calibrate(world / "model", [world / "tokens/run4.tsv"])


def test_frames_without_a_known_label_are_left_out_and_counted(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    stream = run_through("run3", 2)
    places = ("", "", "attic", *stream.places[3:])
    write_stream(with_columns(stream, places=places), world / "run3.tsv")
    with caplog.at_level(logging.INFO, "placerec"):
        found = calibrate(world / "model", [world / "run3.tsv"])
    assert found.frames == 57
    assert "left out: 2 frames without a label, 1 frame of places that the model does not know" in caplog.messages


def test_no_labelled_frame_is_an_error(world: Path) -> None:
    stream = run_through("run3", 2)
    write_stream(with_columns(stream, places=None), world / "run3.tsv")
    with pytest.raises(ModelError, match=r"^run3: no frame is labelled with a place of .*; calibration needs labelled"):
        calibrate(world / "model", [world / "run3.tsv"])
    with pytest.raises(StreamError, match="no such file"):
        calibrate(world / "model", [world / "run9.tsv"])
    assert described(world / "model").get("calibration") is None


def test_decode_applies_it(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    model, run = world / "model", [world / "tokens/run5.tsv"]
    with pytest.raises(ModelError, match=r"model: is not calibrated; run `placerec calibrate .*model TOKENS\.\.\.` on"):
        decode(run, model, options=Decoding(calibrated=True))
    for options in (Decoding(), Decoding(smooth=True), Decoding(lag=3), Decoding(transition="learned")):
        found = calibrate(model, [world / "tokens/run3.tsv"], options=options)
        caplog.clear()
        for asked in (options, replace(options, viterbi=not options.looks_ahead)):
            (plain,), (applied,) = (
                decode(run, model, options=replace(asked, calibrated=calibrated)) for calibrated in (False, True)
            )
            assert np.array_equal(applied.belief, found.apply(plain.belief))
            assert applied.best == plain.best
        assert caplog.messages == []
    # The last one was for learned transitions.
    decode(run, model, options=Decoding(stay=0.9, calibrated=True))
    assert caplog.messages == [
        f'{model}: was calibrated for other options (transition "learned", stay null, per "frame"); '
        "calibrate with those of now"
    ]


def test_a_file_of_transitions_is_known_by_its_numbers(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    steps = world / "steps.tsv"
    steps.write_text("hall\tkitchen\toffice\n" + "0.8\t0.1\t0.1\n0.1\t0.8\t0.1\n0.1\t0.1\t0.8\n")
    calibrate(world / "model", [world / "tokens/run3.tsv"], options=Decoding(transition=steps))
    steps.rename(world / "moved.tsv")
    asked = Decoding(transition=world / "moved.tsv", calibrated=True)
    decode([world / "tokens/run5.tsv"], world / "model", options=asked)
    assert caplog.messages == []
    (world / "moved.tsv").write_text((world / "moved.tsv").read_text().replace("0.8\t0.1\t0.1", "0.7\t0.2\t0.1"))
    decode([world / "tokens/run5.tsv"], world / "model", options=asked)
    assert "was calibrated for other options (transition [[0.8, 0.1, 0.1], " in caplog.text


@pytest.mark.parametrize(
    ("kept", "message"),
    [
        (7, "model.json: 'calibration' is none; run `placerec calibrate` again"),
        ({}, "model.json: the calibration lacks or garbles 'temperature'; run `placerec calibrate` again"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_named(world: Path, kept: object, message: str) -> None:
    path = world / "model/model.json"
    path.write_text(json.dumps(described(world / "model") | {"calibration": kept}))
    with pytest.raises(ModelError, match=re.escape(message)):
        decode([world / "tokens/run5.tsv"], world / "model", options=Decoding(calibrated=True))
