"""Random texts, options and models, where the specification lets us know the answer without the reference tools."""

import itertools
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.ngram_merge import ngram_merge

WORDS = ("a", "b", "c", "d", "e" * 9, "<unk>", "-pau-", "a-b", "\xe9")
lines = st.lists(st.sampled_from(WORDS), min_size=1, max_size=8).map(" ".join)
texts = st.lists(lines, min_size=1, max_size=12).map(lambda found: "".join(f"{line}\n" for line in found))
methods = st.sampled_from(("-wbdiscount", "-cdiscount 0.5", "-addsmooth 0.3", "-wbdiscount -interpolate", ""))
orders = st.integers(1, 4)
changes = st.sampled_from(("-prune 1e-3", "-prune-lowprobs", "-renorm", "-minbackoff 0.1 -renorm"))
TOOLS = {"ngram-count": ngram_count, "ngram": ngram, "ngram-merge": ngram_merge}


def run(command: str, stdin: str = "") -> tuple[int, str, str]:
    """The status, output and messages of a tool that reads standard input."""
    tool, *arguments = command.split()
    out, err = BytesIO(), BytesIO()
    status = TOOLS[tool](arguments, Streams(BytesIO(stdin.encode("latin-1")), out, err))
    return status, out.getvalue().decode("latin-1"), err.getvalue().decode("latin-1")


def counts(text: str, options: str = "") -> dict[str, int]:
    """The n-grams of a counts file."""
    out = run(f"ngram-count {options}", text)[1]
    return {ngram: int(count) for ngram, count in (line.split("\t") for line in out.splitlines())}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


@settings(max_examples=60, deadline=None)
@given(texts, orders, methods)
def test_probabilities_sum_to_1_in_every_context(folder: Path, text: str, order: int, method: str) -> None:
    path = folder / "m.arpa"
    status, _, err = run(f"ngram-count -text - -order {order} -unk {method} -lm {path}", text)
    assert status == 0
    report = run(f"ngram -lm {path} -order {order} -unk -ppl - -debug 3", text)
    # Good-Turing leaves weights of -99 where it is disabled: the mass that is missing was never there.
    if method and "BOW" not in err:
        assert "sum to" not in report[2]


@settings(max_examples=60, deadline=None)
@given(texts, orders, methods, st.sampled_from(("", "-unk", "-gt3min 1 -gt4min 1", "-no-sos -no-eos")))
def test_a_model_that_is_read_is_written_as_it_was(folder: Path, text: str, order: int, method: str, more: str) -> None:
    first, second = folder / "1.lm", folder / "2.lm"
    assert run(f"ngram-count -text - -order {order} {method} {more} -lm {first}", text)[0] == 0
    assert run(f"ngram -lm {first} -order {order} -write-lm {second}")[0] == 0
    assert second.read_bytes() == first.read_bytes()


@settings(max_examples=40, deadline=None)
@given(texts, st.permutations(["-order 3", "-wbdiscount", "-interpolate", "-gt3min 1", "-unk", "-no-eos", "-lm -"]))
def test_the_order_of_options_changes_nothing(text: str, options: list[str]) -> None:
    expected = run("ngram-count -text - -order 3 -wbdiscount -interpolate -gt3min 1 -unk -no-eos -lm -", text)
    assert run(f"ngram-count {' '.join(options)} -text -", text) == expected


@settings(max_examples=40, deadline=None)
@given(texts, texts, orders)
def test_counts_of_parts_merge_to_those_of_the_whole(folder: Path, one: str, other: str, order: int) -> None:
    names = [folder / "1.cnt", folder / "2.cnt"]
    for name, text in zip(names, (one, other), strict=True):
        run(f"ngram-count -text - -order {order} -sort -write {name}", text)
    merged = run(f"ngram-merge {names[0]} {names[1]}")[1]
    assert merged == run(f"ngram-count -text - -order {order} -sort", one + other)[1]


@settings(max_examples=40, deadline=None)
@given(texts, orders, st.sampled_from(("-wbdiscount -interpolate", "-addsmooth 1", "", "-cdiscount 0.7")))
def test_counts_make_the_model_that_their_text_makes(folder: Path, text: str, order: int, method: str) -> None:
    name = folder / "c.cnt"
    run(f"ngram-count -text - -order {order} -sort -write {name}", text)
    from_text = run(f"ngram-count -text - -order {order} {method} -lm -", text)
    from_counts = run(f"ngram-count -read {name} -order {order} {method} -lm -")
    assert from_counts == from_text


@settings(max_examples=40, deadline=None)
@given(texts, st.integers(1, 3))
def test_a_weight_is_as_many_lines(text: str, weight: int) -> None:
    weighted = "".join(f"{weight} {line}\n" for line in text.splitlines())
    assert counts(weighted, "-text - -text-has-weights -sort") == counts(text * weight, "-text - -sort")


