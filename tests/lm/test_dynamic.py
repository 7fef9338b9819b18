"""Mixtures while scoring: means, posteriors, products and caches, by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec.arrays import Singles
from placerec.lm.dynamic import Cache, loglinear, mixed, posteriors, with_cache


def logs(*rows: list[float]) -> Singles:
    with np.errstate(divide="ignore"):
        return np.log10(np.array(rows, np.float64)).astype(np.float32)


def test_means_need_no_weights_that_sum_to_1() -> None:
    log10_ps = logs([0.1, 0.4, 0.0], [0.3, 0.0, 0.0])
    expected = [0.15, 0.3, 0.0]
    np.testing.assert_allclose(10.0 ** mixed(log10_ps, np.array([3.0, 1.0])), expected, rtol=1e-6)
    each = np.array([[3.0, 3.0, 1.0], [1.0, 1.0, 1.0]])
    np.testing.assert_allclose(10.0 ** mixed(log10_ps, each), expected, rtol=1e-6)


def test_posteriors_follow_the_joint_probabilities() -> None:
    joints = logs([0.1, 0.0, 0.0], [0.3, 0.5, 0.0])
    found = posteriors([0.6, 0.2], joints, 1.0)
    np.testing.assert_allclose(found, [[0.5, 0.0, 0.75], [0.5, 1.0, 0.25]], rtol=1e-6)
    np.testing.assert_allclose(posteriors([0.6, 0.2], joints, 0.0)[:, 0], [0.75, 0.25], rtol=1e-6)


def test_products_skip_components_without_weight() -> None:
    log10_ps = logs([0.1, 0.0], [0.01, 0.5])
    assert loglinear(log10_ps, [0.5, 0.25])[0] == pytest.approx(-1.0)
    assert loglinear(log10_ps, [0.0, 1.0])[1] == pytest.approx(np.log10(0.5))
    assert np.isneginf(loglinear(log10_ps, [0.5, 0.5])[1])


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
