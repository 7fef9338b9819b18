"""The small scripts of SRILM's manual pages: models, counts of counts, perplexities."""

import gzip
import os
import random
import re
from pathlib import Path

import pytest
from helpers.srilm_runs import call

from placerec.lm import read_arpa

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


@pytest.fixture
def counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Counts of a text with as many rare words as texts have."""
    monkeypatch.chdir(tmp_path)
    rng = random.Random(5)
    words = [f"w{int(rng.paretovariate(0.6)) % 200}" for _ in range(3000)]
    text = "\n".join(" ".join(words[i : i + 9]) for i in range(0, len(words), 9))
    assert call("ngram-count", "-text", "-", "-sort", "-write", "all.counts", stdin=text.encode())[0] == 0
    return tmp_path / "all.counts"


def test_sort_lm_sorts_by_the_first_word_and_changes_nothing_else() -> None:
    status, out, error = call("sort-lm", stdin=LM.encode())
    assert (status, error) == (0, "")
    assert sorted(out.splitlines()) == sorted(LM.splitlines())
    assert re.findall(r"\t(.*?)(?:\t.*)?$", out, re.MULTILINE) == ["<s>", "a", "b", "a a", "a b", "b a", "b a a"]


def test_make_sub_lm_leaves_out_what_is_longer(tmp_path: Path) -> None:
    (tmp_path / "m.lm").write_text(LM)
    status, out, _ = call("make-sub-lm", "maxorder=2", str(tmp_path / "m.lm"))
    assert status == 0
    assert "ngram 3" not in out
    assert "3-grams" not in out
    assert "-0.1\tb a\n" in out
    (tmp_path / "sub.lm").write_text(out)
    assert read_arpa(tmp_path / "sub.lm").order == 2
    assert call("make-sub-lm", str(tmp_path / "m.lm"))[0] == 2


def test_unigrams_are_listed_with_their_probabilities() -> None:
    assert call("get-unigram-probs", stdin=LM.encode())[1] == "b -0.5\n<s> -99\na -0.25\n"
    assert call("get-unigram-probs", "linear=1", stdin=LM.encode())[1] == "b 0.316228\n<s> 0\na 0.562341\n"


@pytest.mark.parametrize("number", ["x", "nan", "999", "1e999"])
def test_what_is_no_log_probability_is_named(number: str) -> None:
    status, out, error = call("get-unigram-probs", "linear=1", stdin=LM.replace("-0.25", number).encode())
    assert (status, out) == (1, "")
    assert error == f"get-unigram-probs: '{number}' of 'a' is no log probability\n"


@pytest.mark.parametrize("tool", ["sort-lm", "make-sub-lm", "get-unigram-probs"])
def test_what_is_no_model_is_refused_and_nothing_written(tool: str) -> None:
    for text, complaint in ((LM.replace("\\end\\", ""), "no \\end\\"), (LM.replace("a b", "a"), "is no 2-gram")):
        status, out, error = call(tool, "maxorder=3", "-", stdin=text.encode())
        assert (status, out) == (1, "")
        assert complaint in error


def test_subtracted_from_a_sum_one_output_leaves_the_other(tmp_path: Path) -> None:
    one = "file a: 3 sentences, 10 words, 2 OOVs\n1 zeroprobs, logprob= -12.5 ppl= 17.7 ppl1= 60\n"
    other = "file b: 2 sentences, 7 words, 0 OOVs\n0 zeroprobs, logprob= -8.25 ppl= 8.3 ppl1= 15\n"
    (tmp_path / "one").write_text(one)
    (tmp_path / "other").write_text(other)
    (tmp_path / "both").write_text(call("add-ppls", str(tmp_path / "one"), str(tmp_path / "other"))[1])
    left = call("subtract-ppls", str(tmp_path / "both"), str(tmp_path / "other"))
    assert left == (0, call("add-ppls", str(tmp_path / "one"))[1], "")
    assert call("subtract-ppls")[0] == 2


@pytest.mark.parametrize(
    ("script", "least", "options"), [("make-gt-discounts", 1, ["max=7"]), ("make-kn-discounts", 1, [])]
)
def test_parameters_made_in_steps_are_those_that_ngram_count_writes(
    script: str, least: int, options: list[str], counts: Path
) -> None:
    assert call("get-gt-counts", "max=20", "out=all", str(counts))[0] == 0
    kind, method = ("gt", []) if script == "make-gt-discounts" else ("kn", ["-kndiscount"])
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
    assert call("ngram-count", *arguments)[0] == 0
    status, out, _ = call(script, *options, "all.gt2counts")
    assert (status, out) == (0, Path("own").read_text())


def test_the_absolute_discount_is_that_of_ney() -> None:
    assert call("make-abs-discount", "-", stdin=b"1 30\n2 10\n3 7\n") == (0, "0.6\n", "")
    status, out, error = call("make-abs-discount", "-", stdin=b"2 10\n")
    assert (status, out) == (1, "")
    assert "no n-gram occurs once" in error


@pytest.mark.parametrize("line", ["1", "a 2", "1 2 3", "-1 5", "99999999999 1", "1 99999999999999999999999"])
def test_a_line_that_is_no_count_of_counts_is_named(line: str) -> None:
    for script in ("make-gt-discounts", "make-kn-discounts", "make-abs-discount"):
        status, out, error = call(script, "-", stdin=f"1 3\n{line}\n".encode())
        assert (status, out) == (1, "")
        assert "-: line 2: " in error


def test_make_big_lm_gives_the_model_of_all_counts(counts: Path) -> None:
    for options in (["-order", "3"], ["-order", "2", "-gt2min", "2"], ["-kndiscount"], ["-wbdiscount2", "-order", "2"]):
        assert call("make-big-lm", "-name", "aux", "-read", str(counts), "-lm", "big.lm", *options)[0] == 0
        assert call("ngram-count", "-read", str(counts), "-lm", "plain.lm", *options)[0] == 0
        assert Path("big.lm").read_text() == Path("plain.lm").read_text()
    assert Path("aux.gt1").exists()
    assert call("make-big-lm", "-read", str(counts), "-lm", "big.lm")[0] == 2


def test_a_big_model_of_several_files_is_that_of_their_sum(counts: Path) -> None:
    lines = counts.read_text().splitlines(keepends=True)
    Path("odd.counts").write_text("".join(lines[::2]).removesuffix("\n"))
    Path("even.counts.gz").write_bytes(gzip.compress("".join(lines[1::2]).encode()))
    for options in (["-order", "3"], ["-wbdiscount"], ["-ngram-filter", "sed s/w7/x7/g"]):
        plain = ["-read", str(counts), "-lm", "plain.lm"]
        if options[0] == "-ngram-filter":
            plain[1] = "mapped"
            Path("mapped").write_text("".join(line.replace("w7", "x7") for line in lines))
        both = ["-read", "odd.counts", "-read", "even.counts.gz"]
        assert call("make-big-lm", "-name", "aux", *both, "-lm", "big.lm", *options)[0] == 0
        assert call("ngram-count", *plain, *(options if options[0] != "-ngram-filter" else []))[0] == 0
        assert Path("big.lm").read_text() == Path("plain.lm").read_text()


@pytest.fixture
def texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Five texts, one packed, one without a line end, and a list of them; all of them in all.txt."""
    monkeypatch.chdir(tmp_path)
    whole = [f"a b c{i}\nb c{i} a\n" for i in range(5)]
    Path("all.txt").write_text("".join(whole))
    for i, text in enumerate(whole):
        Path(f"t{i}").write_text(text)
    Path("t3").write_text(whole[3].removesuffix("\n"))
    Path("t4.gz").write_bytes(gzip.compress(whole[4].encode()))
    Path("words").write_text("a\nb\n" + "".join(f"c{i}\n" for i in range(5)))
    Path("list").write_text("# texts\nt0\nt1\n\nt2\nt3\nt4.gz\n")
    return tmp_path


