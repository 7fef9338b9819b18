"""The batch map: it learns, it repeats itself, and its search is exact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from placerec.vision.som import Som, best_units, quantisation_error, topographic_error, train_som


def sample(n: int = 600, d: int = 6, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(12, d)) * 0.7 ** np.arange(d)
    return (centres[rng.integers(12, size=n)] + 0.1 * rng.normal(size=(n, d))).astype(np.float32)


def train(codes: NDArray[np.float32], size: int = 6, seed: int = 0, epochs: int | None = None) -> Som:
    return train_som(codes, size, rng=np.random.default_rng(seed), epochs=epochs)


def brute_force(codes: NDArray[np.float32], codebook: NDArray[np.float32]) -> NDArray[np.float64]:
    difference = codes[:, None].astype(np.float64) - codebook[None]
    distances: NDArray[np.float64] = np.sqrt((difference**2).sum(axis=2))
    return distances


def test_same_seed_same_bytes_and_another_seed_another_map() -> None:
    codes = sample()
    first, again, other = train(codes), train(codes), train(codes, seed=1)
    assert first.codebook.tobytes() == again.codebook.tobytes()
    assert first.codebook.dtype == np.float32
    assert np.abs(first.codebook - other.codebook).max() > 1e-3


def test_the_quantisation_error_falls_and_is_reported() -> None:
    codes, seen = sample(), []
    som = train_som(codes, 6, rng=np.random.default_rng(0), progress=lambda *told: seen.append(told))
    assert [epoch for epoch, _, _ in seen] == list(range(1, som.epochs + 1))
    assert {epochs for _, epochs, _ in seen} == {50}
    errors = [error for _, _, error in seen]
    final = quantisation_error(codes, som.codebook)
    assert final < 0.5 * errors[0]
    assert final == pytest.approx(brute_force(codes, som.codebook).min(axis=1).mean())


def test_training_stops_when_settled_and_not_in_the_cooling_half() -> None:
    som = train(sample(200), size=3)
    assert 25 < som.epochs < 50
    assert train(sample(200), size=3, epochs=2).epochs <= 2
    assert train(sample(200), size=3, epochs=1).epochs == 1


def test_hits_count_the_training_frames() -> None:
    codes = sample()
    som = train(codes)
    units, _ = best_units(codes, som.codebook)
    np.testing.assert_array_equal(som.hits, np.bincount(units, minlength=36))
    assert som.hits.dtype == np.int64


def test_neighbours_on_the_lattice_are_neighbours_in_space() -> None:
    # A flat sheet: an ordered map has neighbouring first and second units nearly everywhere.
    codes = np.random.default_rng(0).uniform(-1, 1, (2000, 2)).astype(np.float32)
    som = train(codes, size=8)
    assert topographic_error(codes, som.codebook) < 0.05
    shuffled = som.codebook[np.random.default_rng(0).permutation(64)]
    assert topographic_error(codes, shuffled) > 0.5


def test_topographic_error_by_hand() -> None:
    # A 3 x 3 map on a line: unit 0 at 0, unit 8 at 1, the rest far away.
    codebook = np.full((9, 1), 100, np.float32)
    codebook[0], codebook[8] = 0, 1
    codes = np.array([[0.1], [0.2], [0.9]], np.float32)
    assert topographic_error(codes, codebook) == 1
    codebook[4], codebook[8] = 1, 100
    assert topographic_error(codes, codebook) == 0


def test_distances_and_units_are_those_of_brute_force() -> None:
    codes, codebook = sample(5000), sample(49, seed=3)
    units, distances = best_units(codes, codebook)
    every = brute_force(codes, codebook)
    np.testing.assert_array_equal(units, every.argmin(axis=1))
    np.testing.assert_allclose(distances, every.min(axis=1), rtol=1e-6)
    assert units.dtype == np.int64
    assert distances.dtype == np.float32


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), offset=st.sampled_from([0.0, 1.0, 300.0]))
def test_near_ties_are_decided_exactly(seed: int, offset: float) -> None:
    # Units that float32 products cannot tell apart, some of them equal: the nearest in float64, the first if equal.
    rng = np.random.default_rng(seed)
    codebook = (offset + np.repeat(rng.normal(size=(10, 8)), 3, axis=0)).astype(np.float32)
    codebook[::3] += (1e-6 * rng.normal(size=(10, 8))).astype(np.float32)
    codes = (codebook[rng.integers(30, size=200)] + 1e-5 * rng.normal(size=(200, 8))).astype(np.float32)
    np.testing.assert_array_equal(best_units(codes, codebook)[0], brute_force(codes, codebook).argmin(axis=1))


def test_only_live_units_answer() -> None:
    codes, codebook = sample(500), sample(36, seed=3)
    live = np.arange(36) % 3 == 0
    units, distances = best_units(codes, codebook, live)
    assert live[units].all()
    every = np.where(live, brute_force(codes, codebook), np.inf)
    np.testing.assert_array_equal(units, every.argmin(axis=1))
    np.testing.assert_allclose(distances, every.min(axis=1), rtol=1e-6)


def test_a_unit_that_hears_of_no_frame_keeps_its_weights() -> None:
    # 1 epoch is at width 0.5, and 60 units away its Gaussian is zero in float64.
    codes = np.random.default_rng(0).normal(size=(4, 2)).astype(np.float32)
    som = train(codes, size=60, epochs=1)
    assert np.isfinite(som.codebook).all()


@pytest.mark.parametrize("size", [1, 2])
def test_tiny_maps(size: int) -> None:
    codes = sample(50, 1)
    som = train(codes, size=size)
    assert som.codebook.shape == (size * size, 1)
    assert som.hits.sum() == 50
    assert 0 <= topographic_error(codes, som.codebook) <= 1
    if size == 1:
        np.testing.assert_allclose(som.codebook[0], codes.mean(axis=0), rtol=1e-5)
