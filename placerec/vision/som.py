"""A batch self-organising map on a square lattice, row-major, and the search for best units (readings A28)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

Progress = Callable[[int, int, float], None]  # epoch (from 1), epochs, quantisation error

EPOCHS = 50
LAST_WIDTH = 0.5  # 1.0 and more gives worse words on small maps, and no later step uses the topology
_JITTER = 0.05
_SETTLED = 0.001  # training ends when a smaller share of the frames changes its unit at the last width
_CHUNK = 4096
_TINY = 1e-290  # below this a neighbourhood's weight has lost its digits to underflow


@dataclass(frozen=True, eq=False)
class Som:
    """Codebook float32 (size**2, k); hits int64 (size**2,), the training frames per unit; the epochs that were run."""

    codebook: NDArray[np.float32]
    hits: NDArray[np.int64]
    epochs: int


def train_som(
    codes: NDArray[np.float32],
    size: int,
    *,
    rng: np.random.Generator,
    epochs: int | None = None,
    progress: Progress | None = None,
) -> Som:
    """Train size x size units on PCA coordinates (n, k), largest variance first.

    The width of the Gaussian neighbourhood falls exponentially from size/2 to 0.5 units in the first half of the
    epochs and stays there in the second, which ends early once fewer than 0.1 % of the frames change their unit.
    `epochs`: None is 50. The result depends on codes, options and the generator's state alone, not on the BLAS.
    """
    epochs = EPOCHS if epochs is None else epochs
    cooling = (epochs + 1) // 2
    widths = np.geomspace(max(size / 2, LAST_WIDTH), LAST_WIDTH, cooling) if cooling > 1 else [LAST_WIDTH]
    codebook = _start(codes, size, rng)
    before = np.full(len(codes), -1)
    for epoch in range(1, epochs + 1):
        units = _search(codes, codebook)
        if epoch > cooling and np.count_nonzero(units != before) < _SETTLED * len(codes):
            epoch -= 1
            break
        if progress is not None:
            progress(epoch, epochs, float(_distances(codes, codebook, units).mean()))
        codebook = _smoothed(*_unit_sums(codes, units, size * size), codebook, float(widths[min(epoch, cooling) - 1]))
        before = units
    hits = np.bincount(_search(codes, codebook), minlength=size * size)
    return Som(codebook, hits.astype(np.int64), epoch)


def best_units(
    codes: NDArray[np.float32], codebook: NDArray[np.float32], live: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The nearest unit of every row of (n, k): int64 (n,), and the Euclidean distance to it: float32 (n,).

    `live` (K,): units to choose from, all by default. Of equally near units the first is taken.
    """
    if live is None:
        units = _search(codes, codebook)
    else:
        among = np.flatnonzero(live)
        units = among[_search(codes, codebook[among])]
    return units, _distances(codes, codebook, units).astype(np.float32)


def quantisation_error(codes: NDArray[np.float32], codebook: NDArray[np.float32]) -> float:
    """The mean distance of the rows to their nearest unit."""
    return float(_distances(codes, codebook, _search(codes, codebook)).mean())


def topographic_error(codes: NDArray[np.float32], codebook: NDArray[np.float32]) -> float:
    """The share of the rows whose second nearest unit is not one of the 8 neighbours of the nearest."""
    size = round(len(codebook) ** 0.5)
    if size == 1:
        return 0.0
    first = _search(codes, codebook)
    second = _search(codes, codebook, without=first)
    rows, columns = first // size - second // size, first % size - second % size
    return float((np.maximum(np.abs(rows), np.abs(columns)) > 1).mean())


