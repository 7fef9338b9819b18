"""Colours on a grid, in a form that stands changes of light: what each cell's colour is beside that of the others.

A lamp of another colour multiplies red, green and blue of linear light by a factor each, exposure by one factor: both
add a constant to the logarithm of the ratio of two channels. A lamp at one side adds about a slope. So what is left of
these logarithms once the plane that fits them best is taken off does not change with them. The offset keeps what is
dark, and mostly noise, near the mean (docs/vision.md has what it stands under simulated light, and raw colours do not).
"""

import cv2
import numpy as np

from placerec.arrays import Floats, Singles
from placerec.frames.sequence import Colours
from placerec.vision.images import fit_pixels

CELLS = 6  # per axis
SIDE = 96  # pixels, above which the time goes up, and nothing else
GAMMA = 2.2
OFFSET = 0.1  # of the mean of all cells and channels
LENGTH = CELLS**2 * 2
_LINEAR = ((np.arange(256) / 255) ** GAMMA).astype(np.float32)


def _flattening() -> Floats:
    """What takes the plane off values of the cells, (36, 36): the columns of a plane are at right angles here."""
    axis = np.arange(CELLS) - (CELLS - 1) / 2
    planes = np.stack([np.ones((CELLS, CELLS)), np.tile(axis, (CELLS, 1)), np.tile(axis[:, None], (1, CELLS))])
    rows = planes.reshape(3, -1)
    flattening: Floats = np.eye(CELLS**2) - rows.T @ (rows / np.square(rows).sum(axis=1, keepdims=True))
    return flattening


_FLATTENING = _flattening()


def colour_grid(colours: Colours) -> Singles:
    """The mean linear light in 6 x 6 cells of an image (h, w, 3) blue, green, red: float32 (6, 6, 3) of 0..1.

    An image of more than 96 pixels a side is first averaged to that. Exact zeros of an image of one colour throughout.
    """
    height, width = (min(side, SIDE) for side in colours.shape[:2])
    small = np.asarray(fit_pixels(colours, height, width, "squash"), np.uint8)
    if (small == small[0, 0]).all():
        return np.zeros((CELLS, CELLS, 3), np.float32)
    linear = cv2.LUT(small, _LINEAR)
    return np.asarray(cv2.resize(linear, (CELLS, CELLS), interpolation=cv2.INTER_AREA), np.float32)


def describe_grid(grid: Singles) -> Singles:
    """The colours on a `colour_grid`, float32 (72,): cells row by row, of each log red/green and log blue/green.

    Zeros of an image without colours.
    """
    logs = np.log(grid.astype(np.float64) + OFFSET * float(grid.mean(dtype=np.float64)) + 1e-6)
    ratios = np.stack([logs[..., 2] - logs[..., 1], logs[..., 0] - logs[..., 1]], axis=-1).reshape(-1, 2)
    flat: Singles = np.einsum("ij,jk->ik", _FLATTENING, ratios).astype(np.float32).ravel()
    return flat
