"""Words added to a finished model, n-grams boosted: the rest keeps its proportions, and every context sums to 1."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from placerec.errors import LanguageModelError
from placerec.lm import BackoffModel, count_ngrams, estimate, read_arpa, smoothing, with_unigrams, write_arpa
from placerec.lm.adapt import adapt, adapt_lm, parse_addition, parse_boost
from placerec.lm.check import SUM_TOLERANCE, context_sums

TEXT = [["a", "b", "c", "a", "b"], ["b", "b", "a"], ["c", "a", "b", "a"]]


def made(order: int = 3, name: str = "witten-bell") -> BackoffModel:
    return with_unigrams(estimate(count_ngrams(TEXT, order), smoothing(name)), ["<unk>"])


def sums(model: BackoffModel) -> np.ndarray:
    return np.concatenate([totals for _, _, totals in context_sums(model)])


def p(model: BackoffModel, *words: str) -> float:
    return float(10 ** model.log10_p(words[-1], words[:-1]))


def test_an_added_word_has_its_probability_and_the_others_share_what_is_left() -> None:
    model = made()
    adapted = adapt(model, {"new": 0.1}, {})
    assert p(adapted, "new") == pytest.approx(0.1, rel=1e-5)
    for word in ("a", "b", "c", "</s>"):
        assert p(adapted, word) == pytest.approx(0.9 * p(model, word), rel=1e-5)
    # Listed n-grams are as they were; the new word is there behind every context that leaves something.
    assert p(adapted, "a", "b") == pytest.approx(p(model, "a", "b"), rel=1e-5)
    assert p(adapted, "a", "new") > 0
    assert sums(adapted) == pytest.approx(1, abs=SUM_TOLERANCE)


def test_a_word_without_probability_is_as_rare_as_the_rarest() -> None:
    model = made()
    rarest = min(p(model, word) for word in ("a", "b", "c", "</s>"))
    assert p(adapt(model, {"new": None}, {}), "new") == pytest.approx(rarest, rel=1e-5)


@pytest.mark.parametrize("ngram", [("c",), ("a", "b"), ("b", "c"), ("c", "c"), ("a", "b", "c"), ("c", "c", "b")])
def test_a_boosted_ngram_is_so_many_times_as_probable_and_the_others_keep_their_proportions(
    ngram: tuple[str, ...],
) -> None:
    model = made()
    adapted = adapt(model, {}, {ngram: 1.3})
    *history, word = ngram
    assert p(adapted, *ngram) == pytest.approx(1.3 * p(model, *ngram), rel=1e-5)
    others = [other for other in ("a", "b", "c", "</s>") if other != word]
    before = np.array([p(model, *history, other) for other in others])
    after = np.array([p(adapted, *history, other) for other in others])
    assert after / after.sum() == pytest.approx(before / before.sum(), rel=1e-4)
    assert sums(adapted) == pytest.approx(1, abs=SUM_TOLERANCE)


@settings(max_examples=60, deadline=None)
@given(
    order=st.integers(1, 4),
    name=st.sampled_from(["witten-bell", "witten-bell-backoff", "lidstone", "absolute"]),
    add=st.dictionaries(st.sampled_from(["new", "more"]), st.sampled_from([None, 0.001, 0.2])),
    boost=st.dictionaries(
        st.lists(st.sampled_from(["a", "b", "c", "new", "</s>"]), min_size=1, max_size=4).map(tuple),
        st.sampled_from([0.1, 0.5, 1.5, 3.0]),
        max_size=4,
    ),
)
def test_every_context_sums_to_one_or_the_reason_is_told(
    order: int, name: str, add: dict[str, float | None], boost: dict[tuple[str, ...], float]
) -> None:
    try:
        adapted = adapt(made(order, name), add, boost)
    except LanguageModelError as error:
        # Not that it came out wrong.
        if "the adapted model" in str(error):
            raise
        assume(False)
    assert sums(adapted) == pytest.approx(1, abs=SUM_TOLERANCE)
    assert set(add) <= set(adapted.words)


@pytest.mark.parametrize(
    ("add", "boost", "message"),
    [
        ({"a": None}, {}, "'a' is listed already; boost it instead"),
        ({"a b": None}, {}, "'a b' is no word"),
        ({"new": 1.0}, {}, "'new' cannot get probability 1: a number between 0 and 1 is needed"),
        ({"new": 0.6, "more": 0.6}, {}, "'new', 'more': what is boosted or added in one context comes to 1.2"),
        ({}, {("a", "z"): 2.0}, "'a z' cannot be boosted: 'z' is not in the model"),
        ({}, {("a", "b"): 99.0}, "'a b': what is boosted or added in one context comes to"),
        ({}, {("a", "b"): 0.0}, "'a b' cannot be boosted by 0: a number above 0 is needed"),
        ({}, {("a", "b", "a", "b"): 2.0}, "'a b a b' cannot be boosted: 1 to 3 words are needed"),
    ],
)
def test_what_cannot_be_is_told(
    add: dict[str, float | None], boost: dict[tuple[str, ...], float], message: str
) -> None:
    with pytest.raises(LanguageModelError) as error:
        adapt(made(), add, boost)
    assert message in str(error.value)


def test_a_model_that_does_not_sum_to_one_is_refused_with_the_context_and_nothing_is_written(tmp_path: Path) -> None:
    path, out = tmp_path / "m.arpa", tmp_path / "out.arpa"
    write_arpa(made(2), path)
    lines = path.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.endswith("\ta b"))
    lines[at] = "-0.001\ta b"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(LanguageModelError, match=r"m\.arpa: the model gives all words after 'a' 1\.\d+, not 1; "):
        adapt_lm(path, out, {"new": None}, {})
    assert not out.exists()


def test_a_file_is_adapted_and_keeps_its_comment(tmp_path: Path) -> None:
    path, out = tmp_path / "m.arpa", tmp_path / "out.arpa"
    write_arpa(made(2), path, comment="of three lines")
    adapt_lm(path, out, dict([parse_addition("new=0.1"), parse_addition("w=x=y")]), dict([parse_boost("a b=1.2")]))
    assert out.read_text().startswith("# of three lines\n")
    adapted = read_arpa(out, tolerant=False)
    assert {"new", "w=x=y"} <= set(adapted.words)
    assert p(adapted, "a", "b") == pytest.approx(1.2 * p(made(2), "a", "b"), rel=1e-5)
    with pytest.raises(LanguageModelError, match="'a b=x': 'x' is not a number"):
        parse_boost("a b=x")
