"""`placerec decode`: options that exclude each other are errors of usage, and the others reach the recognizer."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import Result
from helpers.small_world import PLACES, write_tokens
from helpers.typed_commands import placerec

from placerec.cli.models import METHODS
from placerec.model import calibrate, train_lm


def decode(*args: object, stdin: str | None = None) -> Result:
    return placerec("decode", *args, stdin=stdin)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tokens, a model, and transitions."""
    root = tmp_path_factory.mktemp("world")
    write_tokens(root / "tokens")
    train_lm([root / "tokens/run1.tsv", root / "tokens/run2.tsv"], root / "model", as_in_paper=True)
    table = "\t".join(PLACES) + "\n0.9\t0.1\t0\n0.1\t0.8\t0.1\n0\t0.1\t0.9\n"
    (root / "steps.tsv").write_text(table)
    return root


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("--transition", "learned", "--stay", "0.9"), "learned transitions are per frame"),
        (("--transition", "learned", "--per", "update"), "learned transitions are per frame"),
        (("--transition", "x.tsv", "--stay", "0.9"), "transitions of a file take no stay probability"),
        (("--transition", "x.tsv", "--per", "second"), "transitions of a file cannot be per second"),
        (("--smooth", "--viterbi"), "of smooth, viterbi and lag only one can be asked for"),
        (("--smooth", "--lag", "3"), "of smooth, viterbi and lag only one can be asked for"),
        (("--lag", "-1"), "-1 is not in the range x>=0"),
        (("--max-gap", "0"), "0.0 is not in the range x>0"),
        (("--max-gap", "inf"), "inf is not a number that can be used"),
        (("--method", "knn"), "knn needs descriptors, not words alone; `placerec compare` runs it"),
        (("--method", "bayes"), "method 'bayes' is unknown; choose one of hohmm, majority, naive-bayes, wu2009"),
        (("--method", "filliat2008", "--smooth"), "filliat2008 has no use for smooth; leave it out"),
        (("--method", "naive-bayes", "--per", "frame"), "naive-bayes has no use for per; leave it out"),
        (("--method", "majority", "--unknown"), "majority has no use for unknown; leave it out"),
        (("--method", "mtd", "--calibrated"), "mtd has no use for calibrated; leave it out"),
        (("--method", "wu2009", "--scorer", "kenlm"), "wu2009 has no use for another scorer of the language models"),
        (("--per", "hour"), "'hour' is not one of 'update', 'frame', 'second'"),
    ],
)
def test_misuse(args: tuple[str, ...], message: str, world: Path) -> None:
    result = decode(world / "tokens/run3.tsv", "-m", world / "model", *args)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr.splitlines()[-1]


@pytest.mark.parametrize("args", [("--smooth",), ("--viterbi",), ("--lag", "0")])
def test_a_stream_cannot_look_ahead(args: tuple[str, ...], world: Path) -> None:
    result = decode("-", "-m", world / "model", *args, stdin="w01\n")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "`-` answers each frame before later words are known" in result.stderr


def test_options_change_the_answer(world: Path) -> None:
    run = world / "tokens/run3.tsv", "-m", world / "model"
    answers = {
        args: decode(*run, *args)
        for args in [
            (),
            ("--per", "second"),
            ("--transition", "learned"),
            ("--transition", str(world / "steps.tsv")),
            ("--smooth",),
            ("--viterbi",),
            ("--lag", "4"),
            ("--max-gap", "0.1"),
        ]
    }
    assert {result.exit_code for result in answers.values()} == {0}
    assert len({result.stdout for result in answers.values()}) == len(answers)
    same = decode(*run, "--transition", "fixed", "--stay", "0.99", "--per", "update")
    assert same.stdout == answers[()].stdout


def test_a_stream_has_a_clock(world: Path) -> None:
    args = "-", "-m", world / "model", "--max-gap", "2", "--per", "second"
    answered = decode(*args, stdin="w01\t1\nw02\t2\nw01\t60\n")
    assert answered.exit_code == 0
    rows = [line.split("\t")[6:] for line in answered.stdout.splitlines()[1:]]
    assert rows[2] == rows[0] != rows[1]
    assert "58 s without a frame: a new sequence begins" in answered.stderr
    refused = decode(*args, stdin="w01\n")
    assert refused.exit_code == 1
    assert "<stdin>:1: the frame has no time" in refused.stderr


def test_calibration_and_what_is_unknown_reach_files_and_streams(world: Path, tmp_path: Path) -> None:
    shutil.copytree(world / "model", tmp_path / "model")
    run = world / "tokens/run3.tsv", "-m", tmp_path / "model"
    missing = decode(*run, "--calibrated")
    assert missing.exit_code == 1
    assert "is not calibrated; run `placerec calibrate" in missing.stderr
    calibrate(tmp_path / "model", [world / "tokens/run3.tsv"])
    plain, calibrated, unknown = (decode(*run, *args) for args in ((), ("--calibrated",), ("--unknown",)))
    assert plain.stdout != calibrated.stdout
    assert unknown.stdout.splitlines()[0] == plain.stdout.splitlines()[0] + "\tunknown"
    words = [line.split("\t")[3] + "\n" for line in plain.stdout.splitlines()[1:]]
    both = "--calibrated", "--unknown", "--json"
    lines = [decode(*args, *both, stdin="".join(words)).stdout.splitlines() for args in (run, ("-", *run[1:]))]
    for filed, streamed in zip(*(map(json.loads, one) for one in lines), strict=True):
        assert streamed["unknown"] == pytest.approx(filed["unknown"], abs=1e-9)
        assert streamed["belief"] == pytest.approx(filed["belief"], abs=1e-9)
    assert "was calibrated for other options (stay 0.99)" in decode(*run, "--calibrated", "--stay", "0.5").stderr


