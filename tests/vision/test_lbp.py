"""Local binary patterns, against a slow writing-out of what they are."""

import cv2
import numpy as np
import pytest

from placerec.errors import VisionError
from placerec.vision import DescriptorSpec, descriptor
from placerec.vision.lbp import LENGTH, PATTERNS, lbp

RING = ((-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1))


def image(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(0, 256, (9, 9)).astype(np.uint8), (64, 64), interpolation=cv2.INTER_CUBIC)


def written_out(gray: np.ndarray) -> np.ndarray:
    small = cv2.GaussianBlur(gray.astype(np.float32), (0, 0), 1.0)
    apart = np.float32(0.2) * small.std()
    uniform = [code for code in range(256) if sum((code >> k & 1) != (code >> (k + 1) % 8 & 1) for k in range(8)) <= 2]
    counts = np.zeros((2, 2, PATTERNS))
    for row in range(1, 63):
        for column in range(1, 63):
            code = 0
            for down, right in RING:
                code = 2 * code + int(small[row, column] - apart >= small[row + down, column + right])
            pattern = uniform.index(code) if code in uniform else len(uniform)
            counts[(row - 1) * 2 // 62, (column - 1) * 2 // 62, pattern] += 1
    return np.ravel(counts / counts.sum(axis=2, keepdims=True))


def test_it_is_what_it_says() -> None:
    found = lbp(image())
    assert (str(found.dtype), found.shape, PATTERNS) == ("float32", (LENGTH,), 59)
    np.testing.assert_allclose(found, written_out(image()), atol=1e-7)


def test_more_light_or_contrast_changes_nothing_and_noise_little() -> None:
    gray = image().astype(np.float32)
    np.testing.assert_allclose(lbp(gray * 0.5 + 10), lbp(gray), atol=0.002)
    noisy = gray + np.random.default_rng(1).normal(0, 8, gray.shape).astype(np.float32)
    assert np.abs(lbp(np.maximum(noisy, 0)) - lbp(gray)).sum() < 0.2 * np.abs(lbp(image(2)) - lbp(gray)).sum()


def test_a_constant_image_is_zero_and_what_is_no_image_is_refused() -> None:
    assert not lbp(np.full((40, 30), 7, np.uint8)).any()
    assert not descriptor(np.full((40, 30), 7, np.float32), DescriptorSpec(kind="lbp")).any()
    with pytest.raises(VisionError, match="not \\(height, width\\)"):
        lbp(np.zeros((8, 8, 3), np.uint8))
