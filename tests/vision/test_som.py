"""Maps: they learn, from memory and from streams, they repeat themselves, and their search is exact."""

import tracemalloc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision.chunks import CHUNK, Stream, chunks
from placerec.vision.som import RULES, MapQuality, Som, Units, map_quality, nearest_units, train_som


def sample(n: int = 600, d: int = 6, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(12, d)) * 0.7 ** np.arange(d)
    return (centres[rng.integers(12, size=n)] + 0.1 * rng.normal(size=(n, d))).astype(np.float32)


def train(codes: NDArray[np.float32] | Stream, size: int = 6, seed: int = 0, **options: Any) -> Som:
    return train_som(codes, size, rng=np.random.default_rng(seed), **options)


def cut(codes: NDArray[np.float32], places: list[int]) -> Stream:
    """The rows as a stream of pieces; some may be empty."""
    return lambda: iter(np.split(codes, sorted(places)))


def brute_force(codes: NDArray[np.float32], codebook: NDArray[np.float32]) -> NDArray[np.float64]:
    difference = codes[:, None].astype(np.float64) - codebook[None]
    distances: NDArray[np.float64] = np.sqrt((difference**2).sum(axis=2))
    return distances


def quality_of(codes: NDArray[np.float32], codebook: NDArray[np.float32]) -> MapQuality:
    return map_quality(codes, codebook, np.ones(len(codebook), np.int64))


def test_same_seed_same_bytes_and_another_seed_another_map() -> None:
    codes = sample()
    first, again, other = train(codes), train(codes), train(codes, seed=1)
    assert first.codebook.tobytes() == again.codebook.tobytes()
    assert first.codebook.dtype == np.float32
    assert np.abs(first.codebook - other.codebook).max() > 1e-3


@settings(max_examples=20)
@given(places=st.lists(st.integers(0, 2 * CHUNK + 500), max_size=6))
def test_chunks_are_the_rows_in_pieces_of_one_size(places: list[int]) -> None:
    codes = sample(2 * CHUNK + 500, 2)
    pieces = list(chunks(cut(codes, places)))
    assert [len(piece) for piece in pieces] == [CHUNK, CHUNK, 500]
    np.testing.assert_array_equal(np.concatenate(pieces), codes)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("places", [[], [1], [4000, 4000, 4097], list(range(0, 5000, 700))])
def test_a_stream_gives_the_map_of_the_array(rule: str, places: list[int]) -> None:
    codes = sample(5000)
    whole = train(codes, epochs=3 if rule == "batch" else 1, rule=rule)
    streamed = train(cut(codes, places), epochs=3 if rule == "batch" else 1, rule=rule)
    assert streamed.codebook.tobytes() == whole.codebook.tobytes()
    np.testing.assert_array_equal(streamed.hits, whole.hits)


def test_memory_does_not_grow_with_the_stream() -> None:
    piece = sample(CHUNK, 32)

    def peak(pieces: int) -> int:
        def stream() -> Iterator[NDArray[np.float32]]:
            return (piece + np.float32(number) for number in range(pieces))

        tracemalloc.start()
        train(stream, size=3, epochs=2)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    few, many = peak(4), peak(24)
    # The 20 chunks more are 10 MB, of which four bytes a frame are kept.
    assert many - few < 20 * CHUNK * 4 + 100_000


def test_a_stream_that_changes_is_refused() -> None:
    once = iter([sample(100)])
    with pytest.raises(VisionError, match="the descriptors are 0 rows now and were 100 before; give the same at every"):
        train(lambda: once)


def test_the_final_width_is_an_option() -> None:
    codes = sample(2000)
    narrow, usual, wide = train(codes, width=0.1), train(codes), train(codes, width=2.0)
    assert usual.codebook.tobytes() == train(codes, width=0.5).codebook.tobytes()
    errors = [quality_of(codes, som.codebook).quantisation_error for som in (narrow, usual, wide)]
    assert errors == sorted(errors)
    # Wider than the map from the start: every unit is near the mean of all.
    flat = train(codes, width=50.0).codebook
    assert np.abs(flat - codes.mean(axis=0)).max() < 0.05


