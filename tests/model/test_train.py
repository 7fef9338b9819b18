"""MODEL/: what train_model writes, what it refuses, and that the models are what they say."""

import itertools
import json
import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import PLACES, VOCABULARY, run_through

from placerec.errors import LanguageModelError, ModelError, OutputError, SourceError
from placerec.lm import SMOOTHINGS, count_ngrams, format_counts, read_arpa
from placerec.lm.check import kenlm_scorer
from placerec.model import ModelOptions, estimate_place, parse_min_count, train_model
from placerec.model.record import LearnedSequence, Record
from placerec.version import __version__
from placerec.words import Selection, Sentences, sentences_per_place

# Kneser-Ney fails on few words, and says so; tests/lm/test_smoothings.py has its tests.
SAFE = [name for name in SMOOTHINGS if "kneser-ney" not in name]

SENTENCES = sentences_per_place([run_through("run1", 0), run_through("run2", 1)], Selection())
KITCHEN = {"kitchen": [["a", "b", "a"], ["b"]]}


def layout(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@contextmanager
def silence_on_fd_2() -> Iterator[None]:
    """Fail if anything, a C++ library for instance, writes to the process's stderr."""
    with tempfile.TemporaryFile() as caught:
        kept = os.dup(2)
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
        caught.seek(0)
        assert caught.read() == b""


def test_the_layout_is_the_promised_one(tmp_path: Path) -> None:
    train_model(SENTENCES, VOCABULARY, tmp_path / "model")
    assert layout(tmp_path / "model") == sorted(
        [f"{place}.arpa" for place in PLACES]
        + [f"counts/{place}.counts" for place in PLACES]
        + [f"sentences/{place}.txt" for place in PLACES]
        + ["model.json", "nonevents.txt", "vocab.txt"]
    )
    assert (tmp_path / "model/vocab.txt").read_text() == "".join(f"{word}\n" for word in VOCABULARY)
    assert (tmp_path / "model/nonevents.txt").read_text() == "</s>\n"


def test_sentences_and_counts_are_what_was_counted(tmp_path: Path) -> None:
    train_model(KITCHEN, ("a", "b", "c"), tmp_path)
    assert (tmp_path / "sentences/kitchen.txt").read_text() == "a b a\nb\n"
    counts = (tmp_path / "counts/kitchen.counts").read_text()
    assert counts == format_counts(count_ngrams(KITCHEN["kitchen"], 2, vocabulary=("a", "b", "c"), markers=False))
    assert [line for line in counts.splitlines() if line.startswith("a")] == ["a\t2", "a b\t1"]


def test_the_first_line_says_what_made_the_model(tmp_path: Path) -> None:
    options = ModelOptions(3, "lidstone", 0.5, (1, 1, 2), True, Selection("subsample", 3))
    train_model(KITCHEN, ("a", "b"), tmp_path, options=options)
    first = (tmp_path / "kitchen.arpa").read_text().splitlines()[0]
    assert first == (
        f"# placerec {__version__} place=kitchen order=3 smoothing=lidstone delta=0.5"
        " select=subsample:3 min-count=1,1,2 markers=yes vocab=2"
    )


def test_a_model_without_delta_does_not_name_one(tmp_path: Path) -> None:
    train_model(KITCHEN, ("a", "b"), tmp_path)
    first = (tmp_path / "kitchen.arpa").read_text().splitlines()[0]
    expected = "place=kitchen order=2 smoothing=witten-bell select=none min-count=1 markers=no vocab=2"
    assert first == f"# placerec {__version__} {expected}"


def test_model_json_tells_all_options(tmp_path: Path) -> None:
    options = ModelOptions(3, "lidstone-backoff", 0.5, (1, 2), False, Selection("unique"))
    sequences = (LearnedSequence("run2", {"kitchen": 2}), LearnedSequence("run1", {"kitchen": 0}))
    record = Record(sequences, "f00", {("kitchen", "kitchen"): 7}, {"kitchen": {-3: 8, 2: 1}})
    train_model(KITCHEN, ("a", "b"), tmp_path, options=options, record=record)
    assert json.loads((tmp_path / "model.json").read_text()) == {
        "format": "placerec model 1",
        "version": __version__,
        "places": ["kitchen"],
        "order": 3,
        "smoothing": "lidstone-backoff",
        "delta": 0.5,
        "min_count": [1, 2],
        "markers": False,
        "select": "unique",
        "vocabulary": 2,
        "sequences": [{"name": "run2", "visits": {"kitchen": 2}}, {"name": "run1", "visits": {"kitchen": 0}}],
        "dictionary": "f00",
        "transitions": {"counts": [[7]], "triples": []},
        "distances": {"kitchen": {"-3": 8, "2": 1}},
        "calibration": None,
        "ngram_count": {
            "kitchen": "ngram-count -text sentences/kitchen.txt -vocab vocab.txt -nonevents nonevents.txt -no-sos "
            "-no-eos -order 3 -gt1min 1 -gt2min 2 -gt3min 2 -addsmooth 0.5 -lm kitchen.arpa"
        },
    }


@pytest.mark.parametrize(
    ("options", "command"),
    [
        (
            ModelOptions(),
            "-nonevents nonevents.txt -no-sos -no-eos -order 2 -gt1min 1 -gt2min 1 -wbdiscount -interpolate",
        ),
        (ModelOptions(1, "witten-bell-backoff", markers=True), "-order 1 -gt1min 1 -wbdiscount"),
        (
            ModelOptions(4, "witten-bell-backoff", min_count=parse_min_count("srilm"), markers=True),
            "-order 4 -gt1min 1 -gt2min 1 -gt3min 2 -gt4min 2 -wbdiscount",
        ),
    ],
)
def test_the_srilm_command_of_a_model(options: ModelOptions, command: str) -> None:
    expected = f"ngram-count -text sentences/hall.txt -vocab vocab.txt {command} -lm hall.arpa"
    assert options.ngram_count_command("hall") == expected


def test_srilm_has_no_interpolated_lidstone() -> None:
    assert ModelOptions(smoothing="lidstone").ngram_count_command("hall") is None


def test_nothing_of_a_former_model_remains(tmp_path: Path) -> None:
    train_model(SENTENCES, VOCABULARY, tmp_path / "model")
    options = ModelOptions(markers=True)
    train_model({"hall": SENTENCES["hall"]}, VOCABULARY, tmp_path / "model", options=options)
    expected = ["counts/hall.counts", "hall.arpa", "model.json", "sentences/hall.txt", "vocab.txt"]
    assert layout(tmp_path / "model") == expected
    assert [path.name for path in tmp_path.iterdir()] == ["model"]


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        train_model(SENTENCES, VOCABULARY, tmp_path / name, options=ModelOptions(4))
    assert layout(tmp_path / "one") == layout(tmp_path / "two")
    for name in layout(tmp_path / "one"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


def test_a_failure_leaves_the_old_model(tmp_path: Path) -> None:
    train_model(KITCHEN, ("a", "b"), tmp_path / "model")
    with pytest.raises(ModelError):
        train_model({"kitchen": [["z"]]}, ("a", "b"), tmp_path / "model")
    assert (tmp_path / "model/sentences/kitchen.txt").read_text() == "a b a\nb\n"
    (tmp_path / "model/notes.md").write_text("mine")
    with pytest.raises(OutputError, match=r"holds notes\.md"):
        train_model(KITCHEN, ("a", "b"), tmp_path / "model")


def test_minimum_counts_drop_rare_ngrams(tmp_path: Path) -> None:
    text: Sentences = [["a", "b", "c"], ["a", "b", "c"], ["b", "c", "a"]]
    counts = count_ngrams(text, 3, vocabulary=("a", "b", "c"), markers=False)
    model = estimate_place(counts, ModelOptions(3, min_count=parse_min_count("srilm")))
    all_kept = estimate_place(counts, ModelOptions(3))
    assert [len(p) for p in model.log10_probs] == [6, 3, 1]
    assert [len(p) for p in all_kept.log10_probs] == [6, 3, 2]


def test_the_minimum_counts_of_srilm() -> None:
    assert parse_min_count("srilm") == (1, 1, 2)
    assert parse_min_count("3,1") == (3, 1)
    for text in ("", "0", "1,,2", "-1", "1.5", "x", "٣"):
        with pytest.raises(ModelError, match="is not understood; give numbers above 0 as in 1,1,2, or srilm"):
            parse_min_count(text)


@pytest.mark.parametrize(
    ("sentences", "options", "error", "message"),
    [
        ({}, ModelOptions(), ModelError, "no labelled frame found: label the frames"),
        (KITCHEN, ModelOptions(order=0), ModelError, "order 0 is not between 1 and 9"),
        (KITCHEN, ModelOptions(order=10), ModelError, "order 10 is not between 1 and 9"),
        (KITCHEN, ModelOptions(min_count=()), ModelError, r"minimum counts \(\) are not understood"),
        (KITCHEN, ModelOptions(min_count=(1, 0)), ModelError, r"minimum counts \(1, 0\) are not understood"),
        (
            KITCHEN,
            ModelOptions(smoothing="good"),
            LanguageModelError,
            "smoothing 'good' is unknown; choose one of witten-b",
        ),
        (KITCHEN, ModelOptions(smoothing="lidstone", delta=0), LanguageModelError, "delta 0 must be a number above 0"),
        ({"a/b": []}, ModelOptions(), ModelError, "place 'a/b' holds a /; rename it"),
        ({".x": []}, ModelOptions(), ModelError, r"place '\.x' starts with a dot; rename it"),
        (
            {"best": []},
            ModelOptions(),
            ModelError,
            "place 'best' is the name of a column in placerec's files; rename it",
        ),
        ({"hall": [], "Hall": []}, ModelOptions(), SourceError, "place 'Hall' differs only in case from 'hall'"),
        (
            {"hall": [["a"], ["b", "z"]]},
            ModelOptions(),
            ModelError,
            "place hall, visit 2: the word 'z' is not in the vocabulary",
        ),
    ],
)
def test_what_cannot_be_trained_is_refused(
    tmp_path: Path, sentences: dict[str, Sentences], options: ModelOptions, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        train_model(sentences, ("a", "b"), tmp_path / "model", options=options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", SAFE)
def test_a_place_without_words_is_uniform(tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture) -> None:
    train_model({"attic": [], **KITCHEN}, ("a", "b", "c", "d"), tmp_path, options=ModelOptions(3, name))
    assert "place attic: no visit holds a selected word; its model is uniform" in caplog.text
    attic = read_arpa(tmp_path / "attic.arpa")
    # Seven digits are in the file.
    for history in ([], ["a"], ["c", "d"]):
        assert [attic.log10_p(word, history) for word in "abcd"] == pytest.approx([math.log10(0.25)] * 4, abs=1e-6)
    assert (tmp_path / "sentences/attic.txt").read_text() == ""


def test_a_model_of_one_place_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    train_model(KITCHEN, ("a", "b", "c", "d"), tmp_path / "one")
    (record,) = caplog.records
    assert record.getMessage().startswith("kitchen is the only place, and will be recognised wherever")
    caplog.clear()
    train_model({"hall": [["a"]], **KITCHEN}, ("a", "b", "c", "d"), tmp_path / "two")
    assert not caplog.records


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("name", SAFE)
def test_after_every_history_all_words_are_possible_and_sum_to_1(tmp_path: Path, name: str, order: int) -> None:
    """Without markers a model is closed: the K words share all the probability, after any history whatever."""
    vocabulary = ("a", "b", "c", "d")
    text: Sentences = [list("abacab"), list("bbb"), list("ca")]
    train_model({"hall": text}, vocabulary, tmp_path, options=ModelOptions(order, name, 0.3))
    model = read_arpa(tmp_path / "hall.arpa")
    histories = [h for n in range(order) for h in itertools.product(vocabulary, repeat=n)]
    assert len(histories) == sum(4**n for n in range(order))
    for history in histories:
        p = np.power(10.0, [model.log10_p(word, history) for word in vocabulary])
        assert (p > 0).all()
        assert p.sum() == pytest.approx(1, abs=5e-6), history


@pytest.mark.parametrize("name", SAFE)
def test_with_markers_the_end_of_a_visit_is_one_more_event(tmp_path: Path, name: str) -> None:
    vocabulary = ("a", "b", "c", "d")
    train_model({"hall": [list("abac"), list("b")]}, vocabulary, tmp_path, options=ModelOptions(2, name, markers=True))
    model = read_arpa(tmp_path / "hall.arpa")
    assert model.log10_p("</s>", ["b"]) > -1
    for history in ([], ["a"], ["d"], ["<s>"]):
        p = np.power(10.0, [model.log10_p(word, history) for word in (*vocabulary, "</s>")])
        assert p.sum() == pytest.approx(1, abs=5e-6)
    assert not (tmp_path / "nonevents.txt").exists()


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("name", SAFE)
def test_kenlm_reads_every_model_in_silence_and_agrees(tmp_path: Path, name: str, order: int) -> None:
    pytest.importorskip("kenlm")
    train_model(SENTENCES, VOCABULARY, tmp_path, options=ModelOptions(order, name, 0.5))
    stream = [*run_through("test", 7).words, *np.random.default_rng(0).choice(VOCABULARY, 100).tolist()]
    for place in PLACES:
        path = tmp_path / f"{place}.arpa"
        with silence_on_fd_2():
            other = kenlm_scorer(path)(stream)
        np.testing.assert_allclose(read_arpa(path).score(stream), other, atol=2e-6)
