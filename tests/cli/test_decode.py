"""`placerec decode`: options that exclude each other are errors of usage, and the others reach the recognizer."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from small import PLACES, write_tokens

from placerec.cli import commands
from placerec.model import train_lm


def decode(*args: object, stdin: str | None = None) -> Result:
    return CliRunner().invoke(commands, ["decode", *map(str, args)], prog_name="placerec", input=stdin)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tokens, a model, and transitions."""
    root = tmp_path_factory.mktemp("world")
    write_tokens(root / "tokens")
    train_lm([root / "tokens/run1.tsv", root / "tokens/run2.tsv"], root / "model")
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
    assert "`-` answers each line before later words are known" in result.stderr


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
