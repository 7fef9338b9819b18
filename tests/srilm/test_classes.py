"""Classes of words: what ngram-class, ngram -classes and two scripts must keep to."""

import math
import random
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from helpers.srilm_runs import call

from placerec.lm.classes import ClassBigrams, Merger, class_log_likelihood

LM = """
\\data\\
ngram 1=5
ngram 2=4

\\1-grams:
-0.6\t</s>
-99\t<s>\t-0.2
-0.5\tA\t-0.1
-0.7\tB\t-0.3
-0.9\tx\t-0.2

\\2-grams:
-0.3\t<s> A
-0.4\tA B
-0.5\tB </s>
-0.2\tx A

\\end\\
"""


def random_bigrams(size: int, seed: int) -> tuple[np.ndarray, ClassBigrams]:
    rng = np.random.default_rng(seed)
    table = rng.poisson(0.7, (size, size))
    left, right = np.nonzero(table)
    unigrams = table.sum(axis=1) + 1
    return unigrams, ClassBigrams(unigrams, left, right, table[left, right])


@pytest.mark.parametrize("seed", range(4))
def test_costs_stay_what_the_likelihood_says_through_many_mergers(seed: int) -> None:
    words, bigrams = random_bigrams(9, seed)
    merger = Merger(bigrams, 8)
    # The last class is never a candidate, and is a neighbour all the same.
    for number in range(8):
        merger.add(number)
    while len(merger.active) > 1:
        before = class_log_likelihood(words, bigrams.merged(merger.target, 9))
        costs = {}
        for s, a in enumerate(merger.slots.tolist()):
            for t, b in enumerate(merger.slots.tolist()):
                if 0 <= a < b:
                    target = np.where(merger.target == b, a, merger.target)
                    costs[a, b] = class_log_likelihood(words, bigrams.merged(target, 9)) - before
                    assert merger.cost[s, t] == pytest.approx(costs[a, b], abs=1e-9)
                    assert merger.exact_cost(a, b) == pytest.approx(costs[a, b], abs=1e-9)
        kept, gone = merger.best()
        assert costs[kept, gone] == pytest.approx(max(costs.values()), abs=1e-9)
        merger.merge(kept, gone)


def test_of_equal_pairs_the_first_is_merged() -> None:
    # Two pairs of words that stand in the same places: merging either costs the same.
    left, right = np.array([0, 0, 0, 0, 1, 2, 3, 4]), np.array([1, 2, 3, 4, 0, 0, 0, 0])
    merger = Merger(ClassBigrams(np.array([8, 2, 2, 2, 2]), left, right, np.full(8, 2)), 4)
    for number in (4, 3, 2, 1):
        merger.add(number)
    assert merger.best() == (1, 2)


def test_classes_hold_each_word_once_and_their_shares_sum_to_one(tmp_path: Path) -> None:
    rng = random.Random(3)
    text = "\n".join(" ".join(rng.choices([f"w{i}" for i in range(40)], k=12)) for _ in range(60))
    for method in ("-full", "-incremental"):
        status, out, _ = call(
            "ngram-class", "-text", "-", "-numclasses", "7", method, "-classes", "-", stdin=text.encode()
        )
        assert status == 0
        rows = [line.split() for line in out.splitlines()]
        assert sorted(word for _, _, word in rows) == sorted(set(text.split()))
        total: Counter[str] = Counter()
        for name, p, _ in rows:
            total[name] += float(p)  # type: ignore[assignment]
        assert len(total) == 7
        assert all(value == pytest.approx(1) for value in total.values())


def test_no_more_classes_are_made_than_there_are_words() -> None:
    for wanted in ("0", "100000", "3"):
        _, out, _ = call("ngram-class", "-text", "-", "-numclasses", wanted, "-classes", "-", stdin=b"a b c\n")
        assert out == "CLASS-00001 1 a\nCLASS-00002 1 b\nCLASS-00003 1 c\n"


def test_what_cannot_be_classed_is_told_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("huge").write_text("a 9000000000000000\nb 9000000000000000\n")
    assert call("ngram-class", "-counts", "huge", "-classes", "c")[::2] == (
        1,
        "counts add up to more than 9007199254740992, the largest sum that ngram-class can work with\n",
    )
    Path("many").write_text("".join(f"w{i}\t1\n" for i in range(20001)))
    status, _, error = call("ngram-class", "-counts", "many", "-numclasses", "20000", "-classes", "c")
    assert status == 1
    assert error.startswith("ngram-class: -numclasses 20000: 20001 candidates among ")
    assert "ask for fewer classes" in error
    assert not Path("c").exists()


