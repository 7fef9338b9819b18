"""ROS's raw images: every encoding that is read, and what is said of the others."""

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.recordings import pictures, raw
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.frames.image import as_gray
from placerec.frames.ros_image import RAW, image_of

COLOUR = pictures(1)[0]
GRAY = cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)


def levels(picture: NDArray[Any], encoding: str, **fields: Any) -> NDArray[Any]:
    image = image_of(SimpleNamespace(**raw(picture, encoding, **fields).fields), RAW, "it")
    assert isinstance(image, np.ndarray)
    return image


def failure(picture: NDArray[Any], encoding: str, **fields: Any) -> str:
    with pytest.raises(SourceError) as error:
        levels(picture, encoding, **fields)
    return str(error.value)


def test_grey_and_colours() -> None:
    opaque = cv2.cvtColor(COLOUR, cv2.COLOR_BGR2BGRA)
    for encoding in ("mono8", "8UC1"):
        assert np.array_equal(levels(GRAY, encoding), GRAY)
    for encoding, picture in (
        ("bgr8", COLOUR),
        ("8UC3", COLOUR),
        ("rgb8", COLOUR[..., ::-1]),
        ("bgra8", opaque),
        ("8UC4", opaque),
        ("rgba8", opaque[..., [2, 1, 0, 3]]),
    ):
        assert np.array_equal(levels(picture, encoding), GRAY), encoding


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
def test_sixteen_bits_in_both_orders(encoding: str) -> None:
    deep = GRAY.astype(np.uint16) * 16
    expected = GRAY * np.float32(16 * 255 / 4095)
    assert np.allclose(levels(deep, encoding), expected)
    assert np.array_equal(levels(deep.astype(">u2"), encoding, is_bigendian=1), levels(deep, encoding))
    full = GRAY.astype(np.uint16) * 257
    assert np.allclose(levels(full, encoding), GRAY)
    wide = cv2.cvtColor(full, cv2.COLOR_GRAY2BGR)
    for colours in ("rgb16", "bgr16"):
        assert np.allclose(levels(wide, colours), GRAY, atol=0.01)
        assert np.allclose(levels(wide.astype(">u2"), colours, is_bigendian=1), GRAY, atol=0.01)


def test_floats() -> None:
    unit = GRAY.astype(np.float32) / 255
    assert np.allclose(levels(unit, "32FC1"), GRAY, atol=1e-3)
    assert np.allclose(levels(unit.astype(">f4"), "32FC1", is_bigendian=1), GRAY, atol=1e-3)
    depth = unit * 7
    depth[0, :4] = np.nan, np.inf, -np.inf, -3
    found = levels(depth, "32FC1")
    assert found.dtype == np.float32
    assert found[0, :4].tolist() == [0, 0, 0, 0]
    assert np.allclose(found[1:], 255 * depth[1:] / np.nanmax(depth[1:]), atol=1e-3)
    assert levels(np.zeros((8, 8), np.float32), "32FC1").max() == 0


@pytest.mark.parametrize(("encoding", "luma"), [("yuv422", 1), ("uyvy", 1), ("yuv422_yuy2", 0), ("yuyv", 0)])
def test_luma_of_yuv(encoding: str, luma: int) -> None:
    packed = np.full((48, 64, 2), 128, np.uint8)
    packed[..., luma] = GRAY
    assert np.array_equal(levels(packed, encoding), GRAY)


@pytest.mark.parametrize("encoding", ["nv12", "nv21", "yuv420", "i420", "yv12"])
def test_grey_levels_before_colours(encoding: str) -> None:
    planes = np.concatenate([GRAY.reshape(-1), np.full(GRAY.size // 2, 128, np.uint8)])
    assert np.array_equal(levels(GRAY, encoding, data=planes), GRAY)
    assert np.array_equal(levels(planes.reshape(72, 64), encoding), GRAY)
    padded = np.zeros((72, 80), np.uint8)
    padded[:48, :64] = GRAY
    assert np.array_equal(levels(GRAY, encoding, step=80, data=padded.reshape(-1)), GRAY)


@pytest.mark.parametrize(
    ("pattern", "colours"), [("rggb", "RGGB"), ("bggr", "BGGR"), ("gbrg", "GBRG"), ("grbg", "GRBG")]
)
def test_bayer(pattern: str, colours: str) -> None:
    """A red, a green and a blue surface seen through the filter of this name have the luma of that colour."""
    for colour, luma in (("R", 0.299), ("G", 0.587), ("B", 0.114)):
        tile = np.array([200 if letter == colour else 0 for letter in colours], np.uint8).reshape(2, 2)
        seen = np.tile(tile, (8, 8))
        assert np.allclose(levels(seen, f"bayer_{pattern}8")[2:-2, 2:-2], 200 * luma, atol=1)
        deep = seen.astype(np.uint16) * 257
        expected = as_gray(np.full((8, 8), round(200 * 257 * luma), np.uint16), "it")[0, 0]
        assert np.allclose(levels(deep, f"bayer_{pattern}16")[2:-2, 2:-2], expected, rtol=0.01)


def test_rows_may_be_padded() -> None:
    padded = np.full((48, 3 * 64 + 20), 255, np.uint8)
    padded[:, : 3 * 64] = COLOUR.reshape(48, -1)
    data = padded.reshape(-1)
    assert np.array_equal(levels(COLOUR, "bgr8", step=padded.shape[1], data=data), GRAY)
    wide = np.zeros((48, 70), np.uint16)
    wide[:, :64] = GRAY.astype(np.uint16) * 257
    given = {"step": 140, "data": wide.astype(">u2").view(np.uint8).reshape(-1), "is_bigendian": 1}
    assert np.allclose(levels(GRAY, "mono16", **given), GRAY)


def test_what_cannot_be_read() -> None:
    assert failure(COLOUR, "nv99").startswith("it has the encoding 'nv99', which is not read; known are mono8, ")
    for fields in ({"step": 5}, {"height": 4800}, {"width": 0}, {"height": 0}, {"data": np.zeros(7, np.uint8)}):
        assert failure(COLOUR, "bgr8", **fields).startswith("it is damaged: "), fields
    assert "is 4x4 pixels, and 8 a side are needed" in failure(COLOUR[:4, :4], "bgr8")
    assert "is 1x1 pixels" in failure(COLOUR[:1, :1], "bayer_rggb8")
    assert "is 2x2 pixels" in failure(np.ones((2, 2), np.float32), "32FC1")
