"""How well a map represents frames, those it was trained on or others."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision.chunks import Rows, Source, each_chunk
from placerec.vision.som import best_units, torn


@dataclass(frozen=True)
class MapQuality:
    """Over `frames` frames, each at the nearest of all units, dead ones among them.

    quantisation_error: mean distance to that unit, in the units of PCA space. topographic_error: share of the frames
    whose second nearest unit is not one of the 8 neighbours of the nearest. entropy: of the frames over the units, in
    bits; log2 of the number of units if all are used alike. dead: units that none of the frames fell on.
    unseen: share of the frames on units that no training frame hit.
    """

    frames: int
    quantisation_error: float
    topographic_error: float
    entropy: float
    dead: int
    unseen: float


def map_quality(source: Source, codebook: Rows, hits: NDArray[np.int64]) -> MapQuality:
    """The quality of a map (K, k) for coordinates (n, k), in one pass; `hits` (K,): the training frames per unit.

    Errors are rounded to 9 digits. Raises VisionError if there are no rows.
    """
    falls = np.zeros(len(codebook), np.int64)
    distance, apart = 0.0, 0
    for its, far, loose in each_chunk(source)(partial(_fall, codebook)):
        falls += its
        distance += far
        apart += loose
    n = int(falls.sum())
    if n == 0:
        raise VisionError("the quality of a map needs at least one descriptor, and there is none; name more images")
    shares = falls[falls > 0] / n
    return MapQuality(
        n,
        round(distance / n, 9),
        round(apart / n, 9),
        round(abs(float((shares * np.log2(shares)).sum())), 9),
        int(np.count_nonzero(falls == 0)),
        round(float(falls[hits == 0].sum() / n), 9),
    )


def _fall(codebook: Rows, rows: Rows) -> tuple[NDArray[np.int64], float, int]:
    """How many rows each unit got (K,), the sum of their distances, and how many have their next unit elsewhere."""
    units, nearest = best_units(rows, codebook)
    apart = int(np.count_nonzero(torn(rows, codebook, units)))
    return np.bincount(units, minlength=len(codebook)), float(nearest.sum(dtype=np.float64)), apart
