"""Grey images as the descriptor wants them: checked, in 0..255, fitted to a square."""

from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.frames.sequence import Gray

FITS = ("squash", "crop")
SMALLEST = 8


def check_gray(image: NDArray[Any]) -> Gray:
    """The image as (h, w) grey of 0..255: uint8 as it is, uint16 divided by 257, anything else as float32.

    Raises VisionError (without a file name: the caller knows it) for an image that is not two-dimensional, is
    smaller than 8 pixels a side, is not numeric, or holds NaN, infinities or negative values.
    """
    image = np.asarray(image)
    if image.ndim != 2:
        raise VisionError(f"the image has the shape {image.shape}, not (height, width); convert it to grey")
    if min(image.shape) < SMALLEST:
        raise VisionError(f"the image has {image.shape[1]} x {image.shape[0]} pixels; at least 8 x 8 are needed")
    if image.dtype.kind not in "uif":
        raise VisionError(f"the image holds {image.dtype} values, not numbers of 0..255")
    if image.dtype == np.uint8:
        return image
    # Dividing keeps all sixteen bits; shifting them away would leave 12-bit cameras nearly black.
    gray = image.astype(np.float32) / np.float32(257 if image.dtype == np.uint16 else 1)
    low, high = float(gray.min()), float(gray.max())
    if not np.isfinite(low) or not np.isfinite(high):
        raise VisionError("the image holds NaN or infinite values; repair or remove it")
    if low < 0:
        raise VisionError(f"the image holds the value {low:g}; grey values go from 0 to 255")
    return gray


def fit_image(gray: Gray, size: int, fit: str = "squash") -> Gray:
    """The image resized to (size, size), dtype kept: area average where it shrinks, linear where it grows.

    `squash` changes the aspect ratio and keeps every pixel; `crop` scales the shorter side to `size` and keeps the
    centre (section 1 of our GIST specification, LMgist). Raises VisionError for another fit or a size below 8.
    """
    if fit not in FITS:
        raise VisionError(f"no fit is called {fit!r}; choose one of {', '.join(FITS)}")
    if size < SMALLEST:
        raise VisionError(f"an image size of {size} is too small; at least 8 is needed")
    if gray.shape != (size, size) and gray.min() == gray.max():
        # Interpolation in floating point would leave rounding noise, which LMgist's stretch blows up to a texture.
        return cast(Gray, np.full((size, size), gray[0, 0]))
    return cast(Gray, fit_pixels(gray, size, size, fit))


def fit_pixels(pixels: NDArray[Any], height: int, width: int, fit: str) -> NDArray[Any]:
    """Pixels (h, w) or (h, w, channels) as `fit_image` resizes them, to (height, width)."""
    high, wide = pixels.shape[:2]
    if (high, wide) == (height, width):
        return pixels
    if fit == "squash":
        return _resize(pixels, height, width)
    scale = max(height / high, width / wide)
    high, wide = int(scale * high + 0.5), int(scale * wide + 0.5)
    top, left = (high - height) // 2, (wide - width) // 2
    return _resize(pixels, high, wide)[top : top + height, left : left + width]


def _resize(pixels: NDArray[Any], height: int, width: int) -> NDArray[Any]:
    # One axis may shrink while the other grows, and INTER_AREA averages only if both shrink: hence two steps.
    small = (min(width, pixels.shape[1]), min(height, pixels.shape[0]))
    shrunk = cv2.resize(pixels, small, interpolation=cv2.INTER_AREA)
    return cv2.resize(shrunk, (width, height), interpolation=cv2.INTER_LINEAR)
