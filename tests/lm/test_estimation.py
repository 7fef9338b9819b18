"""Estimation: the reference trainer's files to the byte, the plain twin's numbers, and sums of 1."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import golden_runs
from hypothesis import given, settings, strategies as st

from placerec import reference
from placerec.errors import LanguageModelError
from placerec.lm import SMOOTHINGS, BackoffModel, count_ngrams, estimate, format_arpa, smoothing
from placerec.lm.check import context_sums
from placerec.lm.counts import tabulate
from placerec.lm.discounts import Rule, witten_bell
from placerec.lm.estimation import estimate_mutable
from placerec.lm.mutable import Trace
from placerec.lm.vocabulary import Vocabulary

VOCABULARY = ["a", "b", "c", "d", "e"]
CLOSED_SMOOTHINGS = {
    "witten-bell-interpolate": ("witten-bell", 1.0),
    "witten-bell-no-interpolate": ("witten-bell-backoff", 1.0),
    "lidstone-1-no-interpolate": ("lidstone-backoff", 1.0),
    "lidstone-0.5-no-interpolate": ("lidstone-backoff", 0.5),
}
# Kneser-Ney fails on most small texts; it has tests of its own.
SAFE = [name for name in SMOOTHINGS if "kneser-ney" not in name]
sentences_of_words = st.lists(st.lists(st.sampled_from(["a", "b", "c", "d"]), min_size=1, max_size=12), max_size=6)


def closed_model(
    sentences: list[list[str]], name: str, order: int, delta: float | None = None, min_count: tuple[int, ...] = (1,)
) -> BackoffModel:
    counts = count_ngrams(sentences, order, vocabulary=VOCABULARY, markers=False)
    return estimate(counts, smoothing(name, delta), non_events=["</s>"], min_count=min_count)


def test_place_models_equal_the_reference_trainers(shared: Path) -> None:
    files = sorted((shared / "srilm/closed").glob("*/expected/*/*.arpa"))
    assert len(files) > 100
    for path in files:
        root = path.parents[2]
        kind, order, markers = path.parent.name.split("_")
        name, delta = CLOSED_SMOOTHINGS[kind]
        sentences = [line.split() for line in (root / f"sentences/{path.stem}.txt").read_text().splitlines()]
        vocabulary = (root / "vocab.txt").read_text().split()
        counts = count_ngrams(
            sentences, int(order.removeprefix("order-")), vocabulary=vocabulary, markers=markers == "markers"
        )
        model = estimate(counts, smoothing(name, delta), non_events=[] if markers == "markers" else ["</s>"])
        assert format_arpa(model) == path.read_text(), path


def test_text_models_equal_the_reference_trainers(shared: Path) -> None:
    cases = list(golden_runs.text_cases(shared / "srilm/golden"))
    assert len(cases) > 70
    for case in cases:
        counts = count_ngrams(case.sentences, case.order, vocabulary=case.vocabulary, markers=case.markers)
        model = estimate(
            counts,
            case.smoothing,
            min_count=case.min_count,
            non_events=case.non_events,
            open_vocabulary=case.unknown_is_word,
        )
        assert format_arpa(model) == case.expected, case.name


@pytest.mark.parametrize("name", SAFE)
@settings(max_examples=40, deadline=None)
@given(sentences=sentences_of_words, order=st.integers(1, 5), delta=st.sampled_from([0.1, 0.5, 0.9]))
def test_probabilities_are_those_of_the_plain_twin(
    name: str, sentences: list[list[str]], order: int, delta: float
) -> None:
    model = closed_model(sentences, name, order, delta)
    twin = reference.smoothed(reference.count(sentences, order), VOCABULARY, order, name, delta)
    for history in [(), ("a",), ("e",), ("a", "b"), ("b", "a", "c"), ("c", "a", "b", "d")]:
        for word in VOCABULARY:
            wanted = reference.backed_off(twin, word, history[-(order - 1) :] if order > 1 else ())
            assert 10 ** model.log10_p(word, history) == pytest.approx(wanted, rel=1e-4, abs=1e-7), (word, history)


@pytest.mark.parametrize("name", SAFE)
@settings(max_examples=40, deadline=None)
@given(
    sentences=sentences_of_words,
    order=st.integers(1, 6),
    min_count=st.sampled_from([(1,), (1, 1, 2), (2,), (1, 3, 1)]),
)
def test_every_context_sums_to_one_and_no_word_is_impossible(
    name: str, sentences: list[list[str]], order: int, min_count: tuple[int, ...]
) -> None:
    model = closed_model(sentences, name, order, min_count=min_count)
    for n, _, sums in context_sums(model):
        assert np.abs(sums - 1).max(initial=0) < 1e-5, n
    for history in itertools.chain([()], itertools.product(VOCABULARY, repeat=2)):
        log10_probs = [model.log10_p(word, history) for word in VOCABULARY]
        assert min(log10_probs) > -20
        assert sum(10**p for p in log10_probs) == pytest.approx(1, abs=1e-5), history


def test_witten_bell_by_hand() -> None:
    # "a b a", V = 5 (the words), N = 3, T = 2: p(a) = (2 + 2/5) / 5, p(c) = (0 + 2/5) / 5.
    model = closed_model([["a", "b", "a"]], "witten-bell", 2)
    assert 10 ** model.log10_p("a") == pytest.approx(2.4 / 5, rel=1e-6)
    assert 10 ** model.log10_p("c") == pytest.approx(0.4 / 5, rel=1e-6)
    # After a (N = 1, T = 1): p(b|a) = (1 + p(b)) / 2 with p(b) = 1.4/5, and p(c|a) = p(c) / 2.
    assert 10 ** model.log10_p("b", ["a"]) == pytest.approx((1 + 1.4 / 5) / 2, rel=1e-6)
    assert 10 ** model.log10_p("c", ["a"]) == pytest.approx(0.08 / 2, rel=1e-6)


def test_a_history_that_would_leave_nothing_backs_off() -> None:
    # e was never seen, and the interpolated probabilities after "a c" would sum to 1 within 3e-6 without it.
    texts = ["aaaaa", "aaaaaaacaca", "aaaaaaacaca", "aaaaaaccacb", "aaaaacacacd", "aaaaacaca"]
    model = closed_model([list(text) for text in texts], "lidstone", 3, delta=0.1)
    # N = 11, a follows 8 times, b, c and d once: c / (N + 5 delta), and what that leaves for e.
    assert [10 ** model.log10_p(word, ["a", "c"]) for word in "abcde"] == pytest.approx(
        [8 / 11.5, 1 / 11.5, 1 / 11.5, 1 / 11.5, 0.5 / 11.5], rel=1e-5
    )


def test_a_place_without_words_is_uniform() -> None:
    model = closed_model([], "witten-bell", 3)
    assert [10 ** model.log10_p(word) for word in VOCABULARY] == pytest.approx([0.2] * 5, rel=1e-6)


def test_wrong_options_are_named() -> None:
    counts = count_ngrams([["a"]], 2, vocabulary=VOCABULARY, markers=False)
    with pytest.raises(LanguageModelError, match=r"^smoothing 'kneser' is unknown; choose one of witten-bell, "):
        smoothing("kneser")
    with pytest.raises(LanguageModelError, match=r"^delta 0 must be a number above 0"):
        smoothing("lidstone", 0)
    with pytest.raises(LanguageModelError, match=r"^minimum counts \(0,\) must be 1 or more"):
        estimate(counts, smoothing("lidstone"), min_count=(0,))
    with pytest.raises(LanguageModelError, match="holds no word that could be predicted"):
        estimate(counts, smoothing("lidstone"), non_events=[*VOCABULARY, "</s>"])


def test_counts_too_large_to_leave_anything_are_named() -> None:
    counts = count_ngrams([["a", "b"]], 2, vocabulary=VOCABULARY)
    often = replace(counts, counts=tuple(10**17 * each for each in counts.counts))
    with pytest.raises(LanguageModelError, match=r"a context of the 1-grams was counted 3e\+17 times: so often that"):
        estimate(often, smoothing("lidstone-backoff", 1.0))


def test_longer_ngrams_that_never_occur_are_not_listed() -> None:
    vocabulary = Vocabulary.of(["</s>", "<s>", "<unk>", "a", "b"])
    ngrams = [np.array([[3], [4]]), np.array([[3, 4], [3, 3], [4, 3]])]
    counts = tabulate(vocabulary, 2, ngrams, [np.array([3, 1]), np.array([0, 2, 1])])
    model = estimate(counts, smoothing("witten-bell"), non_events=["</s>"])
    assert model.trie.texts(2) == ["a a", "b a"]


class Discarded(Trace):
    """Keeps the orders of which n-grams are left out."""

    def __init__(self) -> None:
        self.orders: list[tuple[int, int]] = []

    def discarded_ngrams(self, n: int, non_events: int, discounted: int) -> None:
        self.orders += [(n, non_events)] * (non_events > 0)


def test_ngrams_that_end_in_what_is_not_predicted_are_told_of_from_order_2() -> None:
    counts = count_ngrams([["a", "b", "x", "b", "a"]], 2)
    trace = Discarded()
    estimate_mutable(counts, [Rule(witten_bell, True)] * 2, non_events=["x"], trace=trace)
    assert trace.orders == [(2, 1)]


def test_contexts_that_leave_nothing_to_unseen_words_back_off_with_nothing() -> None:
    """By relative frequency "a b" is certain, and nothing is left for the words that were never seen behind a."""
    counts = count_ngrams([["a", "b"], ["a", "b", "c"]], 2, markers=False)
    model = estimate_mutable(counts, [Rule(), Rule()], non_events=["</s>"])
    row = model.trie.vocabulary.index["a"]
    assert model.is_context[0][row]
    assert model.backoff[0][row] == -np.inf
