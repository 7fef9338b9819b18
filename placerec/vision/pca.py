"""Principal components from one pass over the data: centred, not whitened (readings A26)."""

import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from placerec.arrays import Floats, Singles
from placerec.errors import VisionError
from placerec.jobs import Executor, remote_or_local_map
from placerec.vision import exact
from placerec.vision.chunks import CHUNK, Source, Stream, chunks

log = logging.getLogger(__name__)

PROMISED = 0.99  # the share of the variance that the paper says its 80 components keep


@dataclass(frozen=True, eq=False)
class Moments:
    """What a PCA needs to know of n rows: their mean (d,) and their scatter about it (d, d), both float64."""

    n: int
    mean: Floats
    scatter: Floats

    @classmethod
    def none(cls, width: int) -> "Moments":
        """The moments of no rows at all."""
        return cls(0, np.zeros(width), np.zeros((width, width)))

    @classmethod
    def of(cls, rows: Singles) -> "Moments":
        """The moments of rows (m, d), 0 < m <= exact.TERMS."""
        values = rows.astype(np.float64)
        mean = values.sum(axis=0) / len(rows)
        return cls(len(rows), mean, exact.gram(values - mean))

    def plus(self, other: "Moments") -> "Moments":
        """The moments of these rows and of those of the other, by Chan's pairwise formula."""
        n = self.n + other.n
        step = other.mean - self.mean
        between = np.outer(step, step) * (self.n * other.n / n)
        return Moments(n, self.mean + step * (other.n / n), self.scatter + other.scatter + between)


@dataclass(frozen=True, eq=False)
class Pca:
    """Mean float64 (d,), components float32 (k, d) in rows, their variances float32 (k,), largest first.

    `explained`: the share of the variance that the k components keep; `needed`: how many would keep 99 %.
    """

    mean: Floats
    components: Singles
    variances: Singles
    explained: float
    needed: int

    @cached_property
    def scale(self) -> Floats:
        """Per component (k,) the power of two that its entries are within."""
        return np.ldexp(1.0, exact.exponents(self.components)[:, 0])

    @cached_property
    def grid(self) -> Floats:
        """The components over their `scale`, as `exact.product` takes them, (d, k)."""
        return self.components.T / self.scale


def moments(source: Source, work: Executor | None = None) -> Moments:
    """The moments of (n, d) float32 in one pass, from memory, a memory map or a stream, however that is cut.

    `work`: other machines, if there are any, take the chunks.
    """
    total = None
    for part in remote_or_local_map(work)(Moments.of, chunks(source)):
        total = (total or Moments.none(len(part.mean))).plus(part)
    return total or Moments.none(0)


def fit_pca(data: Moments, components: int = 80) -> Pca:
    """The leading principal components: `components`, or as many as the data has (n - 1 or its numeric rank).

    A component's sign is chosen so that its largest entry is positive. Entries are rounded to multiples of 2**-20
    (about 1e-6): LAPACK's last bits depend on its threads, the words must not. Raises VisionError if the rows are
    fewer than two or all equal.
    """
    if data.n < 2:
        raise VisionError(f"PCA needs at least 2 descriptors, and there are {data.n}; name more images")
    values, vectors = np.linalg.eigh(data.scatter / (data.n - 1))
    values, vectors = np.maximum(values[::-1], 0), vectors[:, ::-1].T
    floor = values[0] * max(data.n, len(values)) * np.finfo(np.float64).eps
    rank = min(int((values > floor).sum()), data.n - 1)
    if values[0] <= np.finfo(np.float64).eps * float(np.abs(data.mean).max()) ** 2:
        raise VisionError(f"all {data.n} descriptors are equal, nothing can be learnt from them; name other images")
    k = min(components, rank)
    if k < components:
        log.warning("PCA keeps %d components instead of %d: the %d descriptors have no more", k, components, data.n)
    share = np.cumsum(values) / values.sum()
    leading = vectors[:k]
    leading = exact.on_grid(with_signs(leading))
    explained = round(float(share[k - 1]), 9)
    needed = int((share < PROMISED).sum()) + 1
    return Pca(data.mean, leading.astype(np.float32), values[:k].astype(np.float32), explained, needed)


def with_signs(components: Floats) -> Floats:
    """The components (k, d) with such signs that the largest entry of each is positive."""
    largest = np.take_along_axis(components, np.abs(components).argmax(axis=1)[:, None], axis=1)
    signed: Floats = components * np.sign(largest)
    return signed


def project(rows: Singles, pca: Pca) -> Singles:
    """Coordinates float32 (n, k) of rows (n, d); a row's do not depend on the other rows."""
    codes = np.empty((len(rows), len(pca.components)), np.float32)
    for first in range(0, len(rows), CHUNK):
        piece = slice(first, first + CHUNK)
        codes[piece] = exact.product(rows[piece] - pca.mean, pca.grid) * pca.scale
    return codes


def projected(source: Source, pca: Pca) -> Stream:
    """The coordinates of a source of rows, computed anew each time they are asked for."""
    return lambda: (project(rows, pca) for rows in chunks(source))
