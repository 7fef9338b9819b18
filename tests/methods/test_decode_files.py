"""Decoding: files, streams of lines, and what they refuse."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import PLACES, with_columns, write_world

from placerec.errors import ModelError, OutputError, StreamError
from placerec.hohmm import format_beliefs, read_beliefs
from placerec.methods import decode, decode_lines
from placerec.model import Decoding, ModelOptions, load_recognizer, train_lm
from placerec.words import Selection, parse_selection, read_stream, write_stream


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Tokens of three runs, and a model of the first two."""
    return write_world(tmp_path)


def test_selection_is_applied_at_test_too(world: Path) -> None:
    train_lm(
        [world / "tokens"], world / "model", options=ModelOptions(select=Selection("subsample", 3)), as_in_paper=True
    )
    (beliefs,) = decode([world / "tokens/run3.tsv"], world / "model")
    assert beliefs.selected.tolist() == [i % 3 == 0 for i in range(60)]
    assert (beliefs.belief[1] == beliefs.belief[0]).all()


def test_decoding_writes_what_it_returns(world: Path) -> None:
    found = decode([world / "tokens"], world / "model", out=world / "beliefs")
    assert [beliefs.name for beliefs in found] == ["run1", "run2", "run3"]
    assert sorted(path.name for path in (world / "beliefs").iterdir()) == [
        "beliefs.json",
        "run1.tsv",
        "run2.tsv",
        "run3.tsv",
    ]
    for beliefs in found:
        again = read_beliefs(world / f"beliefs/{beliefs.name}.tsv")
        assert again.truth == beliefs.truth
        assert again.best == beliefs.best
        np.testing.assert_allclose(again.belief, beliefs.belief, rtol=1e-8)


def test_kenlm_gives_the_same_beliefs(world: Path) -> None:
    pytest.importorskip("kenlm")
    (native,) = decode([world / "tokens/run3.tsv"], world / "model")
    (kenlm,) = decode([world / "tokens/run3.tsv"], world / "model", scorer="kenlm")
    np.testing.assert_allclose(kenlm.belief, native.belief, atol=1e-5)


def test_a_plain_text_of_words_is_decoded(world: Path) -> None:
    stream = read_stream(world / "tokens/run3.tsv")
    (world / "plain.txt").write_text(" ".join(stream.words))
    (plain,), (tokens,) = (decode([world / name], world / "model") for name in ("plain.txt", "tokens/run3.tsv"))
    assert (plain.belief == tokens.belief).all()
    assert set(plain.truth) == {""}


