"""Outputs of commands as a user meets them: what is written, what goes to stdout and what to stderr, and errors."""

import json
from pathlib import Path

import pytest
from helpers.small_world import run_through
from helpers.typed_commands import done, fails, make_world, misused, placerec

from placerec.words import write_stream


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make_world` makes, for all tests here."""
    return make_world(tmp_path_factory.mktemp("world"))


# Outputs


def test_outputs_that_hold_other_things_are_refused_before_any_work(world: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    foreign = r"holds notes\.txt, which this command does not write; name another folder"
    tokenize = ("tokenize", world / "runs", "-w", world / "words.npz")
    for args in (tokenize, ("train-lm", world / "tokens"), ("decode", world / "tokens", "-m", world / "model")):
        fails(foreign, *args, "-o", tmp_path)
        fails(r"notes\.txt: is a file, and a folder is to be written", *args, "-o", tmp_path / "notes.txt")
    assert placerec(*tokenize, "-o", tmp_path).stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_parents_of_an_output_are_made(world: Path, tmp_path: Path) -> None:
    done("train-lm", world / "tokens", "-o", tmp_path / "a/b/model")
    assert (tmp_path / "a/b/model/model.json").exists()


def test_an_output_is_replaced_whole(world: Path, tmp_path: Path) -> None:
    done("decode", world / "tokens", "-m", world / "model", "-o", tmp_path / "out")
    done("decode", world / "tokens/run1.tsv", "-m", world / "model", "-o", tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["beliefs.json", "run1.tsv"]


# Decoding


def test_decode_refuses_what_does_not_fit(world: Path, tmp_path: Path) -> None:
    images, model = world / "runs/seq2", ("-m", world / "seen-model")
    fails(
        "seen-model: was trained on the words of another dictionary",
        "decode",
        images,
        *model,
        "-w",
        world / "other.npz",
    )
    fails("2 sequences to decode: name a folder for their beliefs with -o", "decode", world / "seen", *model)
    fails("seq2: holds no token stream", "decode", images, *model)
    tokens = world / "seen/seq2.tsv"
    fails("is a token stream, which needs no dictionary", "decode", tokens, *model, "-w", world / "words.npz")
    fails("nowhere: no such model folder; `placerec train-lm", "decode", tokens, "-m", tmp_path / "nowhere")
    fails("nowhere: no such file or folder", "decode", tmp_path / "nowhere", *model)
    done("tokenize", images, "-w", world / "other.npz", "-o", tmp_path / "tokens")
    fails("tokens: its words are of another dictionary", "decode", tmp_path / "tokens", *model)


def test_decode_to_stdout_and_to_a_file_are_the_same(world: Path) -> None:
    shown = done("decode", world / "tokens/run3.tsv", "-m", world / "model")
    assert shown.stdout == (world / "beliefs/run3.tsv").read_text()
    assert shown.stderr == ""


def test_decode_of_images_is_decode_of_their_words(world: Path) -> None:
    model = ("-m", world / "seen-model", "-q")
    images = done("decode", world / "runs/seq2", *model, "-w", world / "words.npz").stdout
    assert images == done("decode", world / "seen/seq2.tsv", *model).stdout
    assert len(images.splitlines()) == 13


def test_decode_streams(world: Path) -> None:
    model = ("-m", world / "model")
    answered = done("decode", "-", *model, stdin="w01\t1.5\nzz\n\nw02\r\n")
    rows = [line.split("\t") for line in answered.stdout.splitlines()]
    assert [row[:5] for row in rows[1:]] == [
        ["0", "1.5", "", "w01", "1"],
        ["1", "", "", "zz", "0"],
        ["2", "", "", "", "0"],
        ["3", "", "", "w02", "1"],
    ]
    assert answered.stderr.splitlines() == [
        "warning: <stdin>:2: the word 'zz' is not in the models' vocabulary; skipped",
        "warning: <stdin>: lines skipped because the models do not list their word: 2",
    ]
    assert done("decode", "-", *model, stdin="").stdout.count("\n") == 1
    misused("it takes neither -o nor --explain", "decode", "-", *model, "-o", world / "no")
    misused("`-` cannot be mixed with files", "decode", "-", world / "tokens", *model)


