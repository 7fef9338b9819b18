"""The small scripts of SRILM's manual pages: models, counts of counts, perplexities."""

import io
import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from placerec.lm import read_arpa
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.add_ppls import add_ppls
from placerec.srilm.tools.discount_scripts import (
    get_gt_counts,
    make_abs_discount,
    make_gt_discounts,
    make_kn_discounts,
)
from placerec.srilm.tools.lm_scripts import get_unigram_probs, make_sub_lm, sort_lm
from placerec.srilm.tools.make_big_lm import make_big_lm
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.subtract_ppls import subtract_ppls

Tool = Callable[[Sequence[str], Streams], int]
LM = """
\\data\\
ngram 1=3
ngram 2=3
ngram 3=1

\\1-grams:
-0.5\tb\t-0.2
-99\t<s>\t-0.1
-0.25\ta\t-0.3

\\2-grams:
-0.1\tb a\t-0.4
-0.2\ta b
-0.3\ta a

\\3-grams:
-0.05\tb a a

\\end\\
"""


def call(tool: Tool, *arguments: str, stdin: str = "") -> tuple[int, str, str]:
    streams = Streams(io.BytesIO(stdin.encode()), out := io.BytesIO(), err := io.BytesIO())
    status = tool(arguments, streams)
    return status, out.getvalue().decode("latin-1"), err.getvalue().decode("latin-1")


@pytest.fixture
def counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Counts of a text with as many rare words as texts have."""
    monkeypatch.chdir(tmp_path)
    rng = random.Random(5)
    words = [f"w{int(rng.paretovariate(0.6)) % 200}" for _ in range(3000)]
    text = "\n".join(" ".join(words[i : i + 9]) for i in range(0, len(words), 9))
    assert call(ngram_count, "-text", "-", "-sort", "-write", "all.counts", stdin=text)[0] == 0
    return tmp_path / "all.counts"


def test_sort_lm_sorts_by_the_first_word_and_changes_nothing_else() -> None:
    status, out, error = call(sort_lm, stdin=LM)
    assert (status, error) == (0, "")
    assert sorted(out.splitlines()) == sorted(LM.splitlines())
    assert re.findall(r"\t(.*?)(?:\t.*)?$", out, re.MULTILINE) == ["<s>", "a", "b", "a a", "a b", "b a", "b a a"]


def test_make_sub_lm_leaves_out_what_is_longer(tmp_path: Path) -> None:
    (tmp_path / "m.lm").write_text(LM)
    status, out, _ = call(make_sub_lm, "maxorder=2", str(tmp_path / "m.lm"))
    assert status == 0
    assert "ngram 3" not in out
    assert "3-grams" not in out
    assert "-0.1\tb a\n" in out
    (tmp_path / "sub.lm").write_text(out)
    assert read_arpa(tmp_path / "sub.lm").order == 2
    assert call(make_sub_lm, str(tmp_path / "m.lm"))[0] == 2


def test_unigrams_are_listed_with_their_probabilities() -> None:
    assert call(get_unigram_probs, stdin=LM)[1] == "b -0.5\n<s> -99\na -0.25\n"
    assert call(get_unigram_probs, "linear=1", stdin=LM)[1] == "b 0.316228\n<s> 0\na 0.562341\n"


@pytest.mark.parametrize("number", ["x", "nan", "999", "1e999"])
def test_what_is_no_log_probability_is_named(number: str) -> None:
    status, out, error = call(get_unigram_probs, "linear=1", stdin=LM.replace("-0.25", number))
    assert (status, out) == (1, "")
    assert error == f"get-unigram-probs: '{number}' of 'a' is no log probability\n"


@pytest.mark.parametrize("tool", [sort_lm, make_sub_lm, get_unigram_probs])
def test_what_is_no_model_is_refused_and_nothing_written(tool: Tool) -> None:
    for text, complaint in ((LM.replace("\\end\\", ""), "no \\end\\"), (LM.replace("a b", "a"), "is no 2-gram")):
        status, out, error = call(tool, "maxorder=3", "-", stdin=text)
        assert (status, out) == (1, "")
        assert complaint in error


def test_subtracted_from_a_sum_one_output_leaves_the_other(tmp_path: Path) -> None:
    one = "file a: 3 sentences, 10 words, 2 OOVs\n1 zeroprobs, logprob= -12.5 ppl= 17.7 ppl1= 60\n"
    other = "file b: 2 sentences, 7 words, 0 OOVs\n0 zeroprobs, logprob= -8.25 ppl= 8.3 ppl1= 15\n"
    (tmp_path / "one").write_text(one)
    (tmp_path / "other").write_text(other)
    (tmp_path / "both").write_text(call(add_ppls, str(tmp_path / "one"), str(tmp_path / "other"))[1])
    left = call(subtract_ppls, str(tmp_path / "both"), str(tmp_path / "other"))
    assert left == (0, call(add_ppls, str(tmp_path / "one"))[1], "")
    assert call(subtract_ppls)[0] == 2


@pytest.mark.parametrize(
    ("script", "least", "options"), [(make_gt_discounts, 1, ["max=7"]), (make_kn_discounts, 1, [])]
)
def test_parameters_made_in_steps_are_those_that_ngram_count_writes(
    script: Tool, least: int, options: list[str], counts: Path
) -> None:
    assert call(get_gt_counts, "max=20", "out=all", str(counts))[0] == 0
    kind, method = ("gt", []) if script is make_gt_discounts else ("kn", ["-kndiscount"])
    arguments = [
        "-read",
        str(counts),
        "-order",
        "2",
        *method,
        "-gt2min",
        str(least),
        "-gt2max",
        "7",
        f"-{kind}2",
        "own",
    ]
    assert call(ngram_count, *arguments)[0] == 0
    status, out, _ = call(script, *options, "all.gt2counts")
    assert (status, out) == (0, Path("own").read_text())


def test_the_absolute_discount_is_that_of_ney() -> None:
    assert call(make_abs_discount, "-", stdin="1 30\n2 10\n3 7\n") == (0, "0.6\n", "")
    status, out, error = call(make_abs_discount, "-", stdin="2 10\n")
    assert (status, out) == (1, "")
    assert "no n-gram occurs once" in error


@pytest.mark.parametrize("line", ["1", "a 2", "1 2 3", "-1 5", "99999999999 1", "1 99999999999999999999999"])
def test_a_line_that_is_no_count_of_counts_is_named(line: str) -> None:
    for script in (make_gt_discounts, make_kn_discounts, make_abs_discount):
        status, out, error = call(script, "-", stdin=f"1 3\n{line}\n")
        assert (status, out) == (1, "")
        assert "-: line 2: " in error


def test_make_big_lm_gives_the_model_of_all_counts(counts: Path) -> None:
    for options in (["-order", "3"], ["-order", "2", "-gt2min", "2"], ["-kndiscount"], ["-wbdiscount2", "-order", "2"]):
        assert call(make_big_lm, "-name", "aux", "-read", str(counts), "-lm", "big.lm", *options)[0] == 0
        assert call(ngram_count, "-read", str(counts), "-lm", "plain.lm", *options)[0] == 0
        assert Path("big.lm").read_text() == Path("plain.lm").read_text()
    assert Path("aux.gt1").exists()
    assert call(make_big_lm, "-read", str(counts), "-lm", "big.lm")[0] == 2
