"""The order of a small image's cells from dark to bright: what no exposure changes.

Ranks in place of values are the ordinal measures of D. N. Bhat, S. K. Nayar: "Ordinal measures for image
correspondence", PAMI 1998; as a descriptor of a whole image, with 12 x 12 cells, they are ours.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.vision.images import check_gray

CELLS = 12  # per axis
LENGTH = CELLS**2


def ranks(image: NDArray[Any]) -> Singles:
    """The ranks of the mean grey levels of 12 x 12 cells: float32 (144,), row by row, from -1/2 to 1/2.

    image: (h, w), grey of 0..255, uint8, uint16 (taken as 0..65535) or float; 8 x 8 at least. Equal cells share the
    middle of their ranks, so that a constant image gives exact zeros. Raises VisionError for an image that cannot be
    used.
    """
    gray = check_gray(image).astype(np.float32)
    cells = cv2.resize(gray, (CELLS, CELLS), interpolation=cv2.INTER_AREA)
    _, level, cells_of = np.unique(cells.ravel(), return_inverse=True, return_counts=True)
    middle = np.cumsum(cells_of) - (cells_of - 1) / 2  # 1-based
    places: Singles = ((middle[level.reshape(-1)] - 0.5) / LENGTH - 0.5).astype(np.float32)
    return places
