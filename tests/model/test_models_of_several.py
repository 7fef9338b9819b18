"""MODEL/ of several dictionaries: a folder for each, what weighs their words, and learning on from there."""

import json
import logging
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers.several_dictionaries import FURTHER, several_words, write_several

from placerec.errors import LanguageModelError, ModelError, OutputError, StreamError
from placerec.evaluation.metrics import evaluate
from placerec.hohmm.weights import ALPHAS, MEMORIES
from placerec.inspection.decision import format_decision, inspect_decision
from placerec.methods import decode, decode_lines, load_decoder
from placerec.model import Decoding, ModelOptions, calibrate, load_model, load_recognizer, train_lm, update
from placerec.model.evidence import group_borders
from placerec.words import write_stream, write_vocabulary


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    return write_several(tmp_path / "tokens")


@pytest.fixture
def model(tmp_path: Path, runs: list[Path]) -> Path:
    train_lm(runs[:3], tmp_path / "model")
    return tmp_path / "model"


def test_each_dictionary_has_the_models_that_its_column_alone_would_make(tmp_path: Path, model: Path) -> None:
    whole = contents(model)
    for name in ("", *FURTHER):
        alone = tmp_path / "alone" / (name or "first")
        for number in (1, 2, 3):
            stream = several_words(f"run{number}", number).in_dictionary(name)
            write_stream(stream, alone / f"run{number}.tsv")
        write_vocabulary((model / name / "vocab.txt").read_text().split(), alone / "vocab.txt")
        train_lm([alone], tmp_path / "one", as_in_paper=True)
        for path, text in contents(tmp_path / "one").items():
            mine = whole[f"{name}/{path}" if name else path]
            if path.endswith(".arpa") and name:
                mine = mine.replace(f" dictionary={name}", "", 1)
            if path != "model.json" or name:
                assert mine == text, path
    own = json.loads(whole["model.json"])
    assert list(own["evidence"]["dictionaries"]) == ["word", "word.plain20", "word.pn10"]


@pytest.mark.parametrize("smoothing", ["witten-bell", "jelinek-mercer"])
def test_weights_are_those_with_the_least_log_loss_on_runs_that_are_left_out(
    tmp_path: Path, runs: list[Path], smoothing: str
) -> None:
    made = ModelOptions(smoothing=smoothing)
    train_lm(runs[:3], tmp_path / "model", options=made)
    evidence = load_model(tmp_path / "model").description.evidence
    assert evidence is not None
    found = {}
    for alpha, memory in ((evidence.weights.alpha, evidence.weights.memory), (1.0, 0.0), (0.12, 0.1)):
        beliefs = []
        for left in range(3):
            rest = [run for number, run in enumerate(runs[:3]) if number != left]
            train_lm(rest, tmp_path / "rest", options=made)
            options = Decoding(transition="learned", alpha=alpha, memory=memory)
            beliefs += decode([runs[left]], tmp_path / "rest", options=options)
        found[alpha, memory] = evaluate(beliefs).log_loss
    chosen = found[evidence.weights.alpha, evidence.weights.memory]
    assert chosen == min(found.values())
    assert evidence.weights.log_loss == pytest.approx(chosen, rel=1e-5)
    assert evidence.weights.unweighted == pytest.approx(found[1.0, 0.0], rel=1e-5)
    assert (evidence.weights.alpha in ALPHAS, evidence.weights.memory in MEMORIES) == (True, True)
    assert evidence.sequences == 3
    assert dict(evidence.frames) == {"hall": 60, "kitchen": 60, "office": 60}


def test_one_sequence_has_nothing_to_choose_by(tmp_path: Path, runs: list[Path]) -> None:
    train_lm(runs[:1], tmp_path / "model")
    evidence = load_model(tmp_path / "model").description.evidence
    assert evidence is not None
    assert [evidence.weights.alpha, evidence.weights.memory] == pytest.approx([1 / 3, 0.0])
    assert evidence.weights.log_loss is None


@pytest.mark.parametrize("sequences", [0, 1, 2, 4, 5, 6, 13])
def test_groups_are_at_most_five_and_hold_each_sequence_once(sequences: int) -> None:
    groups = group_borders(sequences)
    assert len(groups) == (0 if sequences < 2 else min(5, sequences))
    assert [n for group in groups for n in range(sequences)[group]] == ([] if sequences < 2 else [*range(sequences)])
    assert all(range(sequences)[group] for group in groups)