@pytest.mark.parametrize("size", ["1", "2", "9"])
def test_counts_of_batches_are_merged_to_those_of_all_texts(texts: Path, size: str) -> None:
    assert call("make-batch-counts", "list", size, "cat", "c", "-order", "2")[0] == 0
    assert call("merge-batch-counts", "c")[::2] == (0, f"final counts in c/{(left := os.listdir('c')[0])}\n")
    assert os.listdir("c") == [left]
    assert left == {"1": "merge-iter3-1.ngrams.gz", "2": "merge-iter2-1.ngrams.gz", "9": "batch-1.ngrams.gz"}[size]
    expected = call("ngram-count", "-text", "all.txt", "-order", "2", "-sort")[1]
    assert gzip.decompress(Path("c", left).read_bytes()).decode() == expected


def test_more_batches_than_a_process_may_open_files_are_merged(texts: Path) -> None:
    names = []
    for i in range(130):
        Path(f"n{i}").write_text(f"x{i}\ny\n")
        names.append(f"n{i}\n")
    Path("many").write_text("".join(names))
    assert call("make-batch-counts", "many", "1", "cat", "c", "-order", "1")[0] == 0
    assert call("merge-batch-counts", "-l", "130", "c")[0] == 0
    merged = gzip.decompress(Path("c/merge-iter1-1.ngrams.gz").read_bytes()).decode().splitlines()
    assert {"y\t130", "x129\t1", "</s>\t260"} <= set(merged)
    assert len(merged) == 133
    assert os.listdir("c") == ["merge-iter1-1.ngrams.gz"]


