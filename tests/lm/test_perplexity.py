"""Totals and ranks of scored text, by hand."""

import io
import re
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from placerec.errors import LanguageModelError
from placerec.lm import count_ngrams, estimate, smoothing, with_unigrams, write_arpa
from placerec.lm.perplexity import Totals, rank, rank_word, tally_sentences
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram import ngram

ZERO = -np.inf


def test_words_without_probability_are_counted_not_penalised() -> None:
    log10_p = np.array([-1, ZERO, ZERO, -2], np.float32)
    unknown = np.array([False, True, False, False])
    (row,) = tally_sentences(log10_p, unknown, np.ones(4, bool), np.array([4]), np.array([True]))
    totals = Totals(*row.tolist())
    assert totals == Totals(sentences=1, words=3, oovs=1, zeroprobs=1, log10_p=-3)
    assert totals.ppl == pytest.approx(10 ** (3 / 2))
    assert totals.ppl1 == pytest.approx(10**3)


def test_nothing_predicted_has_no_perplexity() -> None:
    assert Totals(sentences=1, words=1, oovs=1, log10_p=-1).ppl == pytest.approx(10)
    assert Totals(sentences=1, words=1, oovs=1, log10_p=-1).ppl1 is None
    assert Totals(words=2, oovs=2).ppl is None


def test_sentences_sum_up_to_the_text() -> None:
    log10_p = np.array([-1, -2, -8, ZERO, -4], np.float32)
    scored, lengths = np.arange(5) != 2, np.array([2, 0, 3])
    rows = tally_sentences(log10_p, np.zeros(5, bool), scored, lengths, np.array([True, False, True]))
    assert rows.tolist() == [[1, 1, 0, 0, -3], [0, 0, 0, 0, 0], [1, 1, 0, 1, -4]]
    total = reduce(Totals.plus, (Totals(*row) for row in rows.tolist()))
    assert total == Totals(2, 2, 0, 1, -7)
    assert total.times(2) == Totals(4, 4, 0, 2, -14)


def test_a_model_measures_text_as_ngram_does(tmp_path: Path) -> None:
    model = estimate(count_ngrams([["a", "b"], ["b"], ["a", "a", "c"]], 3), smoothing("witten-bell"))
    sentences = [["a", "b"], ["zzz"], [], ["c", "zzz", "a", "c"]]
    totals = model.perplexity(sentences)
    assert repr(totals[:4]) == "(4, 7, 2, 0)"  # counts, and no floats
    marked = [["<s>", *sentence, "</s>"] for sentence in sentences]
    assert totals.log10_p == pytest.approx(
        sum(p for words in marked for p in model.score(words)[1:].tolist() if p > ZERO), rel=1e-6
    )
    write_arpa(with_unigrams(model, ["<unk>"]), tmp_path / "m.arpa")
    (tmp_path / "text").write_text("".join(" ".join(sentence) + "\n" for sentence in sentences if sentence))
    out = io.BytesIO()
    arguments = ["-order", "3", "-lm", str(tmp_path / "m.arpa"), "-ppl", str(tmp_path / "text")]
    assert ngram(arguments, Streams(io.BytesIO(), out, io.BytesIO())) == 0
    # ngram leaves empty lines out.
    totals = model.perplexity([sentence for sentence in sentences if sentence])
    shown = f"logprob= {totals.log10_p:.6g} ppl= {totals.ppl:.6g} ppl1= {totals.ppl1:.6g}"
    told = re.sub(r"= (\S+)", lambda match: f"= {float(match[1]):.6g}", out.getvalue().decode().split("zeroprobs, ")[1])
    assert told == shown + "\n"


def test_perplexity_takes_lists_of_words() -> None:
    model = estimate(count_ngrams([["a", "b"]], 2), smoothing("witten-bell"))
    for sentences in ("a b", ["a b"]):
        with pytest.raises(LanguageModelError, match="a list of words, not a string"):
            model.perplexity(sentences)


def test_of_equals_half_come_before() -> None:
    p = np.array([0.4, 0.2, 0.2, 0.1, 0.1])
    assert [rank(value, p) for value in (0.4, 0.2, 0.1, 0.0)] == [0, 2, 4, 5]


def test_ranks_tell_words_from_sentence_ends() -> None:
    everyone = np.log10(np.array([0.5, 0.3, 0.2])).astype(np.float32)
    word = rank_word(float(everyone[0]), everyone, known=True, end=False, weight=2)
    assert (word.words, word.tokens) == (2, 2)
    assert (word.leading, word.leading_words) == ((2, 2, 2), (2, 2, 2))
    assert word.absolute == pytest.approx(1)
    end = rank_word(float(everyone[2]), everyone, known=True, end=True)
    assert (end.words, end.tokens, end.leading, end.leading_words) == (0, 1, (0, 1, 1), (0, 0, 0))
    assert word.plus(end).square == pytest.approx(2 * 0.25 + 0.64)


def test_an_unknown_word_costs_nothing_and_a_known_one_everything() -> None:
    everyone = np.log10(np.array([0.5, 0.5])).astype(np.float32)
    assert rank_word(ZERO, everyone, known=False, end=False).absolute == 0
    assert rank_word(ZERO, everyone, known=True, end=False).absolute == 1