def test_decisions_are_written_and_read(world: Path, tmp_path: Path) -> None:
    args = world / "tokens/run3.tsv", "-m", world / "model", "--explain"
    for misuse, message in (
        (args, "--explain writes files beside the beliefs: it needs -o"),
        ((*args, "-o", tmp_path / "b", "--smooth"), "explain tells how the filter decides word by word: it takes none"),
        (("-", *args[1:]), "`-` answers on stdout and writes no files: it takes neither -o nor --explain"),
    ):
        refused = decode(*misuse)
        assert (refused.exit_code, refused.stdout) == (2, "")
        assert message in refused.stderr
    for more, name in (((), "run3.tsv"), (("--json",), "run3.jsonl")):
        assert decode(*args, "-o", tmp_path / "b", *more).exit_code == 0
        assert sorted(path.name for path in (tmp_path / "b").iterdir()) == sorted(
            ["beliefs.json", "run3.explain.jsonl", name]
        )
    reasons = [json.loads(line) for line in (tmp_path / "b/run3.explain.jsonl").read_text().splitlines()]
    beliefs = [json.loads(line) for line in (tmp_path / "b/run3.jsonl").read_text().splitlines()]
    assert [one["best"] for one in reasons] == [one["best"] for one in beliefs]

    def inspect(*args: object) -> Result:
        return placerec("inspect", *args)

    path, page = tmp_path / "b/run3.explain.jsonl", tmp_path / "page.html"
    shown = inspect(path, "12", "-o", page)
    assert shown.stdout.startswith("Frame 12 at 6 s: ")
    assert page.read_text().startswith("<!doctype html>")
    assert json.loads(inspect(path, "12", "--json").stdout) == reasons[12]
    for wrong, code in (((path,), 2), ((path, "1", "2"), 2), ((path, "12", "--top", "3"), 2), ((path, "99"), 1)):
        assert inspect(*wrong).exit_code == code
    assert inspect(world / "model/hall.arpa", "-o", page).exit_code == 2


@pytest.mark.parametrize("method", ["hohmm", *METHODS])
def test_a_stream_is_answered_by_every_method(method: str, world: Path) -> None:
    """The same as from a file, up to the names of frames and the label."""
    words = ["w01", "w02", "zz", "w02", "w07"]
    (world / "words.txt").write_text(" ".join(words))
    recorded = decode(world / "words.txt", "-m", world / "model", "--method", method)
    streamed = decode("-", "-m", world / "model", "--method", method, stdin="".join(f"{word}\n" for word in words))
    assert (recorded.exit_code, streamed.exit_code) == (0, 0)
    assert "'zz'" in streamed.stderr
    rows = [[line.split("\t")[3:] for line in result.stdout.splitlines()] for result in (recorded, streamed)]
    assert rows[0][0] == rows[1][0]
    for a, b in zip(rows[0][1:], rows[1][1:], strict=True):
        assert a[:3] == b[:3]
        assert [float(p) for p in a[3:]] == pytest.approx([float(p) for p in b[3:]], abs=1e-8)


@pytest.mark.parametrize("method", ["ranganathan2010", "wu2009", "mtd"])
def test_methods_that_know_of_somewhere_new(method: str, world: Path) -> None:
    run = world / "tokens/run3.tsv", "-m", world / "model", "--method", method
    lines = [line.split("\t") for line in decode(*run, "--unknown").stdout.splitlines()]
    assert lines[0][-1] == "unknown"
    assert all(0 <= float(line[-1]) <= 1 for line in lines[1:])
    assert all(sum(map(float, line[6:-1])) == pytest.approx(1, abs=1e-6) for line in lines[1:])


@pytest.mark.parametrize("method", ["ranganathan2010", "majority"])
def test_a_gap_begins_a_new_sequence_for_every_method(method: str, world: Path) -> None:
    run = world / "tokens/run3.tsv", "-m", world / "model", "--method", method
    every = [line.split("\t") for line in decode(*run, "--max-gap", "0.1").stdout.splitlines()[1:]]
    # Each frame is alone, and what is believed of it depends on its word.
    beliefs = {(line[3], tuple(line[6:])) for line in every}
    assert len(beliefs) == len({word for word, _ in beliefs})


def test_a_largest_gap_needs_times(world: Path) -> None:
    (world / "words.txt").write_text("w01 w02")
    result = decode(world / "words.txt", "-m", world / "model", "--method", "majority", "--max-gap", "2")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "words: frame '0': the frame has no time, which the largest gap needs" in result.stderr
    back = decode("-", "-m", world / "model", "--method", "majority", "--max-gap", "2", stdin="w01\t5\nw01\t4\n")
    assert back.exit_code == 1
    assert "<stdin>:2: time goes back from 5.000000 to 4.000000 s" in back.stderr


def test_second_order_needs_sequences(world: Path) -> None:
    train_lm([world / "model/sentences"], world / "sentences", vocabulary=world / "tokens/vocab.txt", as_in_paper=True)
    run = world / "tokens/run3.tsv", "-m", world / "sentences", "--method"
    assert decode(*run, "naive-bayes").exit_code == 0
    result = decode(*run, "second-order")
    assert result.exit_code == 1
    assert "second-order learns how places follow each other" in result.stderr
