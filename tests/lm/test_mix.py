"""Static interpolation: mixing a model with itself, weights of nothing, sums of 1, and a mixture by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec.errors import LanguageModelError
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.lm.checks import context_sums
from placerec.lm.mix import interpolate, merge_weight

texts = st.lists(st.lists(st.sampled_from("abcd"), min_size=1, max_size=8), min_size=1, max_size=6)


def trained(sentences: list[list[str]], order: int = 3) -> BackoffModel:
    return estimate(count_ngrams(sentences, order, vocabulary="abcd"), smoothing("witten-bell"))


@settings(max_examples=30, deadline=None)
@given(texts, st.floats(0, 1))
def test_a_model_mixed_with_itself_stays_as_it_is(sentences: list[list[str]], weight: float) -> None:
    model = trained(sentences)
    mixed = interpolate([model, model], [weight, 1 - weight])
    for n in range(1, model.order + 1):
        np.testing.assert_array_equal(mixed.trie.keys[n - 1], model.trie.keys[n - 1])
        np.testing.assert_allclose(mixed.log10_ps[n - 1], model.log10_ps[n - 1], atol=2e-6)


@settings(max_examples=30, deadline=None)
@given(texts, texts, st.floats(0, 1))
def test_every_context_of_a_mixture_sums_to_1(one: list[list[str]], other: list[list[str]], weight: float) -> None:
    mixed = interpolate([trained(one), trained(other, 2)], [weight, 1 - weight])
    for _, _, sums in context_sums(mixed):
        np.testing.assert_allclose(sums, 1, atol=1e-5)


def test_listed_n_grams_have_the_mean_probability() -> None:
    one, other = trained([["a", "b"], ["a"]]), trained([["b", "b", "c"]])
    mixed = interpolate([one, other], [0.25, 0.75])
    for history, word in (([], "a"), (["<s>"], "b"), (["b"], "b"), (["<s>", "a"], "b"), (["b", "c"], "</s>")):
        mean = 0.25 * 10 ** one.log10_p(word, history) + 0.75 * 10 ** other.log10_p(word, history)
        assert 10 ** mixed.log10_p(word, history) == pytest.approx(mean, rel=1e-6)


def test_a_component_without_weight_leaves_its_n_grams_behind() -> None:
    one, other = trained([["a", "b"]]), trained([["c", "d"]])
    mixed = interpolate([one, other], [1.0, 0.0])
    assert len(mixed.trie.keys[2]) > len(one.trie.keys[2])
    assert mixed.log10_p("d", ["c"]) == pytest.approx(one.log10_p("d", ["c"]), abs=1e-6)


def test_components_join_one_after_the_other() -> None:
    # 0.2 of 0.7 joins 0.5, then 0.3 of 1 joins both.
    assert merge_weight([0.5, 0.2, 0.3], 1) == pytest.approx(1 - 0.2 / 0.7)
    assert merge_weight([0.5, 0.2, 0.3], 2) == pytest.approx(0.7)
    assert merge_weight([0.5, 0.0, 0.5], 1) == 1


@pytest.mark.parametrize("weights", [[1.0], [0.5, 0.6], [1.5, -0.5]])
def test_weights_must_fit(weights: list[float]) -> None:
    model = trained([["a"]])
    with pytest.raises(LanguageModelError, match="weights"):
        interpolate([model, model], weights)
