"""Views: projections of descriptors that a map can be learned from.

`plain` is the PCA. `pn`, place-normalised, weighs every direction by how little the frames of one place differ in it:
with S the covariance of frames about the mean of their place, it makes S the identity. `half`, half whitened, does a
part of that without labels.
"""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import VisionError
from placerec.frames.table import Labels
from placerec.jobs import Executor, remote_or_local_map
from placerec.vision import exact
from placerec.vision.chunks import SpooledRows, check_again, chunks
from placerec.vision.pca import Moments, Pca, fit_pca, with_signs
from placerec.vision.som import group_sums

log = logging.getLogger(__name__)

_Part = tuple[Singles, Ints]  # some rows, and the number of each one's place, -1 for none


@dataclass(frozen=True, eq=False)
class Scatter:
    """How n rows lie about the means of their `places`: scatter float64 (k, k), and the sum of their fourth powers.

    fourth: over the rows, the squared norm of what is left without the mean, squared.
    """

    n: int
    places: int
    scatter: Floats
    fourth: float

    @property
    def covariance(self) -> Floats:
        """The scatter over n, (k, k)."""
        return self.scatter / self.n

    def shrinkage(self) -> float:
        """How far, of 0 to 1, the covariance is to be drawn towards its mean variance in every direction.

        What Ledoit and Wolf (2004, A well-conditioned estimator for large-dimensional covariance matrices) find best,
        and so far at least that k / n of the mean variance stands beside the whole of the covariance.
        """
        k = len(self.scatter)
        square = float(np.square(self.covariance).sum())
        far = square - k * float(self._mean_variance) ** 2
        noise = max((self.fourth / self.n - square) / self.n, 0.0)
        return max(min(noise, far) / far if far > 0 else 0.0, k / (self.n + k))

    def shrunk(self) -> Floats:
        """The covariance (k, k) drawn towards its mean variance as far as `shrinkage` tells."""
        share = self.shrinkage()
        drawn: Floats = (1 - share) * self.covariance + share * self._mean_variance * np.eye(len(self.scatter))
        return drawn

    @property
    def _mean_variance(self) -> float:
        return float(np.trace(self.covariance)) / len(self.scatter)


def fit_blocks(data: Moments, lengths: Sequence[int], components: int) -> Pca:
    """The PCA of rows whose columns are blocks of `lengths`, each divided by the root of its total variance.

    One block is left as it is, and the components are orthonormal then; otherwise they hold the blocks' factors, so
    that rows are projected as they are. Raises VisionError as `fit_pca` does.
    """
    if len(lengths) == 1:
        return fit_pca(data, components)
    ends = np.cumsum(lengths)[:-1]
    totals = np.array([block.sum() for block in np.split(np.diag(data.scatter), ends)]) / max(data.n - 1, 1)
    factors = np.repeat(1 / np.sqrt(np.where(totals > 0, totals, 1)), lengths)
    found = fit_pca(Moments(data.n, data.mean * factors, data.scatter * np.outer(factors, factors)), components)
    return replace(found, mean=data.mean, components=_as_stored(found.components * factors))


def _as_stored(components: Floats) -> Singles:
    """The components (k, d) float32, on the grid that makes a projection independent of the order of its sums."""
    exponents = exact.exponents(components)
    return np.ldexp(exact.on_grid(np.ldexp(components, -exponents)), exponents).astype(np.float32)


def half_whitened(pca: Pca) -> Pca:
    """The projection whose coordinates are divided by the fourth root of their variances: it needs no labels.

    What varies most counts less than in the principal components, and what varies little is not blown up to it.
    """
    # No direction grows by more than the rest for having no variance at all.
    variances = np.maximum(pca.variances.astype(np.float64), np.finfo(np.float32).eps * float(pca.variances[0]))
    components = _as_stored(pca.components / np.sqrt(np.sqrt(variances))[:, None])
    return replace(pca, components=components, variances=np.sqrt(variances).astype(np.float32))


