"""ARPA files: what is written is read back, and what KenLM refuses is refused with its place."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.errors import LanguageModelError
from placerec.lm import (
    SMOOTHINGS,
    BackoffModel,
    count_ngrams,
    estimate,
    format_arpa,
    read_arpa,
    smoothing,
    with_unigrams,
    write_arpa,
)
from placerec.lm.arpa import as_printed
from placerec.lm.trie import Trie
from placerec.lm.vocabulary import Vocabulary

# Orders and markers that KenLM does not do without: rules of its own, not of the format.
KENLM_ONLY = {
    "unigram-only-model.arpa",
    "order-7.arpa",
    "bos-absent.arpa",
    "eos-absent.arpa",
    "many-suffix-bigrams-absent-3-of-4.arpa",
}
GOOD = (
    "\\data\\\nngram 1=3\nngram 2=1\n\n"
    "\\1-grams:\n-1\t<s>\t-0.3\n-0.5\ta\t-0.2\n-0.7\tb\n\n"
    "\\2-grams:\n-0.4\ta b\n\n\\end\\\n"
)


@settings(max_examples=30, deadline=None)
@given(
    name=st.sampled_from([name for name in SMOOTHINGS if "kneser-ney" not in name]),
    order=st.integers(1, 5),
    sentences=st.lists(st.lists(st.sampled_from(["a", "é", "b#", "\\c"]), max_size=8), max_size=5),
    markers=st.booleans(),
)
def test_what_is_written_is_read_back(
    name: str, order: int, sentences: list[list[str]], markers: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    counts = count_ngrams(sentences, order, vocabulary=["a", "é", "b#", "\\c"], markers=markers)
    model = with_unigrams(estimate(counts, smoothing(name)), ["<unk>", "</s>"])
    path = tmp_path_factory.getbasetemp() / "model.arpa.gz"
    write_arpa(model, path, comment="made by a test")
    back = read_arpa(path)
    assert back.words == model.words
    for n in range(order):
        assert np.array_equal(back.trie.keys[n], model.trie.keys[n])
        assert np.allclose(back.log10_probs[n], model.log10_probs[n], rtol=1e-6, atol=1e-6)
    assert format_arpa(back) == format_arpa(model)


def test_reader_is_as_strict_as_kenlm(shared: Path) -> None:
    cases = [json.loads(line) for line in (shared / "arpa/expected.jsonl").read_text().splitlines()]
    assert len(cases) > 60
    for case in cases:
        path = shared / "arpa" / case["file"]
        if case["kenlm"]["loads"] or case["file"] in KENLM_ONLY:
            model = read_arpa(path, tolerant=False)
            scores = case["kenlm"].get('full_scores of "a b a zzz" with <s> and </s>: log10 p, order, oov')
            if scores and "duplicate" not in case["file"]:
                # KenLM starts from <s>, so the first words are compared with that history.
                words = ["<s>", "a", "b", "a", "zzz", "</s>"]
                ours = [max(model.log10_p(word, words[:i]), -100) for i, word in enumerate(words) if i > 0]
                theirs = [-np.inf if p <= -99 else p for p, _, _ in scores]
                assert np.maximum(theirs, -100) == pytest.approx(ours, abs=2e-6), path.name
        else:
            with pytest.raises(LanguageModelError, match=path.name):
                read_arpa(path, tolerant=False)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-0.5\ta", "0.5\ta", ":7: log10 probability 0.5 is above 0"),
        ("-0.5\ta", "x\ta", ":7: log10 probability 'x' is not a number"),
        ("-0.5\ta", "-0_5\ta", ":7: log10 probability '-0_5' is not a number"),
        ("-0.5\ta", "-\u0661\ta", ":7: log10 probability '-\u0661' is not a number"),
        ("-0.5\ta", "\xa0-0.5\ta", ":7: log10 probability '\\xa0-0.5' is not a number"),
        ("ngram 2=1", "ngram 2=\u0661", ":3: 'ngram 2=\u0661' found, 'ngram 2=COUNT' expected"),
        ("ngram 2=1", "ngram 2=" + "1" * 5000, f":3: 'ngram 2={'1' * 32}' found, 'ngram 2=COUNT' expected"),
        ("-0.2\n", "inf\n", ":7: backoff weight inf is not finite"),
        ("ngram 2=1", "ngram 2=2", ":12: '' found, a number, 2 words and perhaps a tab and a weight expected"),
        ("ngram 1=3", "ngram 1=2", ":8: the header promises 2 1-grams, and there are more"),
        ("ngram 1=3", "ngram 2=3", ":2: 'ngram 2=3' found, 'ngram 1=COUNT' expected"),
        ("\\end\\", "\\3-grams:", ":13: '\\\\3-grams:' found, \\end\\ expected"),
        ("a b", "a z", ":11: the word 'z' is not among the 1-grams"),
        ("a b\n", "a b\t-0.1\n", ":11: backoff weight -0.1 on the highest order, which has none"),
        ("\\end\\\n", "", ":12: the file ends where \\end\\ is expected; is it truncated?"),
        ("\\data\\", "data", ":1: 'data' found, \\data\\ expected; is this an ARPA file?"),
        ("\\2-grams:", "\\3-grams:", ":10: '\\\\3-grams:' found, \\2-grams: expected"),
    ],
)
def test_errors_name_line_and_value(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.arpa"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(LanguageModelError) as error:
        read_arpa(path, tolerant=False)
    assert str(error.value) == f"{path}{message}"


def test_a_missing_context_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bad.arpa"
    text = GOOD.replace("ngram 2=1\n", "ngram 2=1\nngram 3=1\n").replace(
        "\\end\\", "\\3-grams:\n-0.1\tb a b\n\n\\end\\"
    )
    path.write_text(text)
    with pytest.raises(LanguageModelError, match=r":15: the context 'b a' is not among the 2-grams$"):
        read_arpa(path, tolerant=False)


# No model can be made of nan.
NOT_A_NUMBER = {"prob-nan.arpa", "backoff-nan.arpa"}


def test_what_ngram_reads_is_read_and_scored_alike_and_kenlm_is_told_of(
    shared: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cases = [json.loads(line) for line in (shared / "arpa/expected.jsonl").read_text().splitlines()]
    read = 0
    for case in cases:
        path = shared / "arpa" / case["file"]
        if case["srilm"]["exit"] or case["file"] in NOT_A_NUMBER:
            with pytest.raises(LanguageModelError, match=path.name):
                read_arpa(path)
            continue
        caplog.clear()
        model = read_arpa(path)
        read += 1
        told = any("KenLM would refuse the file" in record.message for record in caplog.records)
        assert told == (not case["kenlm"]["loads"] and case["file"] not in KENLM_ONLY), path.name
        scores = re.search(r"logprob= (\S+)", case["srilm"]["stdout"][1])
        if scores and told:
            assert model.perplexity([["a", "b", "a", "zzz"]]).log10_p == pytest.approx(float(scores[1])), path.name
    assert read > 55


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\\data\\", "made by hand\n\\data\\"),
        ("-0.5\ta\t-0.2", "  -0.5   a -0.2 "),
        ("a b\n", "a b\n\n## more\n"),
        ("ngram 1=3", "ngram  1=99"),
        ("\\end\\\n", "\\end\\\nthat was it\n"),
        ("a b\n", "a b\t-0.7\n"),
        ("\\1-grams:", "\\1-grams of the text"),
    ],
)
def test_the_same_model_written_otherwise_is_the_same_model(old: str, new: str, tmp_path: Path) -> None:
    plain, other = tmp_path / "plain.arpa", tmp_path / "other.arpa"
    plain.write_text(GOOD)
    assert old in GOOD
    other.write_text(GOOD.replace(old, new, 1))
    assert format_arpa(read_arpa(other)) == format_arpa(read_arpa(plain, tolerant=False))
    with pytest.raises(LanguageModelError, match=r"other\.arpa:\d+: "):
        read_arpa(other, tolerant=False)


def test_not_utf8_is_named(tmp_path: Path) -> None:
    path = tmp_path / "latin.arpa"
    path.write_bytes(GOOD.replace("a b", "\xe9 b").encode("latin-1"))
    with pytest.raises(LanguageModelError, match=r"latin\.arpa:11: byte 0xe9 is not UTF-8"):
        read_arpa(path)


def model_of(log10_probs: list[float]) -> BackoffModel:
    vocabulary = Vocabulary.of(f"w{i}" for i in range(len(log10_probs)))
    values = np.array(log10_probs, np.float32)
    return BackoffModel(Trie(vocabulary, (np.arange(len(values)),)), (values,), (values,))


@given(st.lists(st.floats(-98, 0, width=32), min_size=1, max_size=9))
def test_a_model_as_printed_is_that_of_its_file(values: list[float]) -> None:
    printed = as_printed(model_of(values))
    assert printed.log10_probs[0].tolist() == [np.float32(f"{value:.7g}") for value in values]
    assert printed.backoffs[0].tolist() == printed.log10_probs[0].tolist()


def test_what_is_no_number_is_printed_as_such() -> None:
    model = model_of([-np.inf, np.nan, 0, -99])
    assert np.array_equal(as_printed(model).log10_probs[0], model.log10_probs[0], equal_nan=True)
