"""Inspection: numbers that can be added up by hand."""

import math
from pathlib import Path

import pytest

from placerec.errors import LanguageModelError
from placerec.lm.inspect import format_inspection, inspect_model

ARPA = """# made by hand
\\data\\
ngram 1=4
ngram 2=2

\\1-grams:
-99\t<s>
-0.5\ta\t-0.2
-0.3\tb\t-0.1
-1\tc

\\2-grams:
-0.4\ta b
-0.6\tb a

\\end\\
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "place.arpa"
    path.write_text(ARPA)
    return path


def test_steps_add_up(model: Path) -> None:
    found = inspect_model(model, ["a b", "b a c", "c a"])
    listed, backed_off, unknown_context = found["explained"]
    assert listed["log10_p"] == pytest.approx(-0.4)
    # Order 2 looks one word back: a c is not listed, so weight(a) + log10 p(c) = -0.2 - 1.
    assert backed_off["history"] == ["a"]
    assert backed_off["log10_p"] == pytest.approx(-1.2)
    assert [step["found"] for step in backed_off["steps"]] == [False, True]
    # c is no context of the model: nothing to pay for leaving it.
    assert unknown_context["log10_p"] == pytest.approx(-0.5)
    assert unknown_context["steps"][0]["context_listed"] is False


def test_text_shows_the_sum(model: Path) -> None:
    text = format_inspection(inspect_model(model, ["b a c"]))
    assert "# made by hand" in text
    assert "4 of order 1, 2 of order 2" in text
    assert "'a c' is not listed: back off from 'a', weight -0.2" in text
    assert "log10 p = -0.2 + -1 = -1.2, p = 0.06309573" in text


def test_most_frequent_by_joint_probability(model: Path) -> None:
    one, two = inspect_model(model, top=2)["most_frequent"]
    assert [entry["ngram"] for entry in one] == ["b", "a"]
    # p(a) p(b|a) = 10^-0.9, p(b) p(a|b) = 10^-0.9: equal, so the order of the words decides.
    assert [entry["p"] for entry in two] == pytest.approx([10**-0.9] * 2, rel=1e-6)


def test_words_that_are_not_listed_are_named(model: Path) -> None:
    with pytest.raises(LanguageModelError, match=r"place\.arpa: the word 'zebra' is not in the model"):
        inspect_model(model, ["a zebra"])


def test_weights_beyond_float64_are_infinite(model: Path) -> None:
    model.write_text(ARPA.replace("-0.2\n", "846\n"))
    found = inspect_model(model, ["a c"])
    assert found["highest_sum"] == math.inf
    assert found["explained"][0]["p"] == math.inf
    assert "sums to" in format_inspection(found)


def test_the_most_probable_words_after_an_ngram_are_shown(model: Path) -> None:
    (explained,) = inspect_model(model, ["b a"], top=2)["explained"]
    assert [entry["word"] for entry in explained["next"]] == ["b", "a"]
    assert [entry["p"] for entry in explained["next"]] == pytest.approx([10**-0.4, 10**-0.7])
    text = format_inspection(inspect_model(model, ["b a"], top=1))
    assert "most probable after 'b a'\n  0.398107     b" in text
    assert "most probable" not in format_inspection(inspect_model(model, ["b a"], top=0)).partition("p(a | b)")[2]


def test_a_file_of_others_is_shown_with_what_kenlm_refuses(model: Path) -> None:
    model.write_text("by hand\n" + ARPA.replace("ngram 2=2\n", "ngram 2=2\nngram 7=0\n"))
    found = inspect_model(model)
    assert (found["order"], found["ngrams_per_order"]) == (2, [4, 2])
    assert f"KenLM refuses it: {model}:1: 'by hand' found" in format_inspection(found)
