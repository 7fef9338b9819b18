"""The place-normalised view: the covariance within places, its shrinkage, and the projection that follows from them."""

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import VisionError
from placerec.jobs import Executor, workers
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions, exact
from placerec.vision.chunks import CHUNK, spooled
from placerec.vision.pca import Pca, fit_pca, moments, project, projected
from placerec.vision.views import Scatter, place_normalised, place_numbers, place_scatter

WIDTH, PLACES = 24, 6
SPEC = DescriptorSpec(kind="npy", columns=WIDTH)


def sample(n: int = 2000, seed: int = 0, labelled: float = 0.8) -> tuple[Singles, Ints]:
    """Rows that differ within a place in some directions far more than in others, and the place of some of them."""
    rng = np.random.default_rng(seed)
    centres, turn = rng.normal(size=(PLACES, WIDTH)), np.linalg.qr(rng.normal(size=(WIDTH, WIDTH)))[0]
    places = rng.integers(PLACES, size=n)
    rows = 5 + 0.3 * centres[places] + (rng.normal(size=(n, WIDTH)) * 0.85 ** np.arange(WIDTH)) @ turn
    return rows.astype(np.float32), np.where(rng.random(n) < labelled, places, -1)


def names(places: Ints) -> list[str]:
    return ["" if place < 0 else f"room {place}" for place in places.tolist()]


def scatter_of(codes: Singles, places: Ints) -> Scatter:
    with spooled(codes) as rows:
        return place_scatter(rows, places)


def normalised(rows: Singles, places: Ints, components: int = 12) -> tuple[Pca, Pca, Scatter]:
    """The PCA, the place-normalised projection, and what this was made from."""
    pca = fit_pca(moments(rows), components)
    with spooled(projected(rows, pca)) as codes:
        return pca, place_normalised(pca, codes, places), place_scatter(codes, places)


def about_means(codes: Singles, places: Ints) -> Floats:
    """The labelled rows without the mean of their place."""
    values = codes.astype(float)
    return np.concatenate(
        [values[places == place] - values[places == place].mean(axis=0) for place in sorted({*places.tolist()} - {-1})]
    )


def test_the_scatter_is_that_about_the_means_of_places() -> None:
    codes, places = sample()
    found, apart = scatter_of(codes, places), about_means(codes, places)
    assert (found.n, found.places) == (len(apart), PLACES)
    np.testing.assert_allclose(found.covariance, apart.T @ apart / len(apart), rtol=1e-9, atol=1e-12)
    assert found.fourth == pytest.approx((np.square(apart).sum(axis=1) ** 2).sum(), rel=1e-12)


def test_rows_without_a_label_count_for_nothing_in_it() -> None:
    codes, places = sample()
    with_all, without = scatter_of(codes, places), scatter_of(codes[places >= 0], places[places >= 0])
    np.testing.assert_allclose(with_all.scatter, without.scatter, rtol=1e-9, atol=1e-9)
    assert with_all.n == without.n


@pytest.mark.parametrize("n", [40, 100, 2000])
def test_the_shrinkage_is_that_of_ledoit_and_wolf(n: int) -> None:
    codes, places = sample(n)
    found, apart = scatter_of(codes, places), about_means(codes, places)
    # Lemma 3.2 and section 3.3 of the article, as they stand there: norms are over the number of columns.
    covariance = apart.T @ apart / len(apart)
    mean = np.trace(covariance) / WIDTH
    far = np.square(covariance - mean * np.eye(WIDTH)).sum() / WIDTH
    noise = sum(np.square(np.outer(row, row) - covariance).sum() / WIDTH for row in apart) / len(apart) ** 2
    best = min(noise, far) / far
    assert found.shrinkage() == pytest.approx(max(best, WIDTH / (WIDTH + len(apart))), rel=1e-9)
    drawn = (1 - found.shrinkage()) * covariance + found.shrinkage() * mean * np.eye(WIDTH)
    np.testing.assert_allclose(found.shrunk(), drawn, rtol=1e-9, atol=1e-12)


def test_the_shrinkage_is_that_of_scikit_learn() -> None:
    library = pytest.importorskip("sklearn.covariance")
    for n, slope in ((60, 1), (500, 0.98)):
        places = np.arange(n) % PLACES
        # Nearly round, so that it is shrunk by far more than the least share.
        codes = (np.random.default_rng(n).normal(size=(n, WIDTH)) * slope ** np.arange(WIDTH)).astype(np.float32)
        shrunk, share = library.ledoit_wolf(about_means(codes, places), assume_centered=True)
        found = scatter_of(codes, places)
        assert share > WIDTH / n, "or the least share would hide it"
        assert found.shrinkage() == pytest.approx(share, rel=1e-6)
        np.testing.assert_allclose(found.shrunk(), shrunk, rtol=1e-6, atol=1e-8)


