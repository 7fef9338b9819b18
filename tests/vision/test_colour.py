"""Colours on a grid: what they are, and what changes of light do to them, and what other places do."""

import cv2
import numpy as np
import pytest
from helpers.recordings import pictures
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.frames.sequence import Colours
from placerec.vision.colour import GAMMA, LENGTH, colour_grid, describe_grid

SHOWN = pictures(1, 96, 128)[0]


def described(picture: Colours) -> Singles:
    found = describe_grid(colour_grid(picture))
    assert (found.dtype, found.shape) == (np.dtype(np.float32), (LENGTH,))
    return found


def lit(picture: Colours, light: NDArray[np.float64]) -> Colours:
    """The picture after its linear light was multiplied."""
    linear = (picture / 255) ** GAMMA * light
    return np.asarray(np.rint(255 * linear.clip(0, 1) ** (1 / GAMMA)), np.uint8)


def change(picture: Colours, other: Colours) -> float:
    """The distance between two descriptors, beside the length of the first."""
    before = described(picture)
    return float(np.linalg.norm(described(other) - before) / np.linalg.norm(before))


def test_the_formula_step_by_step() -> None:
    linear = (cv2.resize(SHOWN, (96, 96), interpolation=cv2.INTER_AREA) / 255.0) ** 2.2
    grid = cv2.resize(linear.astype(np.float64), (6, 6), interpolation=cv2.INTER_AREA)
    logs = np.log(grid + 0.1 * grid.mean() + 1e-6)
    y, x = np.mgrid[0:6, 0:6]
    plane = np.stack([np.ones(36), x.ravel(), y.ravel()], axis=1)
    expected = []
    for channel in (2, 0):
        ratio = (logs[..., channel] - logs[..., 1]).ravel()
        expected.append(ratio - plane @ np.linalg.lstsq(plane, ratio, rcond=None)[0])
    assert np.allclose(described(SHOWN), np.stack(expected, axis=1).ravel(), atol=1e-5)


@pytest.mark.parametrize("side", [(8, 8), (8, 9), (50, 200), (200, 50)])
def test_pictures_of_any_size(side: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (*side, 3), np.uint8)
    assert described(picture).any()


def test_a_picture_of_one_colour_or_of_none_is_zero() -> None:
    assert not described(np.full((40, 30, 3), (7, 200, 90), np.uint8)).any()
    gray = cv2.cvtColor(SHOWN, cv2.COLOR_BGR2GRAY)
    assert not described(np.dstack([gray] * 3)).any()


def test_light_changes_little_and_another_place_much() -> None:
    # Neither bright enough to be clipped after it, nor dark.
    scene = np.asarray(80 + SHOWN // 4, np.uint8)
    elsewhere = change(scene, np.ascontiguousarray(scene[::-1, ::-1]))
    across = np.linspace(0.6, 1.4, scene.shape[1])[None, :, None]
    for name, light in {
        "exposure": np.array(0.6),
        "warm": np.array([0.55, 0.9, 1.25]),
        "a coloured lamp from one side": 0.5 + across * np.array([0.2, 0.5, 0.8]),
    }.items():
        assert change(scene, lit(scene, light)) < elsewhere / 4, name
    raw = cv2.resize(scene, (6, 6), interpolation=cv2.INTER_AREA).astype(float)
    warm = cv2.resize(lit(scene, np.array([0.55, 0.9, 1.25])), (6, 6), interpolation=cv2.INTER_AREA)
    # Which is what raw colours do not.
    assert np.linalg.norm(warm - raw) > np.linalg.norm(raw[::-1, ::-1] - raw) / 4


def test_the_noise_of_a_dark_picture_is_no_colour() -> None:
    rng = np.random.default_rng(1)
    linear = (SHOWN / 255) ** GAMMA * 0.2
    noisy = (rng.poisson(linear * 1000) + rng.normal(0, 3, linear.shape)) / 1000
    dim = np.asarray(np.rint(255 * noisy.clip(0, 1) ** (1 / GAMMA)), np.uint8)
    assert change(SHOWN, dim) < change(SHOWN, np.ascontiguousarray(SHOWN[::-1, ::-1])) / 4
