"""`decode --unknown`: what it reads of a MODEL/ folder, and that files and streams give the same numbers."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import run_through, write_tokens

from placerec.errors import ModelError, StreamError
from placerec.hohmm import format_beliefs, read_beliefs
from placerec.methods import decode, decode_lines
from placerec.model import Decoding, calibrate, load_model, load_recognizer, train_lm, update
from placerec.model.decoding import unknown_models_of
from placerec.words import WordStream, read_stream, write_stream

ASKED = Decoding(unknown=True)


def with_distances(stream: WordStream, seed: int, scale: float = 1.0) -> WordStream:
    rng = np.random.default_rng(seed)
    return replace(stream, distances=scale * 2 ** rng.normal(0, 0.3, len(stream)))


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Tokens of four runs with distances, the last one twice as far out, and a model of the first two."""
    write_tokens(tmp_path / "tokens")
    for seed, name in enumerate(("run1", "run2", "run3", "far")):
        stream = with_distances(run_through(name, seed), seed, 3.0 if name == "far" else 1.0)
        write_stream(stream, tmp_path / f"tokens/{name}.tsv")
    train_lm([tmp_path / "tokens/run1.tsv", tmp_path / "tokens/run2.tsv"], tmp_path / "model", as_in_paper=True)
    return tmp_path


def unknown(world: Path, name: str, options: Decoding = ASKED) -> Any:
    (found,) = decode([world / f"tokens/{name}.tsv"], world / "model", options=options)
    assert found.unknown is not None
    return found.unknown


def changed(world: Path, **values: object) -> None:
    path = world / "model/model.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_the_column_stands_beside_the_places(world: Path) -> None:
    run = [world / "tokens/far.tsv"]
    (found,), (plain,) = (
        decode(run, world / "model", out=world / "b", options=options) for options in (ASKED, Decoding())
    )
    assert plain.unknown is None
    assert np.array_equal(found.belief, plain.belief)
    decode(run, world / "model", out=world / "b", options=ASKED)
    again = read_beliefs(world / "b/far.tsv")
    assert again.best == found.best
    assert again.unknown == pytest.approx(found.unknown, rel=1e-8)
    lines = format_beliefs(found, as_json=True).splitlines()
    assert [json.loads(line)["unknown"] for line in lines] == found.unknown.tolist()  # type: ignore[union-attr]
    assert "unknown" not in json.loads(format_beliefs(plain, as_json=True).splitlines()[0])


def test_frames_that_lie_far_out_are_new(world: Path) -> None:
    assert unknown(world, "far").mean() > 0.9
    assert unknown(world, "run3").mean() < 0.2
    # A model without distances takes none of the stream's, and a stream without them none of the model's.
    bare = replace(read_stream(world / "tokens/far.tsv"), distances=np.full(60, np.nan))
    write_stream(bare, world / "tokens/bare.tsv")
    words_alone = unknown(world, "bare")
    changed(world, distances=None)
    assert np.array_equal(unknown(world, "far"), words_alone)


def test_a_stream_is_answered_as_the_file_is(world: Path) -> None:
    for name in ("run3", "far"):
        stream = read_stream(world / f"tokens/{name}.tsv")
        rows = zip(stream.words, stream.times.tolist(), stream.distances.tolist(), strict=True)
        text = "".join(f"{word}\t{time}\t{far}\n" for word, time, far in rows)
        lines = list(decode_lines(load_recognizer(world / "model", options=ASKED), io.StringIO(text)))
        assert lines[0].split("\t")[-1] == "unknown"
        assert [float(line.split("\t")[-1]) for line in lines[1:]] == pytest.approx(unknown(world, name), abs=1e-8)


def test_a_stream_may_leave_out_what_it_does_not_know(world: Path) -> None:
    recognizer = load_recognizer(world / "model", options=ASKED)
    answers = list(decode_lines(recognizer, io.StringIO("w01\t\t9\nw01\t2\t\nw01\t3\n"), as_json=True))
    first, second, third = (json.loads(line) for line in answers)
    assert first["time"] is None
    assert first["unknown"] > 0.5
    assert second["unknown"] != third["unknown"]
    recognizer.reset()
    for line, message in (
        ("w01\t1\tfar\n", "<stdin>:1: distance 'far' is not a number"),
        ("w01\t1\t2\t3\n", "<stdin>:1: 4 fields; word, seconds and distance are expected"),
    ):
        with pytest.raises(StreamError, match=re.escape(message)):
            list(decode_lines(recognizer, io.StringIO(line)))


def test_after_an_update_it_is_that_of_training_on_all(world: Path) -> None:
    update(world / "model", [world / "tokens/run3.tsv"])
    learned = unknown(world, "far")
    train_lm([world / f"tokens/run{number}.tsv" for number in (1, 2, 3)], world / "model", as_in_paper=True)
    assert np.array_equal(unknown(world, "far"), learned)


def test_what_calibrate_measured_replaces_the_estimate(world: Path) -> None:
    estimated = unknown(world, "far")
    calibrate(world / "model", [world / "tokens/far.tsv"])
    (model,) = unknown_models_of(load_model(world / "model"))
    stored = json.loads((world / "model/model.json").read_text())["calibration"]["distances"]
    assert model.distance is not None
    assert model.distance.variance == pytest.approx(stored["variance"] + 0.09)
    # Known frames were seen to lie that far out.
    assert unknown(world, "far").mean() < 0.2 < estimated.mean()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"distances": {"hall": {"0": -1}}},
            "model.json: 'distances' holds no numbers of frames; train the model again",
        ),
        ({"distances": 7}, "model.json: 'distances' holds no numbers of frames; train the model again"),
        ({"calibration": {"distances": {"shift": "far"}}}, "model.json: the calibration's distances are no shift"),
    ],
)
def test_a_model_json_that_cannot_be_used_is_named(world: Path, values: dict[str, Any], message: str) -> None:
    changed(world, **values)
    with pytest.raises(ModelError, match=re.escape(message)):
        unknown(world, "run3")


def test_without_sentences_the_file_is_named(world: Path) -> None:
    (world / "model/sentences/hall.txt").unlink()
    with pytest.raises(StreamError, match=r"sentences/hall\.txt: no such file"):
        unknown(world, "run3")
