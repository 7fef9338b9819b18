"""One frame's words: looked up in all dictionaries at once, to the same bytes as those of many frames."""

from dataclasses import replace

import numpy as np
import pytest

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.vision import DescriptorSpec, Dictionary, DictionarySet, DictionarySetOptions
from placerec.vision.lookup import Lookup

SPEC = DescriptorSpec(kind="npy", columns=30)


def sample(n: int, seed: int = 0) -> Singles:
    rng = np.random.default_rng(seed)
    return (np.random.default_rng(9).random((20, 30))[rng.integers(20, size=n)] + 0.1 * rng.random((n, 30))).astype(
        np.float32
    )


@pytest.fixture(scope="module", params=["live", "all"])
def several(request: pytest.FixtureRequest) -> DictionarySet:
    options = DictionarySetOptions(sizes=(4, 6), components=12, units=request.param)
    places = [f"place {row % 3}" for row in range(200)]
    return DictionarySet.fit(sample(200), spec=SPEC, places=places, options=options)


def lookup(dictionaries: DictionarySet) -> Lookup | None:
    return Lookup.of([(one.pca, one.units) for one in dictionaries.dictionaries])


def check_rows(dictionaries: DictionarySet, rows: Singles) -> None:
    """The answers for one row at a time are, to the byte, those for all."""
    for at, (units, distances) in enumerate(dictionaries.words(rows)):
        alone = [dictionaries.words(row[None])[at] for row in rows]
        assert np.concatenate([unit for unit, _ in alone]).tobytes() == units.tobytes()
        assert np.concatenate([distance for _, distance in alone]).tobytes() == distances.tobytes()


def test_a_frame_alone_has_the_answers_that_it_has_among_others(several: DictionarySet) -> None:
    rows = np.concatenate([sample(300, 1), 1000 * sample(20, 2), np.zeros((1, 30), np.float32)])
    check_rows(several, rows)
    found = lookup(several)
    assert found is not None
    # Not by chance of a search that gives up: it is the way that most rows go.
    assert sum(found.nearest(row) is not None for row in rows) > 0.9 * len(rows)


def test_of_equally_near_units_the_first_answers(several: DictionarySet) -> None:
    first, second, *others = several.dictionaries
    codebook = second.codebook.copy()
    codebook[20:] = codebook[:16]
    twice = DictionarySet((first, replace(second, codebook=codebook, hits=np.maximum(second.hits, 1)), *others))
    rows = sample(50, 3)
    found = lookup(twice)
    assert found is not None
    assert any(found.nearest(row) is None for row in rows)
    check_rows(twice, rows)
    assert twice.words(rows)[1][0].max() < 20


def test_units_within_rounding_of_each_other_are_told_apart(several: DictionarySet) -> None:
    first, second, *others = several.dictionaries
    codebook = second.codebook.copy()
    codebook[20:] = np.nextafter(codebook[:16], np.float32(np.inf))
    close = DictionarySet((first, replace(second, codebook=codebook, hits=np.maximum(second.hits, 1)), *others))
    check_rows(close, sample(200, 5))


def test_dictionaries_of_unlike_projections_are_looked_up_one_by_one(several: DictionarySet) -> None:
    first, second, third, fourth = several.dictionaries
    elsewhere = replace(second, pca=replace(second.pca, mean=second.pca.mean + 0.01))
    fewer = Dictionary.fit(sample(100), spec=SPEC)
    for others in ((elsewhere,), (third, second, fourth), (replace(fewer, name="plain10"),)):
        mixed = DictionarySet((first, *others))
        assert lookup(mixed) is None
        check_rows(mixed, sample(30, 4))


def test_a_frame_that_is_not_finite_is_refused(several: DictionarySet) -> None:
    for value in (np.nan, np.inf):
        row = sample(1)
        row[0, 3] = value
        with pytest.raises(VisionError, match=r"descriptor 0 \(from 0\) holds NaN or infinite values"):
            several.words(row)
    # Too large to be squared, and yet a number.
    check_rows(several, np.full((2, 30), 1e25, np.float32))