def test_listed_counts_are_merged_and_stay(texts: Path) -> None:
    for name in ("t0", "t1"):
        assert call("ngram-count", "-text", name, "-sort", "-write", f"{name}.counts")[0] == 0
    Path("of").write_text("t0.counts\nt1.counts\n")
    assert call("merge-batch-counts", "-float-counts", "c", "of")[0] == 0
    assert Path("t0.counts").exists()
    assert "</s>\t4\n" in gzip.decompress(Path("c/merge-iter1-1.ngrams.gz").read_bytes()).decode()


def test_a_filter_conditions_the_texts_of_a_batch(texts: Path) -> None:
    assert call("make-batch-counts", "list", "10", "tr a-z A-Z | head -n 3", "c", "-order", "1")[0] == 0
    counted = gzip.decompress(Path("c/batch-1.ngrams.gz").read_bytes()).decode()
    assert counted == "</s>\t3\n<s>\t3\nA\t3\nB\t3\nC0\t2\nC1\t1\n"


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        (["list", "0"], 2, "batch size 0: a number above 0 is needed"),
        (["nothing"], 1, "nothing: No such file or directory"),
        (["empty"], 1, "empty: no texts are listed"),
        (["gone"], 1, "gone.txt: No such file or directory"),
        (["nul"], 1, "'t0\\x00' is no file name"),
        (["list", "2", "exit 3"], 1, "the filter 'exit 3' ended with status 3"),
        (["list", "2", "cat", "all.txt"], 1, "all.txt: "),
    ],
)
def test_a_batch_that_cannot_be_counted_leaves_no_counts(
    texts: Path, arguments: list[str], status: int, complaint: str
) -> None:
    Path("empty").write_text("# nothing\n")
    Path("gone").write_text("t0\ngone.txt\n")
    Path("nul").write_text("t0\0\n")
    found, _, error = call("make-batch-counts", *arguments)
    assert (found, complaint in error) == (status, True), error
    assert not list(Path().glob("counts/*"))


def test_counts_of_an_older_run_are_not_mixed_in(texts: Path) -> None:
    assert call("make-batch-counts", "list", "2")[0] == 0
    status, _, error = call("make-batch-counts", "list", "5")
    assert status == 1
    assert "counts/batch-2.ngrams.gz is of a run with more batches" in error
    assert call("merge-batch-counts", "counts")[0] == 0
    for size in ("9", "1"):
        assert call("make-batch-counts", "list", size)[0] == 0
        left = set(os.listdir("counts"))
        status, _, error = call("merge-batch-counts", "counts")
        assert (status, set(os.listdir("counts"))) == (1, left)
        assert "counts/merge-iter2-1.ngrams.gz is of a run with other batches" in error
    Path("counts/merge-iter2-1.ngrams.gz").unlink()
    assert call("merge-batch-counts", "counts")[0] == 0
    assert os.listdir("counts") == ["merge-iter3-1.ngrams.gz"]
    assert call("merge-batch-counts", "nowhere")[::2] == (
        1,
        "merge-batch-counts: nowhere: no counts to merge; see make-batch-counts\n",
    )
    assert call("merge-batch-counts", "-l", "1", "counts")[0] == 2
    assert call("merge-batch-counts", "-x", "counts")[0] == 2


def test_a_model_that_is_reversed_scores_sentences_backwards(texts: Path) -> None:
    Path("back.txt").write_text(
        "".join(" ".join(reversed(line.split())) + "\n" for line in Path("all.txt").read_text().splitlines())
    )
    assert call("ngram-count", "-text", "t1", "-order", "2", "-wbdiscount", "-vocab", "words", "-lm", "m.lm")[0] == 0
    status, reversed_model, error = call("reverse-lm", "m.lm")
    assert (status, error) == (0, "")
    Path("r.lm").write_text(reversed_model)
    found = [
        call("ngram", "-order", "2", "-lm", lm, "-ppl", text)[1]
        for lm, text in (("m.lm", "all.txt"), ("r.lm", "back.txt"))
    ]
    totals = [re.findall(r"[-\d.]+", text.partition(":")[2]) for text in found]
    assert [float(n) for n in totals[1]] == pytest.approx([float(n) for n in totals[0]], rel=1e-5)
    Path("inf.lm").write_text(Path("m.lm").read_text().replace("-99\t<s>", "-inf\t<s>"))
    assert "-inf" in Path("inf.lm").read_text()
    assert call("reverse-lm", "inf.lm") == (0, reversed_model, "")
    assert call("reverse-lm", stdin=LM.encode())[::2] == (
        1,
        "reverse-lm: only bigram models are reversed; see make-sub-lm maxorder=2\n",
    )


