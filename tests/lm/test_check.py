"""KenLM as the independent check: it loads every file in silence and gives every token the same probability."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from placerec.errors import LanguageModelError, MissingExtraError
from placerec.lm import SMOOTHINGS, count_ngrams, estimate, read_arpa, smoothing, with_unigrams, write_arpa
from placerec.lm.check import check_model, generated_stream, kenlm_scorer
from placerec.lm.score import Contexts

WORDS = [f"w{i:02d}" for i in range(30)]


def write_model(path: Path, name: str, order: int, *, markers: bool = False, seed: int = 0) -> Path:
    generator = np.random.default_rng(seed)
    walk = np.cumsum(generator.integers(-1, 2, 400)) % 20
    sentences = [[WORDS[i] for i in walk[start : start + 50]] for start in range(0, 400, 50)]
    counts = count_ngrams(sentences, order, vocabulary=WORDS, markers=markers)
    model = estimate(counts, smoothing(name), non_events=[] if markers else ["</s>"])
    write_arpa(with_unigrams(model, ["<unk>", "<s>", "</s>"]), path, comment="made by a test")
    return path


@pytest.mark.parametrize("markers", [False, True])
@pytest.mark.parametrize("order", range(1, 7))
@pytest.mark.parametrize("name", [name for name in SMOOTHINGS if "kneser-ney" not in name])
def test_kenlm_agrees_in_silence(
    name: str, order: int, markers: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("kenlm", reason="KenLM is not installed here")
    path = write_model(tmp_path / "model.arpa", name, order, markers=markers)
    found = check_model(path)
    # C++ writes past sys.stderr: the file descriptors are what counts.
    assert capfd.readouterr() == ("", "")
    assert found.ok, found.sentence()
    assert found.tokens == 2000
    assert found.largest_difference is not None
    assert found.largest_difference <= 2e-6


def test_generated_streams_reach_every_order(tmp_path: Path) -> None:
    model = read_arpa(write_model(tmp_path / "model.arpa", "witten-bell", 4))
    words = generated_stream(model, 2000)
    digits = model.tables.digits(model.ids(words))
    _, answered = model.tables.find(Contexts(model.tables, digits, np.array([0])), digits)
    assert set(answered.tolist()) == {1, 2, 3, 4}


def test_check_sees_a_wrong_probability(tmp_path: Path) -> None:
    pytest.importorskip("kenlm", reason="KenLM is not installed here")
    path = write_model(tmp_path / "model.arpa", "witten-bell", 2)
    lines = path.read_text().split("\n")
    at = next(i for i, line in enumerate(lines) if line.endswith("\tw03 w04"))
    lines[at] = "-0.0001\tw03 w04"
    path.write_text("\n".join(lines))
    found = check_model(path)
    assert not found.ok
    assert found.worst_context == "w03"
    assert "FAIL (worst context: w03)" in found.sentence()


def test_order_seven_is_summed_but_not_compared(tmp_path: Path) -> None:
    path = write_model(tmp_path / "model.arpa", "witten-bell", 7)
    found = check_model(path)
    assert found.ok
    assert found.largest_difference is None
    with pytest.raises(LanguageModelError, match="order 7; KenLM scores orders up to 6; use the native scorer"):
        kenlm_scorer(path)


def test_without_kenlm_the_message_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_model(tmp_path / "model.arpa", "witten-bell", 2)
    monkeypatch.setitem(sys.modules, "kenlm", None)
    remedy = f"which is not installed: {sys.executable} -m pip install --force-reinstall ufal-kenlm"
    with pytest.raises(MissingExtraError, match=re.escape(f"needs the package kenlm, {remedy}")):
        check_model(path)


def test_what_kenlm_refuses_is_told_and_compared_through_a_copy(tmp_path: Path) -> None:
    pytest.importorskip("kenlm", reason="KenLM is not installed here")
    path = write_model(tmp_path / "model.arpa", "witten-bell", 2)
    path.write_text("made by hand\n" + path.read_text())
    found = check_model(path)
    assert found.ok
    assert found.largest_difference is not None
    assert f"KenLM refuses it ({path}:1: 'made by hand' found, " in found.sentence()


def test_empty_highest_orders_do_not_count(tmp_path: Path) -> None:
    pytest.importorskip("kenlm", reason="KenLM is not installed here")
    path = write_model(tmp_path / "model.arpa", "witten-bell", 2)
    header = "".join(f"ngram {n}=0\n" for n in range(3, 8))
    sections = "".join(f"\\{n}-grams:\n\n" for n in range(3, 8))
    text = path.read_text().replace("\n\n\\1-grams", f"\n{header}\n\\1-grams").replace("\\end\\", f"{sections}\\end\\")
    path.write_text(text)
    found = check_model(path)
    assert found.ok, found.sentence()
    assert (found.order, found.tokens) == (2, 2000)


def test_kenlm_s_own_complaint_names_the_file_and_the_reason(shared: Path) -> None:
    pytest.importorskip("kenlm", reason="KenLM is not installed here")
    path = shared / "arpa/many-suffix-bigrams-absent-3-of-4.arpa"
    with pytest.raises(LanguageModelError) as error:
        kenlm_scorer(path)
    assert str(error.value).startswith(f"{path}: KenLM cannot load it: Avoid pruning n-grams like")
    assert "search_hashed" not in str(error.value)
    assert "Avoid pruning" in check_model(path).sentence()