def model_files(folder: Path, classes: str) -> list[str]:
    (folder / "m.lm").write_text(LM)
    (folder / "m.cls").write_text(classes)
    return ["-lm", str(folder / "m.lm"), "-order", "2", "-classes", str(folder / "m.cls")]


def test_two_kinds_of_class_models_agree_where_each_word_is_of_one_class(tmp_path: Path) -> None:
    files = model_files(tmp_path, "A 0.25 a\nA 0.75 b\nB 1 c\n")
    text = b"a c\nb b x a\nunseen c\n"
    results = [call("ngram", *files, *more, "-ppl", "-", stdin=text)[1] for more in ([], ["-simple-classes"])]
    general, simple = ([float(word) for word in out.split() if "." in word] for out in results)
    assert general == pytest.approx(simple, rel=1e-5)


def test_a_word_is_explained_by_itself_and_by_its_classes(tmp_path: Path) -> None:
    files = model_files(tmp_path, "A 0.25 x\nA 0.75 b c\n")
    _, out, _ = call("ngram", *files, "-debug", "2", "-ppl", "-", stdin=b"x\nb c\n")
    first, _, second, third, _ = (float(p) for p in re.findall(r" (\S+) \[ \S+ \]$", out, re.MULTILINE))
    assert first == pytest.approx(10 ** (-0.2 - 0.9) + 0.25 * 10**-0.3, rel=1e-5)
    assert second == pytest.approx(0.75 * 10**-0.3, rel=1e-5)
    assert third == 1


def test_expanded_models_give_what_the_classes_give(tmp_path: Path) -> None:
    files = model_files(tmp_path, "A 0.25 a\nA 0.75 b\nB 1 c\n")
    expanded = tmp_path / "words.lm"
    assert call("ngram", *files, "-expand-classes", "2", "-write-lm", str(expanded))[0] == 0
    assert "A\t" not in expanded.read_text()
    # After words that are of one class alone the history is known.
    text = b"a c\nb c\n"
    _, by_classes, _ = call("ngram", *files, "-ppl", "-", stdin=text)
    _, by_words, _ = call("ngram", "-lm", str(expanded), "-order", "2", "-ppl", "-", stdin=text)
    numbers = [[float(word) for word in out.split() if "." in word] for out in (by_classes, by_words)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-5)


def test_a_class_that_contains_itself_ends(tmp_path: Path) -> None:
    files = model_files(tmp_path, "A 0.5 A a\nA 0.5 A\nB 1 A\n")
    for more in ([], ["-simple-classes"], ["-expand-classes", "0"], ["-expand-classes", "3", "-expand-exact", "2"]):
        status, out, _ = call("ngram", *files, *more, "-debug", "2", "-ppl", "-", stdin=b"A a A\n")
        assert status == 0
        assert "3 words" in out


@pytest.mark.parametrize("number", ["-1", "nan", "inf", "1e999"])
def test_what_is_no_probability_is_named(number: str, tmp_path: Path) -> None:
    files = model_files(tmp_path, f"B 1 c\nA {number} a\n")
    status, out, error = call("ngram", *files, "-ppl", "-", stdin=b"a\n")
    assert (status, out) == (1, "")
    assert f"m.cls: line 2: class probability {float(number):g}: a number of at least 0 is needed\n" in error


def test_too_many_expansions_are_refused_before_they_are_made(tmp_path: Path) -> None:
    files = model_files(tmp_path, "".join(f"{name} w{i}\n" for name in "AB" for i in range(3000)))
    written = tmp_path / "w.lm"
    status, _, error = call("ngram", *files, "-expand-classes", "0", "-write-lm", str(written))
    assert status == 1
    assert "-expand-classes 0: classes stand for words in more than 5000000 ways" in error
    assert not written.exists()


def test_written_models_carry_their_classes_and_are_read_with_them(tmp_path: Path) -> None:
    files = model_files(tmp_path, "B 1 c\nA 0.25 a d\nA .75 b\n")
    written = tmp_path / "w.lm"
    call("ngram", *files, "-write-lm", str(written))
    end = written.read_text().partition("\\end\\\n")[2]
    assert end == "\nA 0.2500000000000000 a d\nA 0.7500000000000000 b\nB 1.0000000000000000 c\n\n"
    again = ["-lm", str(written), "-order", "2", "-classes", "/dev/null"]
    text = b"a d c\nb c\n"
    assert call("ngram", *again, "-ppl", "-", stdin=text) == call("ngram", *files, "-ppl", "-", stdin=text)


