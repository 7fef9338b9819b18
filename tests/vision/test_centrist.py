"""CENTRIST: a worked example, a slow plain twin, and what it does not depend on."""

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision import DescriptorSpec, centrist, descriptor, fit_image
from placerec.vision.centrist import census

# Few levels, so that neighbours are often equal.
IMAGES = st.tuples(st.integers(8, 17), st.integers(8, 17)).flatmap(
    lambda shape: arrays(np.uint8, shape, elements=st.integers(0, 3) | st.integers(252, 255))
)


def plain(image: NDArray[np.uint8]) -> tuple[list[list[int]], list[float]]:
    """Codes and descriptor, by loops over Python's integers."""
    levels = [[int(value) for value in row] for row in image]
    height, width = len(levels) - 2, len(levels[0]) - 2
    codes = [[0] * width for _ in range(height)]
    counts = [[0] * 256 for _ in range(4)]
    for y in range(height):
        for x in range(width):
            around = [levels[y + j][x + i] for j in range(3) for i in range(3) if (j, i) != (1, 1)]
            bits = "".join("1" if levels[y + 1][x + 1] >= value else "0" for value in around)
            codes[y][x] = int(bits, 2)
            counts[2 * (y * 2 // height) + x * 2 // width][codes[y][x]] += 1
    return codes, [count / sum(window) for window in counts for count in window[1:255]]


def test_a_code_by_hand() -> None:
    # 64 is at least 32, 64 | 32 ... but not 96: 1 1 0, 1 0, 1 1 0 = 128 + 64 + 16 + 4 + 2.
    levels = np.array([[32, 64, 96], [32, 64, 96], [32, 32, 96]], np.uint8)
    assert census(levels).tolist() == [[0b11010110]] == [[214]]


def test_a_descriptor_by_hand() -> None:
    """Bright columns 4 and 5 on black: of 36 codes, 9 a window, those of columns 3 and 6 see the edge."""
    image = np.zeros((8, 8), np.uint8)
    image[:, 4:6] = 200
    windows = centrist(image).reshape(4, 254)
    # Column 3 looks at the bright one on its right: 11 0, 1 0, 11 0. Column 6 at that on its left: 0 11, 0 1, 0 11.
    for window, code in ((0, 0b11010110), (1, 0b01101011), (2, 0b11010110), (3, 0b01101011)):
        assert np.flatnonzero(windows[window]).tolist() == [code - 1]
        assert windows[window, code - 1] == np.float32(3 / 9)


@given(image=IMAGES)
def test_it_is_its_plain_twin(image: NDArray[np.uint8]) -> None:
    codes, want = plain(image)
    assert census(image).tolist() == codes
    got = centrist(image)
    assert got.dtype == np.float32
    assert got.shape == (1016,)
    np.testing.assert_array_equal(got, np.array(want, np.float32))


@given(image=IMAGES, gain=st.integers(1, 60), offset=st.integers(0, 75))
def test_brightness_and_contrast_change_nothing(image: NDArray[np.uint8], gain: int, offset: int) -> None:
    dark = image & 3
    np.testing.assert_array_equal(centrist(dark), centrist((dark * gain + offset).astype(np.uint8)))


@given(image=IMAGES)
def test_every_kind_of_number_is_the_same_image(image: NDArray[np.uint8]) -> None:
    want = centrist(image)
    noise = np.random.default_rng(0).uniform(-1e-4, 1e-4, image.shape)
    for other in (image.astype(np.uint16) * 257, image.astype(np.float32), np.abs(image + noise), image.astype(int)):
        np.testing.assert_array_equal(centrist(other), want)


@pytest.mark.parametrize("value", [0, 128, 255, 31.7])
def test_a_constant_image_has_no_structure(value: float) -> None:
    for size in ((8, 8), (31, 57)):
        assert not centrist(np.full(size, value)).any()
    assert not descriptor(np.full((40, 31), value, np.float32), DescriptorSpec(kind="centrist", image_size=64)).any()


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((8, 7), np.uint8), "the image has 7 x 8 pixels; at least 8 x 8 are needed"),
        (np.full((9, 9), 300.0), "the image holds the value 300; grey values go from 0 to 255"),
        (np.full((9, 9), np.nan), "the image holds NaN or infinite values"),
        (np.zeros((9, 9, 3), np.uint8), "not (height, width); convert it to grey"),
    ],
)
def test_what_is_no_grey_image_is_refused(image: NDArray[Any], message: str) -> None:
    with pytest.raises(VisionError, match=re.escape(message)):
        centrist(image)


def test_the_image_is_fitted_first() -> None:
    image = np.random.default_rng(0).integers(0, 256, (60, 90), dtype=np.uint8)
    for fit in ("squash", "crop"):
        spec = DescriptorSpec(kind="centrist", image_size=32, fit=fit)
        np.testing.assert_array_equal(descriptor(image, spec), centrist(fit_image(image, 32, fit)))
        assert spec.length == 1016
