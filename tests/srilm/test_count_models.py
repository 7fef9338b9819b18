"""Count models: EM by hand."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from helpers.srilm_runs import call

MODEL = "order 2\nvocabsize 3\ntotalcount 10\nmixweights 1\n 0.4 0.3\n 0.6 0.5\ncounts c.counts\n"
COUNTS = {"a": 5, "b": 3, "</s>": 2, "a b": 3, "a a": 1, "b </s>": 2, "<s> a": 2, "<s>": 2}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("i.lm").write_text(MODEL)
    Path("c.counts").write_text("".join(f"{ngram}\t{count}\n" for ngram, count in COUNTS.items()))
    Path("t.txt").write_text("a b\n")
    return tmp_path


def p(word: str, context: str, weights: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """The probability by hand, and those of orders 0 and 1."""
    single = weights[1][0] * COUNTS.get(word, 0) / 10 + (1 - weights[1][0]) / 3
    seen = COUNTS.get(context, 0)
    weight = weights[min(1, seen)][1]
    ratio = COUNTS.get(f"{context} {word}", 0) / seen if seen else 0
    return weight * ratio + (1 - weight) * single, 1 / 3, single


def test_scores_are_weighted_relative_frequencies(folder: Path) -> None:
    weights = [[0.4, 0.3], [0.6, 0.5]]
    expected = sum(math.log10(p(w, c, weights)[0]) for c, w in (("<s>", "a"), ("a", "b"), ("b", "</s>")))
    _, out, _ = call("ngram", "-count-lm", "-lm", "i.lm", "-order", "2", "-ppl", "t.txt")
    assert float(out.split("logprob= ")[1].split()[0]) == pytest.approx(expected, abs=1e-6)


def test_em_shares_what_each_order_answers_and_never_makes_the_text_less_likely(folder: Path) -> None:
    status, _, err = call(
        "ngram-count", "-count-lm", "-init-lm", "i.lm", "-text", "t.txt", "-order", "2", "-lm", "o", "-em-iters", "1"
    )
    assert status == 0
    weights, taken = [[0.4, 0.3], [0.6, 0.5]], 0.0
    for context, word in (("<s>", "a"), ("a", "b"), ("b", "</s>")):
        whole, _, single = p(word, context, weights)
        taken += (whole - 0.5 * single) / whole
    rows = [[float(x) for x in line.split()] for line in Path("o").read_text().splitlines() if line.startswith(" ")]
    assert rows[1][1] == pytest.approx(taken / 3)
    assert rows[0] == [0.4, 0.3]
    _, _, err = call("ngram-count", "-count-lm", "-init-lm", "o", "-text", "t.txt", "-order", "2", "-lm", "o2")
    steps = [float(line.split()[-1]) for line in err.splitlines() if line.startswith("iteration")]
    assert len(steps) > 1
    assert steps == sorted(steps)


def test_what_is_written_scores_alike(folder: Path) -> None:
    scored = call(
        "ngram", "-count-lm", "-lm", "i.lm", "-order", "2", "-ppl", "t.txt", "-write-lm", "w.lm", "-debug", "2"
    )
    Path("c.counts").unlink()
    assert call("ngram", "-count-lm", "-lm", "w.lm", "-order", "2", "-ppl", "t.txt", "-debug", "2") == scored
    call("ngram", "-count-lm", "-lm", "w.lm", "-order", "2", "-write-lm", "again.lm")
    assert Path("again.lm").read_text() == Path("w.lm").read_text()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.4 0.3", "0.4", "i.lm: line 5: incomplete mixture weight vector"),
        ("0.4 0.3", "0.4 1.5", "i.lm: line 5: mixture weights are numbers between 0 and 1"),
        ("mixweights 1", "mixweights 999999999999", "i.lm: line 4: mixweights needs a whole number"),
        ("totalcount 10", "totalcount ten", "i.lm: line 3: totalcount needs a whole number"),
        ("order 2", "orders 2", "i.lm: line 1: unknown keyword"),
        ("order 2", "order 2\ncountmodulus 0", "i.lm: line 2: countmodulus needs a whole number above 0"),
    ],
)
def test_a_model_that_cannot_be_used_is_refused_by_line(old: str, new: str, message: str, folder: Path) -> None:
    Path("i.lm").write_text(MODEL.replace(old, new))
    status, out, err = call("ngram", "-count-lm", "-lm", "i.lm", "-order", "2", "-ppl", "t.txt")
    assert (status, out, err) == (1, "", f"{message}\nformat error in count-lm filei.lm\n")


def test_a_missing_counts_file_is_named_and_nothing_is_written(folder: Path) -> None:
    Path("c.counts").unlink()
    status, _, err = call("ngram", "-count-lm", "-lm", "i.lm", "-order", "2", "-write-lm", "w.lm")
    assert (status, err) == (1, "c.counts: No such file or directory\n")
    assert not Path("w.lm").exists()
    assert call("ngram", "-count-lm", "-lm", "i.lm", "-mix-lm", "i.lm")[0] == 2