def test_few_frames_shrink_it_whatever_they_look_like() -> None:
    covariance = np.diag([100.0, 1, 1, 1])
    for n, share in ((4, 0.5), (12, 0.25), (396, 0.01)):
        assert Scatter(n, 2, covariance * n, n * np.square(covariance).sum()).shrinkage() == share


def test_it_does_not_depend_on_where_the_rows_are_cut() -> None:
    codes, places = sample(CHUNK + 300)

    def pieces() -> Iterator[Singles]:
        return iter(np.split(codes, [7, 4000, 4000, 4200]))

    whole = scatter_of(codes, places)
    with spooled(pieces) as rows:
        streamed = place_scatter(rows, places)
    assert streamed.scatter.tobytes() == whole.scatter.tobytes()
    assert streamed.fourth == whole.fourth


def test_frames_of_a_place_differ_by_one_in_every_direction() -> None:
    rows, places = sample(6000)
    _, view, found = normalised(rows, places)
    assert found.shrinkage() < 0.02
    apart = about_means(project(rows, view), places)
    covariance = apart.T @ apart / len(apart)
    np.testing.assert_allclose(covariance, np.eye(12), atol=0.1)
    # Far from what they were.
    plain = about_means(project(rows, fit_pca(moments(rows), 12)), places)
    assert np.square(plain).mean(axis=0).max() > 5 * np.square(plain).mean(axis=0).min()


def test_the_projection_is_the_formula_folded() -> None:
    rows, places = sample(200)
    pca, view, found = normalised(rows, places)
    values, vectors = np.linalg.eigh(found.shrunk())
    z = project(rows, pca).astype(float) @ vectors / np.sqrt(values)
    mine = project(rows, view).astype(float)
    # Up to a rotation: distances, and the inner products about the mean.
    np.testing.assert_allclose(mine @ mine.T, z @ z.T, rtol=1e-4, atol=1e-3)
    turn, _, _, _ = np.linalg.lstsq(z, mine, rcond=None)
    np.testing.assert_allclose(turn.T @ turn, np.eye(12), atol=1e-4)


def test_variances_of_all_frames_fall() -> None:
    rows, places = sample()
    pca, view, _ = normalised(rows, places)
    covariance = np.cov(project(rows, view).T.astype(float))
    np.testing.assert_allclose(covariance, np.diag(view.variances), atol=1e-4 * view.variances[0])
    assert (np.diff(view.variances) <= 0).all()
    assert view.variances[0] > 3 * view.variances[-1]
    assert (view.explained, view.needed) == (pca.explained, pca.needed)
    largest = np.abs(view.components).argmax(axis=1)
    assert (view.components[np.arange(12), largest] > 0).all()


def test_components_are_on_their_grid_however_large_they_are() -> None:
    rows, places = sample(500)
    for scale in (1e-6, 1, 1e6):
        _, view, _ = normalised(rows * np.float32(scale), places)
        assert (np.ldexp(view.grid, exact.BITS) % 1 == 0).all()
        assert np.abs(view.grid).max() <= 1
        np.testing.assert_array_equal((view.grid * view.scale).T, view.components)
    assert np.abs(view.components).max() < 1e-4


def test_a_row_is_projected_alike_in_any_batch() -> None:
    rows, places = sample(100)
    _, view, _ = normalised(rows, places)
    together = project(np.concatenate([1000 * rows, rows]), view)[100:]
    np.testing.assert_array_equal(together, np.concatenate([project(row[None], view) for row in rows]))


def fit(rows: Singles, places: list[str] | None, work: Executor | None = None, **options: Any) -> DictionarySet:
    chosen = replace(DictionarySetOptions(sizes=(3, 4), components=12, epochs=3), **options)
    return DictionarySet.fit(rows, spec=SPEC, places=places, options=chosen, work=work)


def test_views_and_sizes_are_dictionaries_in_their_order() -> None:
    rows, places = sample(400)
    found = fit(rows, names(places))
    assert found.names == ("", "plain4", "pn3", "pn4")
    assert [one.training.size for one in found.dictionaries] == [3, 4, 3, 4]
    plain, _, pn, other = (one.pca for one in found.dictionaries)
    assert plain.components.tobytes() == fit_pca(moments(rows), 12).components.tobytes()
    assert pn is other
    assert pn.components.tobytes() == normalised(rows, places)[1].components.tobytes()
    assert fit(rows, names(places), views=("pn", "plain")).names == ("", "pn4", "plain3", "plain4")
    alone = fit(rows, names(places), views=("pn",), sizes=(3,)).dictionaries[0]
    assert alone.fingerprint == found.dictionaries[2].fingerprint