def test_models_that_fewer_runs_cannot_make_leave_the_weights_as_they_are(
    tmp_path: Path, runs: list[Path], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise LanguageModelError("Kneser-Ney fails at order 2")

    monkeypatch.setattr("placerec.model.evidence.estimate_place", fails)
    with caplog.at_level(logging.WARNING):
        train_lm(runs[:3], tmp_path / "model")
    told = "the weight of words cannot be learned: without some of the sequences, Kneser-Ney fails at order 2"
    assert told in caplog.text
    evidence = load_model(tmp_path / "model").description.evidence
    assert evidence is not None
    assert [evidence.weights.alpha, evidence.weights.memory] == pytest.approx([1 / 3, 0.0])


def test_as_in_paper_is_the_first_dictionary_alone(tmp_path: Path, runs: list[Path]) -> None:
    train_lm(runs[:3], tmp_path / "paper", as_in_paper=True)
    assert "evidence" not in json.loads((tmp_path / "paper/model.json").read_text())
    assert not (tmp_path / "paper/pn10").exists()
    [beliefs] = decode([runs[3]], tmp_path / "paper")
    [fixed] = decode([runs[3]], tmp_path / "paper", options=Decoding(transition="fixed", stay=0.99, alpha=1.0))
    assert beliefs.belief.tobytes() == fixed.belief.tobytes()


def test_decoding_follows_what_training_learned_until_it_is_told_otherwise(model: Path, runs: list[Path]) -> None:
    evidence = load_model(model).description.evidence
    assert evidence is not None
    [followed] = decode([runs[3]], model)
    weights = evidence.weights
    told = Decoding(transition="learned", alpha=weights.alpha, memory=weights.memory)
    assert decode([runs[3]], model, options=told)[0].belief.tobytes() == followed.belief.tobytes()
    for other in (Decoding(alpha=1.4), Decoding(memory=0.7), Decoding(stay=0.6), Decoding(transition="fixed")):
        assert decode([runs[3]], model, options=other)[0].belief.tobytes() != followed.belief.tobytes()


@pytest.mark.parametrize(
    "options", [Decoding(smooth=True), Decoding(viterbi=True), Decoding(lag=2), Decoding(unknown=True)], ids=str
)
def test_every_way_of_decoding_takes_several_dictionaries(model: Path, runs: list[Path], options: Decoding) -> None:
    [found] = decode([runs[3]], model, options=options)
    assert found.belief.sum(axis=1) == pytest.approx(np.ones(60))
    assert np.mean(np.array(found.best) == np.array(found.truth)) > 0.5
    assert (found.unknown is not None) == options.unknown


def test_kenlm_scores_the_words_of_every_dictionary(model: Path, runs: list[Path]) -> None:
    pytest.importorskip("kenlm")
    native, kenlm = (decode([runs[3]], model, scorer=scorer)[0].belief for scorer in ("native", "kenlm"))
    assert kenlm == pytest.approx(native, abs=1e-5)


def test_a_decision_can_be_read(tmp_path: Path, model: Path, runs: list[Path]) -> None:
    [beliefs] = decode([runs[3]], model, out=tmp_path / "beliefs", options=Decoding(explain=True))
    frame = beliefs.stream.frames[7]
    text = format_decision(
        inspect_decision(tmp_path / "beliefs/run4.explain.jsonl", frame, out=tmp_path / "decision.html")
    )
    stream = several_words("run4", 4)
    words = [stream.in_dictionary(name).words[7] for name in stream.dictionaries]
    assert f"The words {', '.join(words)} were seen, and each counts to the power of " in text
    header = next(line for line in text.splitlines() if line.startswith("place "))
    assert all(f"p of {word}" in header for word in words)
    assert "to the power of alpha" in (tmp_path / "decision.html").read_text()


def test_lines_have_a_word_of_each_dictionary_in_any_order(model: Path, runs: list[Path]) -> None:
    stream = several_words("run4", 4)
    words = list(zip(*(stream.in_dictionary(name).words for name in stream.dictionaries), strict=True))
    decoder = load_decoder("hohmm", model)
    header, *answers = decode_lines(decoder, [f"{' '.join(reversed(frame))}\n" for frame in words])
    [batch] = decode([runs[3]], model)
    found = [[float(cell) for cell in line.split("\t")[6:]] for line in answers]
    assert header.split("\t")[6:] == ["hall", "kitchen", "office"]
    assert np.array(found) == pytest.approx(batch.belief, abs=1e-8)


def test_a_calibration_measures_the_distances_of_every_dictionary(model: Path, runs: list[Path]) -> None:
    calibrate(model, [runs[3]])
    stored = json.loads((model / "model.json").read_text())["calibration"]
    assert {"distances", "distances.plain20", "distances.pn10"} <= set(stored)
    [found] = decode([runs[3]], model, options=Decoding(calibrated=True, unknown=True))
    assert found.belief.sum(axis=1) == pytest.approx(np.ones(60))


def test_learning_on_equals_training_on_all_but_for_the_weights(tmp_path: Path, runs: list[Path]) -> None:
    train_lm(runs[:2], tmp_path / "model")
    weights = json.loads((tmp_path / "model/model.json").read_text())["evidence"]
    before = contents(tmp_path / "model")
    train_lm(runs[:3], tmp_path / "all")
    update(tmp_path / "model", [runs[2]])
    learned, trained = contents(tmp_path / "model"), contents(tmp_path / "all")
    own, other = (json.loads(files.pop("model.json")) for files in (learned, trained))
    assert learned == trained
    assert own["evidence"].pop("frames") == other["evidence"].pop("frames")
    assert own.pop("evidence") == {key: value for key, value in weights.items() if key != "frames"}
    other.pop("evidence")
    assert own == other
    update(tmp_path / "model", [runs[2]], forget=True)
    assert contents(tmp_path / "model") == before


def test_words_and_tokens_of_learn_stay_with_a_model_that_learns_on(tmp_path: Path, runs: list[Path]) -> None:
    train_lm(runs[:2], tmp_path / "model")
    (tmp_path / "model/words.npz").write_bytes(b"words")
    shutil.copytree(tmp_path / "tokens", tmp_path / "model/tokens")
    update(tmp_path / "model", [runs[2]])
    assert (tmp_path / "model/words.npz").read_bytes() == b"words"
    assert contents(tmp_path / "model/tokens") == contents(tmp_path / "tokens")


def test_a_model_of_several_is_replaced_whole_and_other_files_are_spared(tmp_path: Path, runs: list[Path]) -> None:
    train_lm(runs[:3], tmp_path / "model")
    train_lm(runs[:3], tmp_path / "model", as_in_paper=True)
    assert not (tmp_path / "model/pn10").exists()
    train_lm(runs[:3], tmp_path / "model")
    (tmp_path / "model/notes.md").write_text("mine")
    with pytest.raises(OutputError, match=r"notes\.md"):
        train_lm(runs[:3], tmp_path / "model")


def test_what_is_missing_or_broken_is_named(tmp_path: Path, model: Path, runs: list[Path]) -> None:
    (tmp_path / "short.txt").write_text("w01\n")
    with pytest.raises(StreamError, match=r"short\.txt: holds the words of one dictionary, and .* have 3"):
        train_lm(runs, tmp_path / "other", vocabulary=tmp_path / "short.txt")
    (model / "pn10/hall.arpa").rename(tmp_path / "kept.arpa")
    with pytest.raises(ModelError, match=r"pn10/hall\.arpa: missing"):
        load_recognizer(model)
    (tmp_path / "kept.arpa").rename(model / "pn10/hall.arpa")
    whole = json.loads((model / "model.json").read_text())
    for key, value in (
        ("alpha", "much"),
        ("alpha", -1),
        ("memory", 2),
        ("frames", {}),
        ("frames", {"hall": -1, "kitchen": 1, "office": 1}),
        ("dictionaries", []),
        ("dictionaries", {"word.pn10": None}),
        ("dictionaries", {"word": None, "word.../x": None}),
        ("sequences", None),
    ):
        broken = whole | {"evidence": whole["evidence"] | {key: value}}
        (model / "model.json").write_text(json.dumps(broken))
        with pytest.raises(ModelError, match=r"model\.json: 'evidence' is not what training writes; train the model"):
            load_recognizer(model)
    runs[1].write_text(runs[1].read_text().replace("word.pn10", "word.other"))
    with pytest.raises(StreamError, match=r"run2\.tsv: has no column 'word\.pn10' as other files have"):
        train_lm(runs, tmp_path / "other")
