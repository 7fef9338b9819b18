"""`train-lm` and `ngram-count` are one trainer: the command in model.json makes the model that stands beside it."""

import io
import shlex
from pathlib import Path

import numpy as np
import pytest

from placerec.lm import SMOOTHINGS
from placerec.model import ModelOptions, train_model
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram_count import ngram_count


def visits() -> list[list[str]]:
    generator = np.random.default_rng(3)
    walk = np.minimum(generator.zipf(1.4, 1500), 60) - 1
    return [[f"w{i:02d}" for i in walk[start : start + 25]] for start in range(0, 1500, 25)]


@pytest.mark.parametrize("markers", [False, True])
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("name", SMOOTHINGS)
def test_the_command_makes_the_same_lines(
    name: str, order: int, markers: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ModelOptions(order=order, smoothing=name, markers=markers, min_count=(1, 1, 2))
    train_model({"hall": visits()}, [f"w{i:02d}" for i in range(60)], tmp_path / "model", options=options)
    command = options.ngram_count_command("hall")
    if command is None:
        assert name in ("lidstone", "jelinek-mercer")
        return
    monkeypatch.chdir(tmp_path / "model")
    ours = lines("hall.arpa", markers)
    tool, *arguments = shlex.split(command)
    assert tool == "ngram-count"
    streams = Streams(io.BytesIO(), io.BytesIO(), io.BytesIO())
    assert ngram_count([*arguments, "-lm", "again.arpa"], streams) == 0
    assert lines("again.arpa", markers) == ours
    assert len(ours) > 60


def lines(path: str, markers: bool) -> list[str]:
    """The lines of a model but those that the contract lets differ."""
    extra = ("<unk>",) if markers else ("<unk>", "</s>")
    text = Path(path).read_text().splitlines()
    return [
        line
        for line in text
        if not line.startswith(("#", "ngram 1=")) and not any(line.endswith(f"\t{word}") for word in extra)
    ]
