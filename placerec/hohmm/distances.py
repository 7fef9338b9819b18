"""How far frames lie from their visual words, per place, as histograms.

They are of integers, so that adding and taking away is exact. A distance d is in bin b if 2**(b/8) <= d < 2**((b+1)/8):
the bins are an eighth of an octave wide.
"""

import numpy as np

from placerec.arrays import Floats, Ints

BINS_PER_OCTAVE = 8
# Ascending bin -> how many distances, none of them 0.
Histogram = dict[int, int]


def distance_bins(distances: Floats) -> Ints:
    """int64 (k,): floor(8 log2 d) of those of `distances` (n,) that are above 0; the others, and nan, are left out."""
    known = distances[np.isfinite(distances) & (distances > 0)]
    bins: Ints = np.floor(BINS_PER_OCTAVE * np.log2(known)).astype(np.int64)
    return bins


def distance_histogram(distances: Floats) -> Histogram:
    """How many of `distances` (n,) are in each bin."""
    bins, counts = np.unique(distance_bins(distances), return_counts=True)
    return dict(zip(bins.tolist(), counts.tolist(), strict=True))


def add_histograms(first: Histogram, second: Histogram, sign: int = 1) -> Histogram:
    """`first` plus `sign` (1 or -1) times `second`; a difference may be negative, an empty bin is left out."""
    total = {b: first.get(b, 0) + sign * second.get(b, 0) for b in sorted(first.keys() | second.keys())}
    return {b: count for b, count in total.items() if count}
