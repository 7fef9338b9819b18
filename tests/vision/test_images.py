"""Fitting images to the square."""

import cv2
import numpy as np
import pytest

from placerec.errors import VisionError
from placerec.vision import fit_image


@pytest.mark.parametrize("fit", ["squash", "crop"])
@pytest.mark.parametrize("shape", [(48, 64), (64, 48), (30, 30), (20, 90), (41, 37)])
def test_the_result_has_the_size_and_type_asked_for(fit: str, shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    small, fine = fit_image(image, 32, fit), fit_image(image.astype(np.float32), 32, fit)
    assert small.shape == fine.shape == (32, 32)
    assert small.dtype == np.uint8
    assert fine.dtype == np.float32
    # Two roundings, where one axis shrinks and the other grows.
    np.testing.assert_allclose(small, fine, rtol=0, atol=1.5)


def test_shrinking_averages_over_areas() -> None:
    image = np.random.default_rng(0).integers(0, 256, (64, 128)).astype(np.float32)
    means = image.reshape(16, 4, 16, 8).mean(axis=(1, 3))
    np.testing.assert_allclose(fit_image(image, 16), means, rtol=1e-5)


def test_an_axis_that_shrinks_is_averaged_though_the_other_grows() -> None:
    # Stripes of one pixel: sampling without averaging would show black or white.
    image = np.zeros((12, 96), np.float32)
    image[:, ::2] = 200
    image[0] += 1
    fitted = fit_image(image, 24)
    np.testing.assert_allclose(fitted[4:], 100, atol=1e-3)


def test_crop_keeps_the_aspect_ratio_and_the_centre() -> None:
    image = np.zeros((40, 81), np.uint8)
    cv2.circle(image, (40, 20), 12, 255, -1)
    crop = fit_image(image, 40, "crop")
    np.testing.assert_array_equal(crop, image[:, 20:60])
    squashed = fit_image(image, 40, "squash")
    assert (squashed > 128).sum() < 0.6 * (crop > 128).sum()


def test_an_image_that_fits_is_not_touched() -> None:
    image = np.random.default_rng(0).integers(0, 256, (32, 32)).astype(np.uint8)
    for fit in ("squash", "crop"):
        np.testing.assert_array_equal(fit_image(image, 32, fit), image)


def test_a_constant_image_stays_constant() -> None:
    fitted = fit_image(np.full((37, 53), 0.1, np.float32), 29)
    assert (fitted == np.float32(0.1)).all()


def test_an_unknown_fit_is_refused() -> None:
    with pytest.raises(VisionError, match="no fit is called 'stretch'; choose one of squash, crop"):
        fit_image(np.zeros((9, 9), np.uint8), 8, "stretch")
