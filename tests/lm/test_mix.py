"""Mixtures: models merged into one, and mixed while a text is scored (means, posteriors, products, caches), by hand."""

from collections.abc import Sequence

import numpy as np
import pytest
from helpers.mutable_models import mutable_models
from hypothesis import given, settings, strategies as st

from placerec.arrays import Singles
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.lm.check import context_sums
from placerec.lm.mix import Cache, loglinear, merge, merge_weight, mixed, posteriors, with_cache

WORDS = list("abcd")
texts = st.lists(st.lists(st.sampled_from(WORDS), min_size=1, max_size=8), min_size=1, max_size=6)


def trained(sentences: list[list[str]], order: int = 3) -> BackoffModel:
    return estimate(count_ngrams(sentences, order, vocabulary=WORDS), smoothing("witten-bell"))


def interpolated(models: Sequence[BackoffModel], weights: Sequence[float]) -> BackoffModel:
    first, *others = mutable_models(models, ["<s>", "<unk>"])
    for k, other in enumerate(others, start=1):
        merge(first, other, merge_weight(weights, k))
    return first.model()


@settings(max_examples=30, deadline=None)
@given(texts, st.floats(0, 1))
def test_a_model_mixed_with_itself_stays_as_it_is(sentences: list[list[str]], weight: float) -> None:
    model = trained(sentences)
    merged = interpolated([model, model], [weight, 1 - weight])
    for n in range(1, model.order + 1):
        np.testing.assert_array_equal(merged.trie.keys[n - 1], model.trie.keys[n - 1])
        np.testing.assert_allclose(merged.log10_probs[n - 1], model.log10_probs[n - 1], atol=2e-6)


@settings(max_examples=30, deadline=None)
@given(texts, texts, st.floats(0, 1))
def test_every_context_of_a_mixture_sums_to_1(one: list[list[str]], other: list[list[str]], weight: float) -> None:
    merged = interpolated([trained(one), trained(other, 2)], [weight, 1 - weight])
    for _, _, sums in context_sums(merged):
        np.testing.assert_allclose(sums, 1, atol=1e-5)


def test_listed_n_grams_have_the_mean_probability() -> None:
    one, other = trained([["a", "b"], ["a"]]), trained([["b", "b", "c"]])
    merged = interpolated([one, other], [0.25, 0.75])
    for history, word in (([], "a"), (["<s>"], "b"), (["b"], "b"), (["<s>", "a"], "b"), (["b", "c"], "</s>")):
        mean = 0.25 * 10 ** one.log10_p(word, history) + 0.75 * 10 ** other.log10_p(word, history)
        assert 10 ** merged.log10_p(word, history) == pytest.approx(mean, rel=1e-6)


def test_a_component_without_weight_leaves_its_n_grams_behind() -> None:
    one, other = trained([["a", "b"]]), trained([["c", "d"]])
    merged = interpolated([one, other], [1.0, 0.0])
    assert len(merged.trie.keys[2]) > len(one.trie.keys[2])
    assert merged.log10_p("d", ["c"]) == pytest.approx(one.log10_p("d", ["c"]), abs=1e-6)


def test_a_mixture_lists_what_its_components_list_and_nothing_else() -> None:
    counts = count_ngrams([list("abc"), list("abc"), list("bd")], 3, vocabulary=WORDS)
    # Trigrams of which the endings are left out.
    one = estimate(counts, smoothing("witten-bell"), min_count=(1, 3, 1))
    merged = interpolated([one, trained([["d", "a"]], 2)], [0.5, 0.5])
    for n in (2, 3):
        other = trained([["d", "a"]], 2).trie.texts(n) if n == 2 else []
        assert set(merged.trie.texts(n)) == {*one.trie.texts(n), *other}
    assert not one.trie.closed


def test_components_join_one_after_the_other() -> None:
    # 0.2 of 0.7 joins 0.5, then 0.3 of 1 joins both.
    assert merge_weight([0.5, 0.2, 0.3], 1) == pytest.approx(1 - 0.2 / 0.7)
    assert merge_weight([0.5, 0.2, 0.3], 2) == pytest.approx(0.7)
    assert merge_weight([0.5, 0.0, 0.5], 1) == 1


def logs(*rows: list[float]) -> Singles:
    with np.errstate(divide="ignore"):
        return np.log10(np.array(rows, np.float64)).astype(np.float32)


def test_means_need_no_weights_that_sum_to_1() -> None:
    log10_probs = logs([0.1, 0.4, 0.0], [0.3, 0.0, 0.0])
    expected = [0.15, 0.3, 0.0]
    np.testing.assert_allclose(10.0 ** mixed(log10_probs, np.array([3.0, 1.0])), expected, rtol=1e-6)
    each = np.array([[3.0, 3.0, 1.0], [1.0, 1.0, 1.0]])
    np.testing.assert_allclose(10.0 ** mixed(log10_probs, each), expected, rtol=1e-6)


def test_posteriors_follow_the_joint_probabilities() -> None:
    joints = logs([0.1, 0.0, 0.0], [0.3, 0.5, 0.0])
    found = posteriors([0.6, 0.2], joints, 1.0)
    np.testing.assert_allclose(found, [[0.5, 0.0, 0.75], [0.5, 1.0, 0.25]], rtol=1e-6)
    np.testing.assert_allclose(posteriors([0.6, 0.2], joints, 0.0)[:, 0], [0.75, 0.25], rtol=1e-6)


def test_products_skip_components_without_weight() -> None:
    log10_probs = logs([0.1, 0.0], [0.01, 0.5])
    assert loglinear(log10_probs, [0.5, 0.25])[0] == pytest.approx(-1.0)
    assert loglinear(log10_probs, [0.0, 1.0])[1] == pytest.approx(np.log10(0.5))
    assert np.isneginf(loglinear(log10_probs, [0.5, 0.5])[1])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.booleans()), min_size=1, max_size=40), st.integers(1, 8))
def test_a_cache_holds_the_words_before(text: list[tuple[int, bool]], size: int) -> None:
    ids, counted = np.array([word for word, _ in text]), np.array([count for _, count in text])
    cache = Cache(ids, counted, size)
    shares = cache.shares(ids)
    for t, word in enumerate(ids.tolist()):
        recent = [before for before, count in text[:t] if count][-size:]
        expected = [recent.count(other) / max(1, len(recent)) for other in range(4)]
        assert shares[t] == pytest.approx(expected[word])
        assert cache.distribution(t, 4).tolist() == pytest.approx(expected)


def test_a_cache_takes_its_share() -> None:
    log10_p = with_cache(logs([0.5, 0.5])[0], np.array([0.0, 0.25]), 0.2)
    np.testing.assert_allclose(10.0**log10_p, [0.4, 0.45], rtol=1e-6)