def _start(codes: NDArray[np.float32], size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Units on the plane of the first two coordinates, two deviations to either side, jittered."""
    width = codes.shape[1]
    mean, deviation = codes.mean(axis=0, dtype=np.float64), codes.std(axis=0, dtype=np.float64)
    lattice = np.zeros((size, size, width))
    steps = np.linspace(-2, 2, size) if size > 1 else np.zeros(1)
    lattice[..., 0] = steps[:, None]
    if width > 1:
        lattice[..., 1] = steps
    lattice += _JITTER * rng.standard_normal(lattice.shape)
    codebook: NDArray[np.float32] = (mean + deviation * lattice).astype(np.float32).reshape(size * size, width)
    return codebook


def _unit_sums(
    codes: NDArray[np.float32], units: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Per unit the sum (count, k) and the number (count,) of its rows, added in the order of the rows."""
    sums = np.zeros((count, codes.shape[1]))
    for first in range(0, len(codes), _CHUNK):
        rows = codes[first : first + _CHUNK].astype(np.float64)
        mine = units[first : first + _CHUNK]
        sums += csc_array((np.ones(len(rows)), mine, np.arange(len(rows) + 1)), shape=(count, len(rows))) @ rows
    return sums, np.bincount(units, minlength=count).astype(np.float64)


def _smoothed(
    sums: NDArray[np.float64], counts: NDArray[np.float64], codebook: NDArray[np.float32], width: float
) -> NDArray[np.float32]:
    """The batch rule: weighted means over the neighbourhood; a unit that hears of no frame stays where it is."""
    size = round(len(counts) ** 0.5)
    place = np.arange(size)
    kernel = np.exp(-((place[:, None] - place) ** 2) / (2 * width**2))
    weighted = np.concatenate([sums, counts[:, None]], axis=1).reshape(size, size, -1)
    # The Gaussian of the lattice distance is a product of two. einsum adds in a fixed order, a BLAS does not.
    weighted = np.einsum("ij,jkd->ikd", kernel, weighted)
    weighted = np.einsum("ij,kjd->kid", kernel, weighted).reshape(size * size, -1)
    heard = weighted[:, -1] > _TINY
    moved = codebook.copy()
    moved[heard] = (weighted[heard, :-1] / weighted[heard, -1:]).astype(np.float32)
    return moved


def _search(
    codes: NDArray[np.float32], codebook: NDArray[np.float32], without: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """The nearest unit of every row, by exact distance in float64, lowest index first; `without` (n,): not this one."""
    units = np.empty(len(codes), np.int64)
    for first in range(0, len(codes), _CHUNK):
        piece = slice(first, first + _CHUNK)
        units[piece] = _search_chunk(codes[piece], codebook, None if without is None else without[piece])
    return units


def _search_chunk(
    codes: NDArray[np.float32], codebook: NDArray[np.float32], without: NDArray[np.int64] | None
) -> NDArray[np.int64]:
    """float32 products find the candidates; float64 decides where they are nearer to each other than rounding."""
    norms = np.square(codebook, dtype=np.float64).sum(axis=1)
    scores: NDArray[np.float32] = codes @ codebook.T
    scores -= (norms / 2).astype(np.float32)
    every = np.arange(len(codes))
    if without is not None:
        scores[every, without] = -np.inf
    units: NDArray[np.int64] = scores.argmax(axis=1)
    best = scores[every, units]
    reach = np.sqrt(np.square(codes, dtype=np.float64).sum(axis=1) * norms.max()) + norms.max() / 2
    bound = 2 * (codes.shape[1] + 2) * np.finfo(np.float32).eps * reach
    scores[every, units] = -np.inf
    doubtful = np.flatnonzero(scores.max(axis=1) >= best - bound)
    scores[every, units] = best
    # In pieces: where all units lie close together every unit is a candidate of every row.
    for rows in np.array_split(doubtful, len(doubtful) // 128 + 1):
        which, unit = np.nonzero(scores[rows] >= (best[rows] - bound[rows])[:, None])
        distance = _distances(codes[rows[which]], codebook, unit)
        order = np.lexsort((unit, distance, which))
        leaders = order[np.unique(which[order], return_index=True)[1]]
        units[rows[which[leaders]]] = unit[leaders]
    return units


def _distances(
    codes: NDArray[np.float32], codebook: NDArray[np.float32], units: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Euclidean distance of every row to its unit, float64 (n,)."""
    distances = np.empty(len(codes))
    for first in range(0, len(codes), _CHUNK):
        piece = slice(first, first + _CHUNK)
        difference = codes[piece].astype(np.float64) - codebook[units[piece]]
        distances[piece] = np.sqrt(np.square(difference).sum(axis=1))
    return distances