def test_words_that_the_models_lack_are_skipped_and_counted(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    (world / "plain.txt").write_text("w01 zz w02 yy")
    (beliefs,) = decode([world / "plain.txt"], world / "model")
    assert beliefs.selected.tolist() == [True, False, True, False]
    assert "plain: words that the models do not list: 2 skipped, 'zz' first" in caplog.text


def test_several_sequences_need_a_folder(world: Path) -> None:
    with pytest.raises(ModelError, match="3 sequences to decode: name a folder for their beliefs with -o"):
        decode([world / "tokens"], world / "model")


def test_what_is_decoded_is_not_written_over(world: Path) -> None:
    (world / "only").mkdir()
    (world / "tokens/run3.tsv").rename(world / "only/run3.tsv")
    for source in (world / "only", world / "only/run3.tsv"):
        with pytest.raises(OutputError, match=r"only: holds what is to be decoded \(.*\); name another folder"):
            decode([source], world / "model", out=world / "only")
    assert (world / "only/run3.tsv").read_text().startswith("frame\ttime\tplace\tword\tdistance\n")


def test_a_failure_leaves_the_old_beliefs(world: Path) -> None:
    decode([world / "tokens/run3.tsv"], world / "model", out=world / "beliefs")
    (world / "bad.tsv").write_text("time\tword\nsoon\tw01\n")
    with pytest.raises(StreamError, match=r"bad\.tsv:2: time 'soon' is not a number"):
        decode([world / "bad.tsv"], world / "model", out=world / "beliefs")
    assert sorted(path.name for path in (world / "beliefs").iterdir()) == ["beliefs.json", "run3.tsv"]


def test_tokens_of_another_dictionary_are_refused(world: Path) -> None:
    model, tokens = world / "model/model.json", world / "tokens/tokens.json"
    model.write_text(json.dumps(json.loads(model.read_text()) | {"dictionary": "f00"}))
    decode([world / "tokens/run3.tsv"], world / "model")
    tokens.write_text('{"dictionary": "f00"}')
    decode([world / "tokens/run3.tsv"], world / "model")
    tokens.write_text('{"dictionary": "ba4"}')
    with pytest.raises(
        StreamError, match=r"tokens: its words are of another dictionary than those that trained .*model"
    ):
        decode([world / "tokens/run3.tsv"], world / "model")


def lines_of(world: Path, text: str, *, as_json: bool = False) -> list[str]:
    return list(decode_lines(load_recognizer(world / "model"), io.StringIO(text), as_json=as_json))


@pytest.mark.parametrize("rule", ["none", "subsample:3", "compress:2", "unique"])
def test_a_stream_is_answered_as_the_file_is(world: Path, rule: str) -> None:
    options = ModelOptions(3, select=parse_selection(rule))
    train_lm([world / "tokens/run1.tsv", world / "tokens/run2.tsv"], world / "model", options=options, as_in_paper=True)
    stream = read_stream(world / "tokens/run3.tsv")
    text = "".join(f"{word}\t{time}\n" for word, time in zip(stream.words, stream.times, strict=True))
    (beliefs,) = decode([world / "tokens/run3.tsv"], world / "model")
    expected = [line.split("\t") for line in format_beliefs(beliefs).splitlines()]
    found = [line.split("\t") for line in lines_of(world, text)]
    # The place is not known to the stream; everything else is the same, digit for digit.
    assert found == [[*fields[:2], "" if i else "place", *fields[3:]] for i, fields in enumerate(expected)]
    assert len(found) == 61


def test_every_line_is_answered_before_the_next_is_read(world: Path) -> None:
    read: list[str] = []

    def slowly() -> Any:
        for line in ("w01\n", "w02\n"):
            read.append(line)
            yield line

    answers = decode_lines(load_recognizer(world / "model"), slowly())
    assert next(answers) == "\t".join(["frame", "time", "place", "word", "selected", "best", *PLACES])
    assert read == []
    next(answers)
    assert read == ["w01\n"]


def test_unknown_words_and_blank_lines_hold_the_belief(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = [line.split("\t") for line in lines_of(world, "\ufeffw01\r\nzz\n\nw02\t2.5\r\n")]
    assert [fields[0] for fields in found[1:]] == ["0", "1", "2", "3"]
    assert [fields[3:5] for fields in found[1:]] == [["w01", "1"], ["zz", "0"], ["", "0"], ["w02", "1"]]
    assert found[1][6:] == found[2][6:] == found[3][6:] != found[4][6:]
    assert found[4][1] == "2.5"
    assert [record.getMessage() for record in caplog.records] == [
        "<stdin>:2: the word 'zz' is not in the models' vocabulary; skipped",
        "<stdin>: lines skipped because the models do not list their word: 2",
    ]


@pytest.mark.parametrize("seconds", ["soon", "nan", "inf", "1e999"])
def test_seconds_that_are_no_number_are_named_by_line(world: Path, seconds: str) -> None:
    with pytest.raises(StreamError, match=r"<stdin>:2: time '.*' is not a number of seconds"):
        lines_of(world, f"w01\t1\nw01\t{seconds}\n")


def test_json_lines_are_json(world: Path) -> None:
    objects = [json.loads(line) for line in lines_of(world, "w01\nw02\t2\nzz\n", as_json=True)]
    assert [one["frame"] for one in objects] == ["0", "1", "2"]
    assert [one["time"] for one in objects] == [None, 2.0, None]
    assert [one["selected"] for one in objects] == [True, True, False]
    for one in objects:
        assert list(one["belief"]) == list(PLACES)
        assert sum(one["belief"].values()) == pytest.approx(1)
        assert one["best"] == max(one["belief"], key=one["belief"].get)


def test_json_files_are_json_lines(world: Path) -> None:
    decode([world / "tokens"], world / "model", out=world / "beliefs", as_json=True)
    assert sorted(path.name for path in (world / "beliefs").iterdir()) == [
        "beliefs.json",
        "run1.jsonl",
        "run2.jsonl",
        "run3.jsonl",
    ]
    for line in (world / "beliefs/run1.jsonl").read_text().splitlines():
        assert json.loads(line, parse_constant=pytest.fail)["place"] in PLACES


def test_sequences_that_trained_are_named_if_they_have_labels(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    tokens = [world / f"tokens/run{i}.tsv" for i in (1, 2, 3)]
    decode(tokens, world / "model", out=world / "beliefs")
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [
        "run1, run2: trained the models, and tells nothing of what is new to them; test on others"
    ]
    caplog.clear()
    made = {"dictionary": "0" * 64, "trained_on": ["run3"]}
    (world / "tokens/tokens.json").write_text(json.dumps(made), encoding="utf-8")
    decode(tokens[2:], world / "model")
    assert "run3: trained the words" in caplog.text
    caplog.clear()
    stream = read_stream(tokens[0])
    write_stream(with_columns(stream, places=[""] * len(stream)), tokens[0])
    decode(tokens[:1], world / "model")
    assert not caplog.records


@pytest.mark.parametrize("unknown", [False, True])
def test_labels_that_the_models_do_not_know_are_told(
    world: Path, unknown: bool, caplog: pytest.LogCaptureFixture
) -> None:
    stream = read_stream(world / "tokens/run3.tsv")
    new = {"kitchen": "kichen", "office": "attic"}
    write_stream(with_columns(stream, places=[new.get(place, place) for place in stream.places]), world / "run4.tsv")
    decode([world / "run4.tsv"], world / "model", options=Decoding(unknown=unknown))
    assert "20 test frames are of 'kichen', which the models do not know; the nearest name is 'kitchen'" in caplog.text
    assert ("20 test frames are of 'attic'" in caplog.text) == (not unknown)
