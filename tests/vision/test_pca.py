"""PCA in one pass against numpy's SVD, and products whose bits do not depend on the order of additions."""

import logging
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision import exact
from placerec.vision.pca import Moments, fit_pca, moments, project


def sample(n: int, d: int, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(n, d)) * 0.8 ** np.arange(d) + rng.normal(size=d)).astype(np.float32)


def test_components_are_those_of_the_svd() -> None:
    x = sample(300, 20)
    pca = fit_pca(moments(x), 5)
    mean = x.astype(float).mean(axis=0)
    _, singular, rows = np.linalg.svd(x - mean, full_matrices=False)
    variances = singular**2 / 299
    rows = rows * np.sign(rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)])[:, None]
    np.testing.assert_allclose(pca.mean, mean, rtol=1e-12)
    np.testing.assert_allclose(pca.components, rows[:5], atol=2e-6)
    np.testing.assert_allclose(pca.variances, variances[:5], rtol=1e-6)
    assert pca.explained == pytest.approx(variances[:5].sum() / variances.sum(), abs=1e-8)
    assert pca.needed == 1 + int((np.cumsum(variances) / variances.sum() < 0.99).sum())
    np.testing.assert_allclose(project(x, pca), (x - mean) @ rows[:5].T, atol=1e-5)


def test_the_largest_entry_of_a_component_is_positive() -> None:
    for seed in range(5):
        components = fit_pca(moments(sample(60, 12, seed)), 6).components
        largest = np.abs(components).argmax(axis=1)
        assert (components[np.arange(6), largest] > 0).all()


def test_moments_do_not_depend_on_where_the_stream_is_cut() -> None:
    x = sample(1000, 6)
    x[:, 0] += 1000
    pieces = Moments.none(6)
    for piece in np.split(x, [1, 200, 777]):
        pieces = pieces.plus(Moments.of(piece))
    assert pieces.n == 1000
    np.testing.assert_allclose(pieces.mean, x.astype(float).mean(axis=0), rtol=1e-12)
    centred = x - x.astype(float).mean(axis=0)
    np.testing.assert_allclose(pieces.scatter, centred.T @ centred, rtol=1e-9, atol=1e-9)
    assert moments(sample(exact.TERMS + 5, 4)).n == exact.TERMS + 5


def test_a_stream_gives_the_moments_of_the_array() -> None:
    x = sample(exact.TERMS + 300, 5)
    whole = moments(x)
    cuts: list[list[int]] = [[], [7], [5, 4000, 4000, 4200]]
    for places in cuts:
        streamed = moments(partial(lambda places: iter(np.split(x, places)), places))
        assert streamed.n == whole.n
        np.testing.assert_array_equal(streamed.mean, whole.mean)
        np.testing.assert_array_equal(streamed.scatter, whole.scatter)
    assert moments(lambda: iter([])).n == 0


def test_few_rows_give_few_components(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        assert fit_pca(moments(sample(4, 10)), 8).components.shape == (3, 10)
    assert "PCA keeps 3 components instead of 8: the 4 descriptors have no more" in caplog.text


def test_the_rank_limits_the_components() -> None:
    rng = np.random.default_rng(0)
    x = np.repeat(rng.normal(size=(3, 10)), 20, axis=0).astype(np.float32)
    pca = fit_pca(moments(x), 8)
    assert pca.components.shape == (2, 10)
    assert pca.explained == pytest.approx(1)


def test_low_variance_is_measured_and_neither_warned_of_nor_an_error(caplog: pytest.LogCaptureFixture) -> None:
    """`train-words` tells it, with how many components would keep what the paper's keep."""
    pca = fit_pca(moments(np.random.default_rng(0).normal(size=(200, 10)).astype(np.float32)), 3)
    assert (pca.explained < 0.5, pca.needed) == (True, 10)
    assert caplog.messages == []


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_rows_are_refused(n: int) -> None:
    with pytest.raises(VisionError, match=f"PCA needs at least 2 descriptors, and there are {n}; name more images"):
        fit_pca(moments(sample(n, 5)))


@pytest.mark.parametrize("value", [0, 0.1])
def test_equal_rows_are_refused(value: float) -> None:
    with pytest.raises(VisionError, match="all 30 descriptors are equal"):
        fit_pca(moments(np.full((30, 5), value, np.float32)))


def test_exact_products_are_the_same_in_any_order() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(4096, 30)) * 10.0 ** rng.integers(-3, 4, (4096, 1))
    shuffled = x[rng.permutation(4096)]
    np.testing.assert_array_equal(exact.gram(x), exact.gram(shuffled))
    assert (x.T @ x != shuffled.T @ shuffled).any()
    np.testing.assert_allclose(exact.gram(x), x.T @ x, rtol=0, atol=1e-12 * (x**2).sum())
    grid = exact.on_grid(rng.uniform(-1, 1, (30, 7)))
    order = rng.permutation(30)
    np.testing.assert_array_equal(exact.product(x, grid), exact.product(x[:, order], grid[order]))
    np.testing.assert_allclose(exact.product(x, grid), x @ grid, rtol=1e-9, atol=1e-8)


def test_a_row_is_projected_alike_in_any_batch() -> None:
    x = sample(100, 12)
    pca = fit_pca(moments(x), 4)
    together = project(np.concatenate([1000 * x, x]), pca)[100:]
    np.testing.assert_array_equal(together, np.concatenate([project(row[None], pca) for row in x]))