def test_bad_seconds_end_a_stream_with_an_error(world: Path) -> None:
    result = placerec("decode", "-", "-m", world / "model", stdin="w01\t1\nw01\tsoon\n")
    assert result.exit_code == 1
    assert len(result.stdout.splitlines()) == 2
    assert result.stderr == "placerec: <stdin>:2: time 'soon' is not a number of seconds\n"


# Evaluation


def test_evaluate_names_what_it_cannot_judge(world: Path, tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("w01 w02")
    done("decode", tmp_path / "words.txt", "-m", world / "model", "-o", tmp_path / "beliefs")
    fails("no frame of words has a label", "evaluate", tmp_path / "beliefs/words.tsv")
    fails(r"run3\.tsv:1: not a beliefs file: no column selected, best", "evaluate", world / "tokens/run3.tsv")
    fails(r"none\.tsv: no such file", "evaluate", tmp_path / "none.tsv")
    plot = ("--plot", tmp_path / "picture.xyz")
    fails(r"picture\.xyz: no kind of picture; let its name end", "evaluate", world / "beliefs", *plot)


def test_json_has_names_as_they_are(world: Path, tmp_path: Path) -> None:
    text = (world / "beliefs/run3.tsv").read_text().replace("kitchen", "k\u00fcche")
    assert "k\u00fcche" in done("evaluate", "-", "--json", stdin=text.encode()).stdout


def test_evaluate_reads_a_pipe(world: Path) -> None:
    text = (world / "beliefs/run3.tsv").read_text()
    piped = json.loads(done("evaluate", "-", "--json", stdin=text).stdout)
    named = json.loads(done("evaluate", world / "beliefs", "--json").stdout)
    assert piped.pop("sequences").keys() == {"stdin"}
    assert named.pop("sequences").keys() == {"run3"}
    # What made the beliefs stands beside their file.
    assert (piped.pop("made_by"), len(named.pop("made_by"))) == ([], 1)
    assert piped == named
    assert piped["frames"] == 60


# Talk


def test_json_holds_no_nan(world: Path, tmp_path: Path) -> None:
    """JSON has no NaN: other languages' parsers stop there. An unstamped run has times that are not known."""
    write_stream(run_through("run", 5), tmp_path / "run.tsv")
    (tmp_path / "run.txt").write_text(" ".join(run_through("run", 5).words))
    for args in (
        ("decode", tmp_path / "run.txt", "-m", world / "model", "--json"),
        ("evaluate", world / "beliefs", "--json"),
        ("inspect", world / "model/hall.arpa", "w01 w02", "--json"),
    ):
        text = done(*args).stdout
        for part in text.splitlines() if args[0] == "decode" else [text]:
            json.loads(part, parse_constant=pytest.fail)


def test_quiet_is_silent_and_other_commands_tell_what_they_did(world: Path, tmp_path: Path) -> None:
    small = ("--size", 2, "--image-size", 16)
    for i, args in enumerate(
        (
            ("train-words", world / "runs", *small),
            ("tokenize", world / "runs", "-w", world / "words.npz"),
            ("train-lm", world / "tokens"),
            ("decode", world / "tokens", "-m", world / "model"),
            ("relight", world / "runs", "--light", "dim"),
        )
    ):
        told, quiet = (done(*args, "-o", tmp_path / f"{i}{q}", *q.split()) for q in ("", "-q"))
        assert quiet.output == "", args
        assert told.stdout == ""
        assert told.stderr.count("\n") >= 1, args


def test_there_is_no_progress_bar_without_a_terminal(world: Path, tmp_path: Path) -> None:
    result = done("tokenize", world / "runs", "-w", world / "words.npz", "-o", tmp_path / "tokens", "--no-cache")
    assert result.stderr == (
        f"24 frames described\n{tmp_path / 'tokens'}: 2 sequences, " + result.stderr.rpartition("2 sequences, ")[2]
    )
    assert "\r" not in result.stderr
    assert "%" not in result.stderr
