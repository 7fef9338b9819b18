"""From a text to a model in one call: the model of ngram-count, to the byte."""

import gzip
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers.srilm_runs import call

from placerec import count_ngrams, estimate, smoothing, train_ngrams, write_arpa
from placerec.errors import LanguageModelError
from placerec.lm import SMOOTHINGS, format_arpa
from placerec.lm.smoothings import SRILM_OPTIONS

DRAW = random.Random(0)
# A few words that are frequent and many that are rare, as Kneser-Ney needs them.
SENTENCES = [[f"w{int(DRAW.paretovariate(0.7)) % 500}" for _ in range(i % 9)] for i in range(150)]


@pytest.fixture
def text(tmp_path: Path) -> Path:
    path = tmp_path / "train.txt"
    path.write_text("".join(" ".join(words) + "\n" for words in SENTENCES))
    return path


@pytest.mark.parametrize("name", [name for name in SMOOTHINGS if SRILM_OPTIONS[name]])
def test_it_is_the_model_of_ngram_count(name: str, text: Path, tmp_path: Path) -> None:
    write_arpa(train_ngrams(text, 3, smoothing=name), tmp_path / "ours.lm")
    options = str(SRILM_OPTIONS[name]).format(delta=1 if name.startswith("lidstone") else 0.5).split()
    minima = ("-gt1min", "1", "-gt2min", "1", "-gt3min", "1")
    status, _, said = call(
        "ngram-count", "-text", str(text), "-order", "3", *minima, *options, "-lm", str(tmp_path / "srilm.lm")
    )
    assert status == 0, said
    assert (tmp_path / "ours.lm").read_bytes() == (tmp_path / "srilm.lm").read_bytes()


def test_a_file_and_lists_of_words_are_one_text(text: Path, tmp_path: Path) -> None:
    expected = format_arpa(estimate(count_ngrams(SENTENCES, 2), smoothing("witten-bell")))
    with gzip.open(tmp_path / "train.txt.gz", "wb") as file:
        file.write(text.read_bytes())
    for given in (text, str(text), tmp_path / "train.txt.gz", SENTENCES, iter(SENTENCES)):
        assert format_arpa(train_ngrams(given, 2)) == expected


def test_a_vocabulary_and_no_markers() -> None:
    words = ["w1", "w2", "new"]
    model = train_ngrams(SENTENCES, 2, vocabulary=words, markers=False)
    assert sum(10 ** model.log10_p(word, ["w1"]) for word in words) == pytest.approx(1, abs=1e-6)
    assert model.log10_p("w3") == -math.inf
    assert set(words) < set(model.words)


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda path: train_ngrams("w1 w2 w1"), "^w1 w2 w1: no such file; name a text, or give lists of words"),
        (lambda path: train_ngrams(path.parent), "is a folder, and a file is expected"),
        (lambda path: train_ngrams(["w1 w2"]), "a list of words, not a string"),
        (lambda path: train_ngrams([], markers=False), "the vocabulary holds no word that could be predicted"),
        (lambda path: train_ngrams(path, 0), "order 0 cannot be used; give 1 or more"),
        (lambda path: count_ngrams(SENTENCES, -1), "order -1 cannot be used; give 1 or more"),
        (lambda path: train_ngrams(path, smoothing="kn"), "smoothing 'kn' is unknown; choose one of witten-bell"),
        (lambda path: train_ngrams(path, min_count=[0]), r"minimum counts \(0,\) must be 1 or more"),
    ],
)
def test_what_cannot_be_used_is_told(text: Path, mistake: Callable[[Path], Any], message: str) -> None:
    with pytest.raises(LanguageModelError, match=message):
        mistake(text)