def test_a_rescored_model_is_written_without_the_classes_that_scored_it(tmp_path: Path) -> None:
    files = model_files(tmp_path, "B 1 c\nA 0.25 a d\n")
    (tmp_path / "other.lm").write_text(LM)
    written = tmp_path / "w.lm"
    assert call("ngram", *files, "-rescore-ngram", str(tmp_path / "other.lm"), "-write-lm", str(written))[0] == 0
    assert written.read_text().endswith("\\end\\\n")


def test_expansions_may_be_longer_than_the_model_with_the_classes(tmp_path: Path) -> None:
    (tmp_path / "m.lm").write_text("\\data\\\nngram 1=3\n\n\\1-grams:\n-0.3\t</s>\n-99\t<s>\n-0.3\tA\n\n\\end\\\n")
    (tmp_path / "m.cls").write_text("A 0.5 a b\nA 0.5 a b c\n")
    files = ["-lm", str(tmp_path / "m.lm"), "-order", "1", "-classes", str(tmp_path / "m.cls")]
    status, out, error = call("ngram", *files, "-expand-classes", "0", "-debug", "4", "-write-lm", "-")
    assert status == 0
    assert "ngram 3=1\n" in out
    assert "writing 1 3-grams" in error


def test_sums_over_all_words_are_one(tmp_path: Path) -> None:
    text = tmp_path / "t"
    text.write_text("a b c\nb a c a\nc c b\n" * 9)
    counts, classes, model = (tmp_path / name for name in ("n", "c", "m"))
    call("ngram-class", "-text", str(text), "-numclasses", "2", "-class-counts", str(counts), "-classes", str(classes))
    arguments = ["-read", str(counts), "-order", "2", "-wbdiscount", "-lm", str(model)]
    assert call("ngram-count", *arguments)[0] == 0
    for more in ([], ["-simple-classes"]):
        arguments = [
            "-lm",
            str(model),
            "-order",
            "2",
            "-classes",
            str(classes),
            *more,
            "-debug",
            "3",
            "-ppl",
            str(text),
        ]
        _, out, error = call("ngram", *arguments)
        assert "warning" not in error
        sums = [float(line.split(" / ")[1]) for line in out.splitlines() if " / " in line]
        assert len(sums) > 100
        assert all(math.isclose(value, 1, abs_tol=1e-5) for value in sums)


def test_scripts_share_counts_among_what_classes_stand_for(tmp_path: Path) -> None:
    (tmp_path / "c").write_text("A 0.5 x\nA y z\nB q\n")
    out = tmp_path / "o"
    status, shown, _ = call(
        "replace-words-with-classes", f"classes={tmp_path / 'c'}", f"outfile={out}", "-", stdin=b"x y z q\n\ny x x\n"
    )
    assert (status, shown) == (0, "A A B\n\ny A A\n")
    assert out.read_text() == "A 0.666667 x\nA 0.333333 y z\nB 1 q\n"
    assert call("uniform-classes", str(tmp_path / "c"))[1] == "A 0.5 x\nA 0.5 y z\nB 1 q\n"
    assert call("replace-words-with-classes")[0] == 2


def test_expansions_too_long_to_be_expanded_are_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.lm").write_text("\\data\\\nngram 1=3\n\n\\1-grams:\n-0.3\tA\n-0.3\tb\n-99\t<s>\n\n\\end\\\n")
    Path("long.classes").write_text(f"A 1 {'a ' * 50_000}\n")
    arguments = ["ngram", "-lm", "m.lm", "-classes", "long.classes", "-write-lm", "out.lm", "-expand-classes"]
    status, out, error = call(*arguments, "0")
    assert (status, out) == (1, "")
    told = "classes stand for n-grams that have more than 20000000 words together; ask for shorter n-grams"
    assert error == f"-expand-classes 0: {told}\n"
    assert not Path("out.lm").exists()
    status, _, error = call(*arguments, "2")
    assert (status, error) == (0, "")
    assert "\ta a\n" in Path("out.lm").read_text()
