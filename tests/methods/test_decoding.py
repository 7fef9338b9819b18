"""The options of decoding: what they do to the beliefs of files and streams, and which exclude each other."""

import io
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import PLACES, write_world

from placerec.errors import ModelError, StreamError
from placerec.hohmm import fixed_transition, learned_transition
from placerec.methods import decode, decode_lines, load_decoder
from placerec.model import Decoding, load_model, load_recognizer, train_lm, transition_of
from placerec.words import parse_selection, read_stream


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Tokens of three runs, and a model of the first two."""
    return write_world(tmp_path, select=parse_selection("unique"))


def belief(world: Path, options: Decoding) -> np.ndarray[Any, np.dtype[np.float64]]:
    (found,) = decode([world / "tokens/run3.tsv"], world / "model", options=options)
    return found.belief


def test_without_options_it_is_the_paper(world: Path) -> None:
    paper = Decoding(transition="fixed", stay=0.99, per="update")
    assert np.array_equal(belief(world, Decoding()), belief(world, paper))
    assert not np.allclose(belief(world, Decoding()), belief(world, Decoding(stay=0.9)))


def test_learned_transitions_are_those_of_the_training(world: Path) -> None:
    model = load_model(world / "model")
    learned = transition_of(model, Decoding(transition="learned"))
    assert learned.per == "frame"
    # Two runs, each with two visits of ten frames to each place in turn.
    assert np.array_equal(learned.matrix, learned_transition([[36, 4, 0], [0, 36, 4], [2, 0, 36]]).matrix)
    rows = "\n".join("\t".join(repr(p) for p in row) for row in learned.matrix.tolist())
    (world / "steps.tsv").write_text("\t".join(PLACES) + "\n" + rows)
    from_file = Decoding(transition=world / "steps.tsv", per="frame")
    expected = belief(world, Decoding(transition="learned"))
    assert belief(world, from_file) == pytest.approx(expected, abs=1e-12)
    assert not np.allclose(belief(world, Decoding(transition=from_file.transition)), expected)


def test_a_model_that_did_not_see_sequences_cannot_have_learned(world: Path) -> None:
    path = world / "model/model.json"
    train_lm([world / "model/sentences"], world / "other", vocabulary=world / "tokens/vocab.txt")
    learned = Decoding(transition="learned")
    with pytest.raises(ModelError, match=r"other: was trained on sentences, .*; train it on token streams, or "):
        decode([world / "tokens/run3.tsv"], world / "other", options=learned)
    description = json.loads(path.read_text())
    for broken in ({"counts": [[1, 2], [3, 4]], "triples": []}, {"counts": [[1, 2, -3]] * 3, "triples": []}, 7, None):
        path.write_text(json.dumps(description | {"transitions": broken}))
        belief(world, Decoding())
        with pytest.raises(ModelError, match=r"model\.json: does not say .*; train the model again"):
            belief(world, learned)
    del description["transitions"]
    path.write_text(json.dumps(description))
    with pytest.raises(ModelError, match=r"model\.json: does not say .*; train the model again"):
        belief(world, learned)


def test_names_that_do_not_exist_are_refused_at_once(world: Path) -> None:
    with pytest.raises(ModelError, match=r"^leraned: no such file; transitions are fixed, learned, or a file"):
        Decoding(transition="leraned")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="per 'hour' is unknown; choose one of update, frame, second"):
        Decoding(per="hour")  # type: ignore[arg-type]
    # Before a model is read.
    for call in (
        lambda: decode([world / "none.tsv"], world / "none", scorer="srilm"),  # type: ignore[arg-type]
        lambda: load_decoder("wu2009", world / "none", scorer="srilm"),  # type: ignore[arg-type]
    ):
        with pytest.raises(ModelError, match="scorer 'srilm' is unknown; choose native or kenlm"):
            call()


def test_per_second_follows_the_clock(world: Path) -> None:
    # The frames of the small world are half a second apart.
    seconds = belief(world, Decoding(stay=0.9, per="second"))
    half = fixed_transition(3, 0.9, "second").over(0.5)
    assert belief(world, Decoding(stay=float(half[0, 0]), per="frame")) == pytest.approx(seconds, abs=1e-12)
    (world / "plain.txt").write_text("w01 w02")
    for options in (Decoding(per="second"), Decoding(max_gap=1)):
        with pytest.raises(StreamError, match=r"^plain: frame '0' has no time, which "):
            decode([world / "plain.txt"], world / "model", options=options)


def test_a_gap_ends_a_sequence(world: Path) -> None:
    whole = (world / "tokens/run3.tsv").read_text().splitlines()
    later = [line.split("\t") for line in whole[31:]]
    moved = ["\t".join([name, str(float(time) + 60), *rest]) for name, time, *rest in later]
    (world / "gap.tsv").write_text("\n".join([*whole[:31], *moved]) + "\n")
    (world / "late.tsv").write_text("\n".join([whole[0], *moved]) + "\n")
    (gap,) = decode([world / "gap.tsv"], world / "model", options=Decoding(max_gap=30))
    (late,) = decode([world / "late.tsv"], world / "model")
    assert np.array_equal(gap.belief[30:], late.belief)
    assert np.array_equal(gap.belief[:30], belief(world, Decoding())[:30])


@pytest.mark.parametrize(
    "options",
    [
        Decoding(),
        Decoding(stay=0.8, per="frame"),
        Decoding(stay=0.8, per="second", max_gap=0.6),
        Decoding(transition="learned"),
    ],
)
def test_a_stream_is_answered_as_the_file_is(world: Path, options: Decoding) -> None:
    stream = read_stream(world / "tokens/run3.tsv")
    # A word that the models do not list and a blank line, with a gap before them.
    words = [*stream.words, "zz", "", *stream.words[:9]]
    times = np.arange(len(words)) / 2 + np.where(np.arange(len(words)) > 40, 5.0, 0.0)
    rows = zip(words, times.tolist(), strict=True)
    lines = list(
        decode_lines(
            load_recognizer(world / "model", options=options),
            io.StringIO("".join(f"{word}\t{time}\n" for word, time in rows)),
        )
    )
    table = "".join(f"{word or 'yy'}\t{time}\n" for word, time in zip(words, times.tolist(), strict=True))
    (world / "run.tsv").write_text("word\ttime\n" + table)
    (batch,) = decode([world / "run.tsv"], world / "model", options=options)
    online = np.array([[float(cell) for cell in line.split("\t")[6:]] for line in lines[1:]])
    assert online == pytest.approx(batch.belief, abs=1e-8)


def test_a_stream_without_its_times_is_refused_by_line(world: Path) -> None:
    recognizer = load_recognizer(world / "model", options=Decoding(per="second"))
    with pytest.raises(StreamError, match=r"^<stdin>:2: the frame has no time, which "):
        list(decode_lines(recognizer, io.StringIO("w01\t1\nw02\n")))
    recognizer.reset()
    with pytest.raises(StreamError, match=r"^<stdin>:2: time goes back from 2\.000000 to 1\.000000 s"):
        list(decode_lines(recognizer, io.StringIO("w01\t2\nw02\t1\n")))


def test_later_words_count_when_they_are_asked_to(world: Path) -> None:
    (plain,) = decode([world / "tokens/run3.tsv"], world / "model")
    (path,) = decode([world / "tokens/run3.tsv"], world / "model", options=Decoding(viterbi=True))
    assert np.array_equal(path.belief, plain.belief)
    assert path.best != plain.best
    smoothed, lagged = belief(world, Decoding(smooth=True)), belief(world, Decoding(lag=5))
    assert np.array_equal(belief(world, Decoding(lag=0)).argmax(axis=1), plain.belief.argmax(axis=1))
    assert belief(world, Decoding(lag=60)) == pytest.approx(smoothed, abs=1e-12)
    assert not np.allclose(smoothed, lagged)
    assert not np.allclose(plain.belief, lagged)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transition": "learned", "stay": 0.9}, "learned transitions are per frame: they take neither"),
        ({"transition": "learned", "per": "frame"}, "learned transitions are per frame: they take neither"),
        ({"transition": "a.tsv", "stay": 0.9}, "a.tsv: transitions of a file take no stay probability"),
        ({"transition": "a.tsv", "per": "second"}, "a.tsv: transitions of a file cannot be per second"),
        ({"max_gap": 0.0}, "largest gap 0 s is not above 0"),
        ({"max_gap": float("nan")}, "largest gap nan s is not above 0"),
        ({"lag": -1}, "lag -1 is below 0"),
        ({"smooth": True, "viterbi": True}, "of smooth, viterbi and lag only one can be asked for"),
        ({"smooth": True, "lag": 0}, "of smooth, viterbi and lag only one can be asked for"),
        ({"viterbi": True, "lag": 3}, "of smooth, viterbi and lag only one can be asked for"),
    ],
)
def test_options_that_exclude_each_other(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=re.escape(message)):
        Decoding(**options)


@pytest.mark.parametrize("options", [Decoding(smooth=True), Decoding(viterbi=True), Decoding(lag=1)])
def test_a_recognizer_does_not_ignore_what_needs_later_words(world: Path, options: Decoding) -> None:
    for load in (load_recognizer, partial(load_decoder, "hohmm"), partial(load_decoder, "wu2009")):
        with pytest.raises(ModelError, match=r"^(smooth|viterbi|lag) needs later words, and a recognizer "):
            load(world / "model", options=options)


def test_a_recognizer_that_is_asked_to_explains_its_last_word(world: Path) -> None:
    recognizer = load_recognizer(world / "model", options=Decoding(explain=True))
    recognizer.update("w01")
    decision = recognizer.explain()
    assert (decision["word"], list(decision["places"])) == ("w01", list(PLACES))
