"""The order of an image's cells, against scipy's ranks."""

import numpy as np
from scipy.stats import rankdata

from placerec.vision import DescriptorSpec, descriptor
from placerec.vision.ranks import CELLS, LENGTH, ranks


def cells(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 40, (CELLS, CELLS)).astype(np.uint8)


def test_they_are_the_ranks_of_the_cells_and_equal_ones_share_theirs() -> None:
    small = cells()
    found = ranks(np.repeat(np.repeat(small, 5, axis=0), 7, axis=1))
    assert (str(found.dtype), found.shape) == ("float32", (LENGTH,))
    np.testing.assert_allclose(found, (rankdata(small.ravel()) - 0.5) / LENGTH - 0.5, atol=1e-7)
    assert abs(float(found.sum())) < 1e-4


def test_no_exposure_changes_them() -> None:
    small = np.repeat(np.repeat(cells(), 4, axis=0), 4, axis=1)
    assert (ranks(small) == ranks(small * 6)).all()
    assert (ranks(small) == ranks(np.sqrt(small.astype(np.float32)) * 9)).mean() > 0.99


def test_a_constant_image_is_zero() -> None:
    assert not ranks(np.full((50, 20), 200, np.uint8)).any()
    assert not descriptor(np.full((50, 20), 200, np.uint16), DescriptorSpec(kind="ranks")).any()
