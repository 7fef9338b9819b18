"""One frame's words in several dictionaries at once: what is asked for frame by frame must cost little beside GIST."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.vision import exact
from placerec.vision.pca import Pca
from placerec.vision.som import Units, rounding


@dataclass(frozen=True, eq=False)
class Lookup:
    """What the search for one frame's words needs of D dictionaries, whatever the frame; made by `of`.

    mean (d,), grid (d, V k) and scale (V k,): the projections of V views, one behind the other. places: for every view
    the units (K, k) that may answer, of all dictionaries of the view, and together: those of all views. For each of
    these halves, unit and owner: half the squared norm, the index in the codebook, the number of the dictionary. For
    each dictionary starts, view (D,) and largest: the first unit, the number of the view; this and the largest squared
    norm.
    """

    mean: Floats
    grid: Floats
    scale: Floats
    places: tuple[Singles, ...]
    together: Singles
    halves: Singles
    unit: Ints
    owner: Ints
    starts: Ints
    view: Ints
    largest: tuple[tuple[int, float], ...]

    @classmethod
    def of(cls, dictionaries: Sequence[tuple[Pca, Units]]) -> "Lookup | None":
        """The projections and codebooks made ready; None where they have not one mean and number of components."""
        views = list({id(pca): pca for pca, _ in dictionaries}.values())
        first = views[0]
        if any(len(pca.variances) != len(first.variances) or (pca.mean != first.mean).any() for pca in views):
            return None
        numbers = [next(at for at, view in enumerate(views) if view is pca) for pca, _ in dictionaries]
        # By view, the search is one product for each.
        if numbers != sorted(numbers):
            return None
        every = [units for _, units in dictionaries]
        sizes = np.array([len(units.places) for units in every])
        own = [
            np.concatenate([units.places for units, number in zip(every, numbers, strict=True) if number == at])
            for at in range(len(views))
        ]
        return cls(
            first.mean,
            np.concatenate([pca.grid.T for pca in views]).T,
            np.concatenate([pca.scale for pca in views]),
            tuple(own),
            np.concatenate(own),
            np.concatenate([units.halves for units in every]),
            np.concatenate([np.arange(len(units.places)) if units.among is None else units.among for units in every]),
            np.repeat(np.arange(len(every)), sizes),
            np.cumsum(sizes) - sizes,
            np.array(numbers),
            tuple((number, units.largest) for number, units in zip(numbers, every, strict=True)),
        )

    def nearest(self, row: Singles) -> tuple[Ints, Singles] | None:
        """The nearest unit of a descriptor (d,) in every dictionary, int64 (D,), and the distances, float32 (D,).

        None where a dictionary has units that are nearer to each other than rounding: `som.nearest_units` tells which.
        """
        views = len(self.places)
        codes = (exact.product(row - self.mean, self.grid) * self.scale).astype(np.float32).reshape(views, -1)
        scores = np.empty(len(self.halves), np.float32)
        start = 0
        for places, code in zip(self.places, codes, strict=True):
            np.dot(places, code, out=scores[start : start + len(places)])
            start += len(places)
        scores -= self.halves
        values = codes.astype(np.float64)
        norms = [float(code @ code) for code in values]
        share = rounding(codes.shape[1])
        bounds = [share * (math.sqrt(norms[view] * largest) + largest / 2) for view, largest in self.largest]
        best = np.maximum.reduceat(scores, self.starts) - bounds
        (found,) = (scores >= best.take(self.owner)).nonzero()
        if len(found) > len(bounds):
            return None
        difference = values.take(self.view, axis=0)
        difference -= self.together.take(found, axis=0)
        return self.unit[found], np.sqrt(np.add.reduce(np.square(difference), axis=1)).astype(np.float32)