def plain_online(
    codes: NDArray[np.float32], start: NDArray[np.float64], order: list[int], width: float
) -> NDArray[np.float64]:
    """Kohonen's rule in words of one syllable."""
    units = start.copy()
    side = round(len(units) ** 0.5)
    for step, row in enumerate(order):
        share = step / (len(order) - 1)
        rate = 0.5 * (1 - share) + 0.01 * share
        sigma = np.exp((1 - share) * np.log(side / 2) + share * np.log(width))
        best = ((codes[row] - units) ** 2).sum(axis=1).argmin()
        for unit in range(len(units)):
            away = (unit // side - best // side) ** 2 + (unit % side - best % side) ** 2
            units[unit] += rate * np.exp(-away / (2 * sigma**2)) * (codes[row] - units[unit])
    return units


def test_the_online_rule_is_kohonens() -> None:
    codes = sample(80, 4)
    rng = np.random.default_rng(3)
    mean, deviation = codes.mean(axis=0, dtype=float), codes.std(axis=0, dtype=float)
    lattice = 0.05 * rng.standard_normal((4, 4, 4))
    lattice[..., 0] += np.linspace(-2, 2, 4)[:, None]
    lattice[..., 1] += np.linspace(-2, 2, 4)
    start = (mean + deviation * lattice).astype(np.float32).reshape(16, 4).astype(float)
    order = [*rng.permutation(80).tolist(), *rng.permutation(80).tolist()]
    som = train(codes, size=4, seed=3, rule="online", epochs=2, width=0.7)
    np.testing.assert_allclose(som.codebook, plain_online(codes, start, order, 0.7), rtol=1e-5, atol=1e-6)
    assert som.epochs == 2


def test_the_online_map_learns_and_repeats_itself() -> None:
    codes, seen = sample(), []
    som = train(codes, rule="online", epochs=5, progress=lambda *told: seen.append(told))
    assert som.codebook.tobytes() == train(codes, rule="online", epochs=5).codebook.tobytes()
    assert (som.codebook != train(codes, seed=1, rule="online", epochs=5).codebook).any()
    assert [told[:2] for told in seen] == [(epoch, 5) for epoch in range(1, 6)]
    assert seen[-1][2] < 0.5 * seen[0][2]
    assert (
        quality_of(codes, som.codebook).quantisation_error
        < 1.3 * quality_of(codes, train(codes).codebook).quantisation_error
    )


def test_the_quantisation_error_falls_and_is_reported() -> None:
    codes, seen = sample(), []
    som = train_som(codes, 6, rng=np.random.default_rng(0), progress=lambda *told: seen.append(told))
    assert [epoch for epoch, _, _ in seen] == list(range(1, som.epochs + 1))
    assert {epochs for _, epochs, _ in seen} == {50}
    errors = [error for _, _, error in seen]
    final = quality_of(codes, som.codebook).quantisation_error
    assert final < 0.5 * errors[0]
    assert final == pytest.approx(brute_force(codes, som.codebook).min(axis=1).mean())


def test_the_error_that_is_told_is_of_all_frames() -> None:
    codes, seen = sample(2 * CHUNK + 100), []
    train(codes, size=3, epochs=2, progress=lambda *told: seen.append(told))
    before = train(codes, size=3, epochs=1).codebook
    assert seen[1][2] == pytest.approx(brute_force(codes, before).min(axis=1).mean())


def test_training_stops_when_settled_and_not_in_the_cooling_half() -> None:
    som = train(sample(200), size=3)
    assert 25 < som.epochs < 50
    assert train(sample(200), size=3, epochs=2).epochs <= 2
    assert train(sample(200), size=3, epochs=1).epochs == 1


def test_hits_count_the_training_frames() -> None:
    codes = sample()
    som = train(codes)
    units, _ = nearest_units(codes, Units.of(som.codebook))
    np.testing.assert_array_equal(som.hits, np.bincount(units, minlength=36))
    assert som.hits.dtype == np.int64


def test_neighbours_on_the_lattice_are_neighbours_in_space() -> None:
    # A flat sheet: an ordered map has neighbouring first and second units nearly everywhere.
    codes = np.random.default_rng(0).uniform(-1, 1, (2000, 2)).astype(np.float32)
    som = train(codes, size=8)
    assert quality_of(codes, som.codebook).topographic_error < 0.05
    shuffled = som.codebook[np.random.default_rng(0).permutation(64)]
    assert quality_of(codes, shuffled).topographic_error > 0.5


def test_topographic_error_by_hand() -> None:
    # A 3 x 3 map on a line: unit 0 at 0, unit 8 at 1, the rest far away.
    codebook = np.full((9, 1), 100, np.float32)
    codebook[0], codebook[8] = 0, 1
    codes = np.array([[0.1], [0.2], [0.9]], np.float32)
    assert quality_of(codes, codebook).topographic_error == 1
    codebook[4], codebook[8] = 1, 100
    assert quality_of(codes, codebook).topographic_error == 0


def test_distances_and_units_are_those_of_brute_force() -> None:
    codes, codebook = sample(5000), sample(49, seed=3)
    units, distances = nearest_units(codes, Units.of(codebook))
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
    np.testing.assert_array_equal(
        nearest_units(codes, Units.of(codebook))[0], brute_force(codes, codebook).argmin(axis=1)
    )


@pytest.mark.parametrize("k", [1, 2])
def test_near_ties_of_few_components_are_decided_exactly(k: int) -> None:
    """The rounding of a product is bounded from below, however few terms it has."""
    rng = np.random.default_rng(0)
    codebook = (1000 + 0.1 * rng.normal(size=(20, k))).astype(np.float32)
    codes = (1000 + 0.1 * rng.normal(size=(500, k))).astype(np.float32)
    np.testing.assert_array_equal(
        nearest_units(codes, Units.of(codebook))[0], brute_force(codes, codebook).argmin(axis=1)
    )


def test_only_live_units_answer() -> None:
    codes, codebook = sample(500), sample(36, seed=3)
    live = np.arange(36) % 3 == 0
    units, distances = nearest_units(codes, Units.of(codebook, live))
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
    assert 0 <= quality_of(codes, som.codebook).topographic_error <= 1
    if size == 1:
        np.testing.assert_allclose(som.codebook[0], codes.mean(axis=0), rtol=1e-5)


@pytest.mark.parametrize("n", [50, CHUNK + 50])
def test_map_quality_is_that_of_brute_force(n: int) -> None:
    codes, codebook = sample(n), sample(36, seed=3)
    hits = np.arange(36) % 3
    got = map_quality(codes, codebook, hits)
    every = brute_force(codes, codebook)
    falls = np.bincount(every.argmin(axis=1), minlength=36)
    assert (got.frames, got.dead) == (n, int((falls == 0).sum()))
    assert got.quantisation_error == pytest.approx(every.min(axis=1).mean(), rel=1e-6)
    shares = falls[falls > 0] / n
    assert got.entropy == pytest.approx(-(shares * np.log2(shares)).sum())
    assert got.unseen == pytest.approx(falls[::3].sum() / n)


def test_entropy_is_in_bits() -> None:
    codebook = np.arange(4, dtype=np.float32)[:, None]
    ones = np.ones(4, np.int64)
    assert map_quality(codebook, codebook, ones).entropy == 2
    assert map_quality(codebook[:1], codebook, ones).entropy == 0
    assert map_quality(codebook[:1], codebook, ones).dead == 3


def test_the_quality_of_no_frames_is_refused() -> None:
    with pytest.raises(VisionError, match="the quality of a map needs at least one descriptor, and there is none"):
        map_quality(sample(0), sample(4), np.ones(4, np.int64))