def test_a_set_of_views_is_saved_and_loaded(tmp_path_factory: pytest.TempPathFactory) -> None:
    rows, places = sample(400)
    path = tmp_path_factory.mktemp("set") / "words.npz"
    for views in (("plain", "pn"), ("pn", "plain"), ("pn",)):
        found = fit(rows, names(places), views=views)
        found.save(path)
        loaded = DictionarySet.load(path)
        assert (loaded.names, loaded.fingerprint) == (found.names, found.fingerprint)
        assert len({id(one.pca) for one in loaded.dictionaries}) == len(views)
        for (units, distances), (loaded_units, far) in zip(found.words(rows), loaded.words(rows), strict=True):
            np.testing.assert_array_equal(units, loaded_units)
            np.testing.assert_array_equal(distances, far)


def test_any_number_of_workers_and_pieces_makes_the_same_bytes() -> None:
    rows, places = sample(CHUNK + 200)
    options: dict[str, Any] = {"fraction": 0.9, "seed": 2}
    alone = fit(rows, names(places), **options)
    assert fit(rows, names(places), workers(2), **options).fingerprint == alone.fingerprint
    streamed = DictionarySet.fit(
        lambda: iter(np.split(rows, [100, 4100])),
        spec=SPEC,
        places=names(places),
        options=DictionarySetOptions(sizes=(3, 4), components=12, epochs=3, fraction=0.9, seed=2),
    )
    assert streamed.fingerprint == alone.fingerprint


def test_a_fraction_draws_rows_with_their_labels() -> None:
    rows, places = sample(800)
    some = fit(rows, names(places), fraction=0.5, seed=4, sizes=(3,))
    kept = np.zeros(800, np.bool_)
    kept[np.random.Generator(np.random.PCG64(4)).permutation(800)[:400]] = True
    _, view, _ = normalised(rows[kept], places[kept])
    assert some.dictionaries[1].pca.components.tobytes() == view.components.tobytes()
    assert (some.dictionaries[1].quality.frames, some.dictionaries[1].quality.used) == (800, 400)


NONE = "it needs frames of two places, and of 300 frames none is labelled"


@pytest.mark.parametrize(
    ("places", "message"),
    [
        (None, NONE),
        ([""] * 300, NONE),
        (["kitchen"] * 200 + [""] * 100, "it needs frames of two places, and of 300 frames all 200 that are labelled"),
        (["a"] + ["b"] + [""] * 298, "it needs places with frames that differ, and all that are labelled are like"),
    ],
)
def test_without_labels_the_view_is_left_out_and_that_is_said(
    places: list[str] | None, message: str, caplog: pytest.LogCaptureFixture
) -> None:
    rows, _ = sample(300)
    with caplog.at_level(logging.WARNING):
        found = fit(rows, places, views=("plain", "pn"))
    assert found.names == ("", "plain4")
    assert found.fingerprint == fit(rows, None, views=("plain",)).fingerprint
    assert f"the view pn is left out: {message}" in caplog.text
    with pytest.raises(VisionError, match=f"^the view pn cannot be learned: {message}.*; label more frames, or choose"):
        fit(rows, places, views=("pn",))


def test_labels_of_other_rows_are_refused() -> None:
    with pytest.raises(VisionError, match="there are labels of 3 rows, and 300 descriptors; give each its own"):
        fit(sample(300)[0], ["a", "b", ""])


def test_places_are_numbered_by_name() -> None:
    assert place_numbers(["b", "", "a", "b"], 4).tolist() == [1, -1, 0, 1]
    assert place_numbers(None, 2).tolist() == [-1, -1]


@pytest.mark.parametrize("k", [1, 2, 5, 40])
def test_eigenvectors_are_those_of_lapack(k: int) -> None:
    x: NDArray[np.float64] = np.random.default_rng(k).normal(size=(3 * k, k)) * 0.8 ** np.arange(k)
    symmetric = x.T @ x
    values, vectors = exact.eigen(symmetric)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(symmetric)[::-1], rtol=1e-9, atol=1e-12 * values[0])
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(k), atol=1e-12)
    np.testing.assert_allclose(vectors.T * values @ vectors, symmetric, atol=1e-12 * values[0])


def test_eigenvectors_of_what_is_diagonal_or_nothing() -> None:
    values, vectors = exact.eigen(np.diag([1.0, 3, 2]))
    assert values.tolist() == [3, 2, 1]
    assert vectors.tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
    assert exact.eigen(np.zeros((4, 4)))[0].tolist() == [0] * 4
