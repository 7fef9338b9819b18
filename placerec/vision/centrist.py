"""CENTRIST, the census transform histogram: the signature of Wu's place recogniser.

J. Wu, J. M. Rehg: "CENTRIST: a visual descriptor for scene categorization", PAMI 2011. Taken from it, from memory: a
bit is 1 where the centre is at least its neighbour, the bits go row by row, pixels of the border have no code, and the
codes 0 and 255 (single specks, flat surfaces) are not counted. Ours: the windows. The paper has a pyramid of 31, each
with a PCA of its own; here 2 x 2 windows go through the one PCA of the dictionary. On three real sets they gave words
as good on average as the pyramid's two coarser levels, and better ones than a single window; 4 x 4 are as many values
as the PCA can take, and were no better where they were tried.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.vision.images import check_gray

WINDOWS = 2  # per axis
CODES = 254  # 1..254
LENGTH = WINDOWS**2 * CODES


def census(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The census transform of grey levels (h, w): codes (h - 2, w - 2), of every pixel that has eight neighbours.

    A code's bits, the highest first, are the neighbours row by row from the upper left: 1 where centre >= neighbour.
    """
    height, width = levels.shape
    centre = levels[1:-1, 1:-1]
    codes = np.zeros(centre.shape, np.uint8)
    for row, column in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)):
        codes <<= 1
        codes |= centre >= levels[row : height - 2 + row, column : width - 2 + column]
    return codes


def centrist(image: NDArray[Any]) -> Singles:
    """The CENTRIST of one grey image: in each of 2 x 2 windows, the share of its pixels that have each code 1..254.

    image: (h, w), grey of 0..255, uint8, uint16 (taken as 0..65535) or float, rounded to whole levels; 8 x 8 at least.
    Returns float32 (1016,): windows row by row, codes ascending. A constant image gives exact zeros: its only code is
    255. Raises VisionError for an image that cannot be used.
    """
    gray = check_gray(image)
    # Resizing leaves rounding noise in the flat parts of float images, and a comparison knows no tolerance.
    levels = gray if gray.dtype == np.uint8 else np.rint(gray)
    if levels.max() > 255:
        raise VisionError(f"the image holds the value {levels.max():g}; grey values go from 0 to 255")
    codes = census(levels.astype(np.uint8))
    rows, columns = (np.arange(side) * WINDOWS // side for side in codes.shape)
    window = rows[:, None] * WINDOWS + columns
    counts = np.bincount((window * 256 + codes).ravel(), minlength=WINDOWS**2 * 256).reshape(-1, 256)
    shares: Singles = (counts[:, 1:255] / counts.sum(axis=1, keepdims=True)).astype(np.float32)
    return shares.ravel()
