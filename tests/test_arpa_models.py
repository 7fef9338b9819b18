"""The models to read by hand: their own sentences make them again, and their README's numbers are theirs."""

import json
import re
from pathlib import Path

import pytest

from placerec.lm import read_arpa
from placerec.model import Options, parse_min_count, train_model
from placerec.model.record import read_record
from placerec.words import parse_selection, read_sentences, read_vocabulary

MODELS = Path(__file__).resolve().parent.parent / "arpa_models"


@pytest.mark.parametrize(
    "folder", sorted(path for path in MODELS.iterdir() if path.is_dir()), ids=lambda path: path.name
)
def test_sentences_make_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    made_by = json.loads((folder / "model.json").read_text())
    options = Options(
        made_by["order"],
        made_by["smoothing"],
        made_by["delta"],
        parse_min_count(",".join(map(str, made_by["min_count"]))),
        made_by["markers"],
        parse_selection(made_by["select"]),
    )
    sentences = {place: read_sentences(folder / f"sentences/{place}.txt") for place in made_by["places"]}
    train_model(
        sentences,
        read_vocabulary(folder / "vocab.txt"),
        tmp_path / "again",
        options=options,
        record=read_record(folder / "model.json", made_by),
    )
    again = {path.relative_to(tmp_path / "again"): path.read_bytes() for path in (tmp_path / "again").rglob("*.*")}
    kept = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.*")}
    assert len(kept) == 5 * 3 + 3
    assert again == kept


def test_readme_computes_what_the_file_says() -> None:
    text = (MODELS / "README.md").read_text(encoding="utf-8")
    assert (
        (MODELS / "witten-bell/KT-B.arpa")
        .read_text()
        .startswith(
            re.search(r"    # placerec.*?w1\t-0\.30103\n", text, re.DOTALL)[0].replace("\n    ", "\n").lstrip(" ")  # type: ignore[index]
        )
    )
    model = read_arpa(MODELS / "witten-bell/KT-B.arpa")
    for ngram, said in [("w7", 6.6667 / 19), ("w2", 0.6667 / 19), ("w7 w8", 0.236842), ("w7 w2", 0.0175)]:
        *history, word = ngram.split()
        assert 10 ** model.log10_p(word, history) == pytest.approx(said, rel=3e-3), ngram
        assert f"{said:.6f}"[:6] in text
