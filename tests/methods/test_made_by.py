"""beliefs.json: `evaluate` names the model and the options beside its numbers."""

import json
from pathlib import Path

import pytest
from helpers.small_world import write_world

from placerec.errors import EvaluationError
from placerec.evaluation.summary import format_evaluation
from placerec.figures.evaluation import evaluate_files
from placerec.methods import decode
from placerec.model import Decoding
from placerec.model.decoding import AS_LEARNED


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    write_world(root)
    return root


def told(world: Path, *folders: str) -> list[str]:
    """The lines of `evaluate` about models, behind its numbers."""
    found = format_evaluation(evaluate_files([world / folder for folder in folders]))
    lines = [" ".join(line.split()) for line in found.partition("\n\n")[0].splitlines()]
    return lines[next(number for number, line in enumerate(lines) if line.startswith("model")) :]


def decoded(world: Path, name: str, options: Decoding = AS_LEARNED, run: str = "run3", method: str = "hohmm") -> None:
    decode([world / f"tokens/{run}.tsv"], world / "model", out=world / name, options=options, method=method)


def test_the_model_and_the_options_are_named(world: Path) -> None:
    model = "model order 2, witten-bell, 12 words,"
    for options, line in (
        (Decoding(), "transitions fixed, alpha 1, memory 0"),
        (Decoding(stay=0.9, per="frame"), "transitions fixed, stay 0.9, per frame, alpha 1, memory 0"),
        (Decoding(transition="learned", smooth=True), "transitions learned, alpha 1, memory 0, smooth"),
        (Decoding(lag=1, alpha=0.5), "transitions fixed, alpha 0.5, memory 0, lag of 1 frame"),
    ):
        decoded(world, "out", options)
        assert " ".join(told(world, "out")) == f"{model} {line}"
    decoded(world, "out", method="wu2009")
    assert told(world, "out") == ["model wu2009, 12 words"]


def test_one_model_is_named_once_and_two_are_two(world: Path) -> None:
    decoded(world, "one")
    decoded(world, "two", run="run2")
    assert len(told(world, "one", "two")) == 1
    decoded(world, "two", Decoding(viterbi=True), run="run2")
    assert told(world, "one", "two")[1].endswith(", viterbi")
    found = evaluate_files([world / "one", world / "two"])
    assert found.to_json()["made_by"] == list(found.made_by)
    assert len(found.made_by) == 2


def test_beliefs_of_others_are_judged_without(world: Path, tmp_path: Path) -> None:
    decoded(world, "one")
    (tmp_path / "run3.tsv").write_bytes((world / "one/run3.tsv").read_bytes())
    assert evaluate_files([tmp_path]).made_by == ()
    for text in ("{}", "[]", "7", json.dumps({"format": "placerec beliefs 1", "method": "hohmm"})):
        (tmp_path / "beliefs.json").write_text(text)
        with pytest.raises(
            EvaluationError, match=r"beliefs\.json: does not say what made the beliefs .*; decode again"
        ):
            evaluate_files([tmp_path])