@settings(max_examples=40, deadline=None)
@given(texts, orders)
def test_every_prefix_is_counted_as_often_as_it_goes_on(text: str, order: int) -> None:
    """With markers every n-gram but one that ends in </s> has a word behind it."""
    found = counts(text, f"-text - -order {order}")
    followed: dict[str, int] = {}
    for ngram_, count in found.items():
        *prefix, _ = ngram_.split()
        followed[" ".join(prefix)] = followed.get(" ".join(prefix), 0) + count
    for ngram_, count in found.items():
        if len(ngram_.split()) < order and not ngram_.endswith("</s>"):
            assert followed[ngram_] == count


@settings(max_examples=40, deadline=None)
@given(texts, texts, st.sampled_from((0.0, 1.0)) | st.floats(0.001, 0.999))
def test_a_mixture_lies_between_its_parts(folder: Path, one: str, other: str, weight: float) -> None:
    """Static mixtures of unigrams are the dynamic ones, and the mean of the probabilities.

    The seven digits that a model has of a logarithm say less of probabilities of 1e-10, as tinier weights make them.
    """
    names = [folder / "1.lm", folder / "2.lm"]
    for name, text in zip(names, (one, other), strict=True):
        run(f"ngram-count -text - -order 1 -addsmooth 1 -unk -lm {name}", text)
    mixed = folder / "mix.lm"
    command = f"ngram -order 1 -unk -lm {names[0]} -mix-lm {names[1]} -lambda {weight:.17g}"
    assert run(f"{command} -write-lm {mixed}")[0] == 0
    p = [
        {word: 10 ** float(number) if number != "-99" else 0.0 for number, word in _unigrams(name)}
        for name in (*names, mixed)
    ]
    for word, found in p[2].items():
        if word != "<s>":
            expected = weight * p[0].get(word, 0) + (1 - weight) * p[1].get(word, 0)
            np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-30)
    static = run(f"{command} -ppl -", one)[1].split("ppl=")[0].split("logprob= ")
    dynamic = run(f"{command} -bayes 0 -ppl -", one)[1].split("ppl=")[0].split("logprob= ")
    assert static[0] == dynamic[0]
    assert float(static[-1]) == pytest.approx(float(dynamic[-1]), rel=1e-5)


def _unigrams(path: Path) -> list[tuple[str, str]]:
    section = path.read_text("latin-1").split("\\1-grams:\n")[1].split("\n\n")[0]
    return [(line.split("\t")[0], line.split("\t")[1]) for line in section.splitlines()]


@settings(max_examples=40, deadline=None)
@given(texts, orders, methods)
def test_perplexity_is_that_of_the_words_printed(folder: Path, text: str, order: int, method: str) -> None:
    path = folder / "p.lm"
    run(f"ngram-count -text - -order {order} {method} -lm {path}", text)
    _, out, _ = run(f"ngram -lm {path} -order {order} -ppl - -debug 2", text)
    tokens = [line.split("[ ")[1].split()[0] for line in out.splitlines() if line.startswith("\tp(")]
    logs = [float(token) for token in tokens if token != "-inf"]
    total = out.splitlines()[-1].split("logprob= ")[1].split()[0]
    assert float(total) == pytest.approx(sum(logs), rel=1e-5, abs=1e-6)
    whole = run(f"ngram -lm {path} -order {order} -ppl -", text)[1]
    assert whole.splitlines() == out.splitlines()[-2:]


@settings(max_examples=30, deadline=None)
@given(
    texts, orders, methods, st.sampled_from(("-prune 1e-3", "-prune-lowprobs", "-renorm", "-minbackoff 0.1 -renorm"))
)
def test_a_changed_model_still_sums_to_1(folder: Path, text: str, order: int, method: str, change: str) -> None:
    path, changed = folder / "c.lm", folder / "d.lm"
    _, _, err = run(f"ngram-count -text - -order {order} -unk {method} -lm {path}", text)
    assert run(f"ngram -lm {path} -order {order} -unk {change} -write-lm {changed}")[0] == 0
    said = run(f"ngram -lm {changed} -order {order} -unk -ppl - -debug 3", text)[2]
    assert not method or "BOW" in err or "sum to" not in said


def test_all_short_texts_have_models(folder: Path) -> None:
    """Every text of up to three of these words, with every method: a model, or one line that says why not."""
    for words in itertools.chain.from_iterable(
        itertools.product(("a", "b", "<s>", "</s>", "<unk>"), repeat=n) for n in range(4)
    ):
        for method in ("", "-wbdiscount", "-kndiscount", "-ukndiscount", "-addsmooth 1", "-cdiscount 1"):
            status, out, err = run(f"ngram-count -text - -order 3 -gt3min 1 {method} -lm -", " ".join(words) + "\n")
            assert status == 0 or (status, out) == (1, "")
            assert status == 0 or "error in discount estimator" in err
            assert status or out.endswith("\\end\\\n")