def scored(model: str, text: str) -> str:
    """What `ngram -debug 2` says of a text."""
    status, out, _ = call("ngram", "-lm", model, "-ppl", text, "-debug", "2")
    assert status == 0
    return out


def test_totals_of_all_tokens_are_those_of_the_text(texts: Path) -> None:
    assert call("ngram-count", "-text", "t1", "-order", "2", "-wbdiscount", "-lm", "m.lm")[0] == 0
    log = scored("m.lm", "all.txt")
    expected = log.rpartition("file all.txt: ")[2]
    assert "10 sentences, 30 words, 8 OOVs\n" in expected
    status, out, error = call("ppl-from-log", stdin=log.encode())
    assert (status, error) == (0, "")
    assert re.sub(r"\S*\d", "", out) == re.sub(r"\S*\d", "", expected)
    numbers = [[float(number) for number in re.findall(r" (-?\d\S*)", " " + text)] for text in (out, expected)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-6)
    ends = "".join(line for line in log.splitlines(keepends=True) if line.startswith("\tp( </s>"))
    out = call("ppl-from-log", stdin=ends.encode())[1]
    assert out.startswith("10 sentences, 0 words, 0 OOVs\n0 zeroprobs, logprob= -")
    assert call("ppl-from-log")[1] == "0 sentences, 0 words, 0 OOVs\n"


def test_two_models_are_compared_token_by_token(texts: Path) -> None:
    lines = [f"\tp( {word} | a ...) \t= [1gram] 0.5 [ {{}} ]\n" for word in "abcd"]
    Path("one").write_text("".join(lines).format("-1", "-1", "-inf", "-inf"))
    Path("two").write_text("".join(lines).format("-1.5", "-0.99", "-inf", "-2"))
    assert call("compare-ppls", "one", "two")[1] == "total 4, equal 1, higher 2, lower 1\n"
    assert call("compare-ppls", "mindelta=0.1", "one", "two")[1] == "total 4, equal 2, higher 1, lower 1\n"
    assert call("compare-ppls", "mindelta=x", "one", "two")[0] == 2
    assert call("compare-ppls", "one")[0] == 2
    Path("two").write_text("".join(lines[:3]).format("-1", "-1", "-1"))
    status, out, error = call("compare-ppls", "one", "two")
    assert (status, out) == (1, "")
    assert error == "compare-ppls: one and two are not of one text (token 4: d and none)\n"
    Path("two").write_text("\tp( a | ) \t= [1gram] 0.5 [ x ]\n")
    assert "two: line 1: 'p( a | ) \\t= [1gram] 0.5 [ x ]' has no log probability" in call("ppl-from-log", "two")[2]


def test_a_vocabulary_is_selected_by_what_makes_a_text_probable(texts: Path) -> None:
    Path("near.txt").write_text("a a a b\n")
    Path("far.counts").write_text("c\t3\nd 1\nc d\t5\n")
    Path("m.lm").write_text(LM)
    Path("held.txt").write_text("a b a\n")
    status, out, error = call("select-vocab", "-heldout", "held.txt", "-scale", "100", "near.txt", "far.counts", "m.lm")
    assert status == 0
    weights = {word: float(weight) for word, weight in (line.split("\t") for line in out.splitlines())}
    assert set(weights) == {"a", "b", "c", "d"}
    assert sum(weights.values()) == pytest.approx(100)
    assert weights["a"] > weights["b"] > 10 > weights["c"] == pytest.approx(3 * weights["d"])
    assert "weights: near.txt " in error
    assert call("select-vocab", "-quiet", "-heldout", "held.txt", "near.txt") == (
        0,
        "a\t750000.000000\nb\t250000.000000\n",
        "",
    )
    Path("zero.counts").write_text("a\t0\nb\t2\n")
    out = call("select-vocab", "-quiet", "-heldout", "held.txt", "zero.counts")[1]
    assert out == "a\t0.000000\nb\t1000000.000000\n"
    Path("x.sentid").write_text("id1 a\nid2 b b b\n")
    assert call("select-vocab", "-quiet", "-heldout", "held.txt", "x.sentid")[1].startswith("a\t250000.")
    assert call("select-vocab", "near.txt")[0] == 2
