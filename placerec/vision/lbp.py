"""Local binary patterns: which neighbours are clearly darker than each pixel of a smoothed image.

T. Ojala, M. Pietikainen, T. Maenpaa: "Multiresolution gray-scale and rotation invariant texture classification with
local binary patterns", PAMI 2002; of it the uniform patterns. Ours: the image is smoothed first, and a neighbour is
darker only by more than a fifth of the image's standard deviation, in the manner of X. Tan, B. Triggs: "Enhanced local
texture feature sets for face recognition under difficult lighting conditions", TIP 2010. Without both, a sensor's
noise in the dark decides most patterns of flat surfaces (docs/vision.md has the numbers).
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.vision.images import check_gray

SIDE = 64  # of the image whose pixels are compared
SMOOTHED = 1.0  # standard deviation of the Gaussian, in pixels
CLEARLY = np.float32(0.2)  # of the standard deviation of the smoothed image
WINDOWS = 2  # per axis
# Around the pixel, so that bits beside each other are neighbours beside each other.
_RING = ((0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0))


def _patterns() -> NDArray[np.int64]:
    """The number of each code's pattern: uniform ones, with at most two changes around the pixel, 0..57; others 58."""
    codes = np.arange(256)
    changes = codes ^ (codes >> 1 | (codes & 1) << 7)
    uniform = np.array([bin(change).count("1") <= 2 for change in changes])
    return np.where(uniform, np.cumsum(uniform) - 1, uniform.sum())


_PATTERN = _patterns()
PATTERNS = int(_PATTERN.max()) + 1
LENGTH = WINDOWS**2 * PATTERNS


def lbp(image: NDArray[Any]) -> Singles:
    """The local binary patterns of one grey image: in each of 2 x 2 windows, the share of its pixels with each pattern.

    image: (h, w), grey of 0..255, uint8, uint16 (taken as 0..65535) or float; 8 x 8 at least. A code's bits, the
    highest first, are the eight neighbours clockwise from the upper left: 1 where the pixel is clearly brighter.
    Returns float32 (236,): windows row by row, in each the 58 uniform codes ascending and then all others; exact zeros
    of a constant image. Raises VisionError for an image that cannot be used.
    """
    gray = check_gray(image).astype(np.float32)
    if gray.min() == gray.max():
        return np.zeros(LENGTH, np.float32)
    small = cv2.GaussianBlur(cv2.resize(gray, (SIDE, SIDE), interpolation=cv2.INTER_AREA), (0, 0), SMOOTHED)
    inner = SIDE - 2
    pixel = small[1:-1, 1:-1] - CLEARLY * small.std()
    codes = np.zeros((inner, inner), np.uint8)
    for row, column in _RING:
        codes <<= 1
        codes |= pixel >= small[row : row + inner, column : column + inner]
    window = np.arange(inner) * WINDOWS // inner
    number = (window[:, None] * WINDOWS + window) * PATTERNS + _PATTERN[codes]
    counts = np.bincount(number.ravel(), minlength=LENGTH).reshape(-1, PATTERNS)
    shares: Singles = (counts / counts.sum(axis=1, keepdims=True)).astype(np.float32)
    return shares.ravel()