def place_numbers(places: Sequence[str] | None, n: int) -> Ints:
    """The number of each row's place in the order of names, -1 for none; VisionError unless there are n."""
    if places is None:
        return np.full(n, -1, np.int64)
    if len(places) != n:
        raise VisionError(f"there are labels of {len(places)} rows, and {n} descriptors; give each its own")
    labels = places if isinstance(places, Labels) else Labels(places)
    return labels.codes(sorted(set(labels) - {""}))


def place_normalised(
    pca: Pca, codes: SpooledRows, places: Ints, work: Executor | None = None, *, told: str = "pn"
) -> Pca:
    """The projection whose coordinates have variance 1 about the means of places, largest variance of all rows first.

    `codes`: the rows (n, k) as `pca` projects them. `places` (n,): the number of each one's place, -1 for none; those
    count as rows alone. `work`: other machines, if there are any, take the chunks. `told`: what the view is called in
    what is noted. Raises VisionError where no two places are labelled, or no two frames of a place differ.
    """
    found = place_scatter(codes, places, work)
    if np.trace(found.covariance) <= np.finfo(np.float32).eps * pca.variances.sum(dtype=np.float64):
        raise VisionError("it needs places with frames that differ, and all that are labelled are like their place's")
    log.info(
        "view %s: from %d labelled frames of %d places, their covariance shrunk by %.2f",
        told,
        found.n,
        found.places,
        found.shrinkage(),
    )
    return whitened(pca, found.shrunk())


def whitened(pca: Pca, covariance: Floats) -> Pca:
    """The projection that makes a covariance (k, k) of the coordinates of `pca` the identity.

    Coordinates come in the order of their variance over all rows, the largest first, and are uncorrelated over these.
    """
    within, axes = exact.eigen(covariance)
    white = axes / np.sqrt(within)[:, None]
    # The covariance of all rows is diagonal in the PCA's coordinates, and is to be so again.
    variances, turn = exact.eigen(np.einsum("ik,k,jk->ij", white, pca.variances.astype(np.float64), white))
    turned = np.einsum("ij,jk->ik", turn, white)
    components = with_signs(np.einsum("ik,kd->id", turned, pca.components.astype(np.float64)))
    return replace(pca, components=_as_stored(components), variances=variances.astype(np.float32))


def place_scatter(codes: SpooledRows, places: Ints, work: Executor | None = None) -> Scatter:
    """How the labelled rows lie about the means of their places, in two passes; VisionError without two places."""
    each = remote_or_local_map(work)
    check_again(codes.rows, len(places))
    count = int(places.max(initial=-1)) + 1
    sums, frames = np.zeros((count, codes.width)), np.zeros(count, np.int64)
    for numbers, of_part, some in each(_sums, _parts(codes, places)):
        sums[numbers] += of_part
        frames[numbers] += some
    found, n = int(np.count_nonzero(frames)), int(frames.sum())
    if found < 2:
        told = f"all {n} that are labelled are of one" if found else "none is labelled"
        raise VisionError(f"it needs frames of two places, and of {len(places)} frames {told}")
    means = sums / np.maximum(frames, 1)[:, None]
    scatter, fourth = np.zeros((codes.width, codes.width)), 0.0
    for of_part, powers in each(partial(_about, means), _parts(codes, places)):
        scatter += of_part
        fourth += powers
    return Scatter(n, found, scatter, fourth)


def _parts(codes: SpooledRows, places: Ints) -> Iterator[_Part]:
    first = 0
    for rows in chunks(codes):
        yield rows, places[first : first + len(rows)]
        first += len(rows)


def _sums(part: _Part) -> tuple[Ints, Floats, Ints]:
    """The places that some rows are of, and for each of them the sum of the rows and their number."""
    rows, places = part
    labelled = places >= 0
    numbers, own, frames = np.unique(places[labelled], return_inverse=True, return_counts=True)
    return numbers, group_sums(rows[labelled], own, len(numbers)), frames


def _about(means: Floats, part: _Part) -> tuple[Floats, float]:
    """The scatter of some rows about the means of their places (P, k), and the sum of their fourth powers."""
    rows, places = part
    labelled = places >= 0
    apart = rows[labelled] - means[places[labelled]]
    if not len(apart):
        return np.zeros((rows.shape[1], rows.shape[1])), 0.0
    return exact.gram(apart), float(np.square(np.square(apart).sum(axis=1)).sum())
