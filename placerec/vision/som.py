"""Self-organising maps on a square lattice, row-major: training, the search for best units (readings A28), quality."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.errors import VisionError
from placerec.vision.chunks import CHUNK, Source, check_again, chunks, each_chunk

EpochProgress = Callable[[int, int, float], None]  # epoch (from 1), epochs, quantisation error

Rule = Literal["batch", "online"]
RULES: tuple[str, ...] = get_args(Rule)
EPOCHS = 50
WIDTH = 0.5  # 1.0 and more gives worse words on small maps, and no later step uses the topology
_RATES = (0.5, 0.01)  # the learning rate of the on-line rule, first and last
_JITTER = 0.05
_SETTLED = 0.001  # training ends when a smaller share of the frames changes its unit at the last width
_EPSILON = float(np.finfo(np.float32).eps)
_TINY = 1e-290  # below this a neighbourhood's weight has lost its digits to underflow


@dataclass(frozen=True, eq=False)
class Som:
    """Codebook float32 (size**2, k); hits int64 (size**2,), the training frames per unit; the epochs that were run."""

    codebook: Singles
    hits: Ints
    epochs: int


@dataclass(frozen=True, eq=False)
class Units:
    """What the search for the nearest unit needs to know of a codebook, whatever the rows; made by `of`.

    `among`: the indices of the units that may answer, None for all. `places` float32 (K, k): where these lie. `halves`
    float32 (K,): half their squared norms, and `largest` the largest squared norm.
    """

    among: Ints | None
    places: Singles
    halves: Singles
    largest: float

    @classmethod
    def of(cls, codebook: Singles, live: Mask | None = None) -> "Units":
        """A codebook made ready; `live` (K,): the units to choose from, all by default."""
        among = None if live is None else np.flatnonzero(live)
        places = codebook if among is None else codebook[among]
        norms = np.square(places, dtype=np.float64).sum(axis=1)
        return cls(among, places, (norms / 2).astype(np.float32), float(norms.max()))


def train_som(
    source: Source,
    size: int,
    *,
    rng: np.random.Generator,
    rule: Rule = "batch",
    width: float = WIDTH,
    epochs: int | None = None,
    progress: EpochProgress | None = None,
) -> Som:
    """Train size x size units on PCA coordinates (n, k), largest variance first, from memory or streamed.

    `batch`: the width of the Gaussian neighbourhood falls exponentially from size/2 to `width` units in the first
    half of the epochs and stays there in the second, which ends early once fewer than 0.1 % of the frames change their
    unit. Every epoch streams the source once: four bytes a frame are all that is kept. `online` is Kohonen's rule of
    1990: one frame after the other in random order pulls its unit and the neighbours, while width (exponentially, as
    above) and learning rate (linearly, 0.5 to 0.01) fall over all steps; it keeps all coordinates in memory.

    `epochs`: None is 50. The result depends on the rows, the options and the generator's state alone, not on the BLAS
    nor on how the rows were cut. Raises VisionError if a streamed source changes between two passes.
    """
    epochs = EPOCHS if epochs is None else epochs
    n, mean, deviation = _spread(source)
    codebook = _start(mean, deviation, size, rng)
    learn = {"batch": _batch, "online": _online}[rule]
    codebook, epochs = learn(source, n, codebook, rng, width, epochs, progress)
    hits = np.zeros(size * size, np.int64)
    for counts in each_chunk(source)(partial(_hits, Units.of(codebook))):
        hits += counts
    check_again(int(hits.sum()), n)
    return Som(codebook, hits, epochs)


def _hits(units: Units, rows: Singles) -> Ints:
    """How many of the rows each unit (K,) is nearest to."""
    return np.bincount(_search(rows, units), minlength=len(units.places))


@dataclass(frozen=True, eq=False)
class _Share:
    """What an epoch takes from a chunk of m rows: the unit of each (m,), in the smallest type that holds it.

    sums: float64 (h, k), the sums of the rows of each unit that has some, in the units' order. distance: of all rows
    to their units.
    """

    units: NDArray[np.unsignedinteger[Any]]
    sums: Floats
    distance: float


def _share(ready: Units, measured: bool, rows: Singles) -> _Share:
    units = _search(rows, ready)
    count = len(ready.places)
    sums = group_sums(rows, units, count)[np.bincount(units, minlength=count) > 0]
    distance = float(distances(rows, ready.places, units).sum()) if measured else 0.0
    return _Share(units.astype(np.min_scalar_type(count)), sums, distance)


def _batch(
    source: Source,
    n: int,
    codebook: Singles,
    rng: np.random.Generator,
    width: float,
    epochs: int,
    progress: EpochProgress | None,
) -> tuple[Singles, int]:
    """The codebook after at most `epochs` passes, and the number of passes that moved it."""
    cooling = (epochs + 1) // 2
    widths = np.geomspace(max(len(codebook) ** 0.5 / 2, width), width, cooling) if cooling > 1 else [width]
    before = np.full(n, -1, np.int32)
    each = each_chunk(source)
    for epoch in range(1, epochs + 1):
        sums, counts = np.zeros(codebook.shape), np.zeros(len(codebook))
        changed, first, distance = 0, 0, 0.0
        for share in each(partial(_share, Units.of(codebook), progress is not None)):
            hit = np.bincount(share.units, minlength=len(codebook))
            sums[hit > 0] += share.sums
            counts += hit
            known = before[first : first + len(share.units)]
            changed += int(np.count_nonzero(share.units != known))
            known[:] = share.units
            first += len(share.units)
            distance += share.distance
        check_again(first, n)
        if epoch > cooling and changed < _SETTLED * n:
            return codebook, epoch - 1
        if progress is not None:
            progress(epoch, epochs, distance / n)
        codebook = _smoothed(sums, counts, codebook, float(widths[min(epoch, cooling) - 1]))
    return codebook, epochs


def _online(
    source: Source,
    n: int,
    codebook: Singles,
    rng: np.random.Generator,
    width: float,
    epochs: int,
    progress: EpochProgress | None,
) -> tuple[Singles, int]:
    """Kohonen's rule; the quantisation error that `progress` is told is that of the frames as they were met."""
    rows = np.concatenate(list(chunks(source)))
    check_again(len(rows), n)
    side = round(len(codebook) ** 0.5)
    first, last = max(side / 2, width), width
    place = np.arange(side)
    weights = codebook.astype(np.float64)
    pull = np.empty_like(weights)
    steps = epochs * n
    for epoch in range(epochs):
        distance = 0.0
        for step, row in enumerate(rng.permutation(n).tolist(), start=epoch * n):
            done = step / max(steps - 1, 1)
            np.subtract(rows[row], weights, out=pull)
            # Not a matrix product: the order in which a BLAS adds depends on its threads.
            squares = np.einsum("uk,uk->u", pull, pull)
            best = int(squares.argmin())
            distance += float(squares[best]) ** 0.5
            rate = _RATES[0] + (_RATES[1] - _RATES[0]) * done
            spread = -0.5 / (first * (last / first) ** done) ** 2
            down = np.exp(spread * (place - best // side) ** 2)
            right = np.exp(spread * (place - best % side) ** 2)
            pull *= np.outer(rate * down, right).reshape(-1, 1)
            weights += pull
        if progress is not None:
            progress(epoch + 1, epochs, distance / n)
    return weights.astype(np.float32), epochs


def nearest_units(codes: Singles, units: Units) -> tuple[Ints, Singles]:
    """The nearest unit of every row of (n, k): int64 (n,), and the Euclidean distance to it: float32 (n,).

    Of equally near units the first is taken.
    """
    found = _search(codes, units)
    far = distances(codes, units.places, found).astype(np.float32)
    return found if units.among is None else units.among[found], far


def _spread(source: Source) -> tuple[int, Floats, Floats]:
    """The number of rows, and mean and standard deviation of every column, in one pass (Chan's formula)."""
    n, mean, squares = 0, np.zeros(1), np.zeros(1)
    for m, mean_here, squares_here in each_chunk(source)(_spread_of):
        step = mean_here - mean
        total = n + m
        squares = squares + squares_here + step**2 * (n * m / total)
        mean = mean + step * (m / total)
        n = total
    return n, mean, np.sqrt(squares / n)


def _spread_of(rows: Singles) -> tuple[int, Floats, Floats]:
    """The number of the rows, their mean, and the sum of the squares about it."""
    values = rows.astype(np.float64)
    mean = values.mean(axis=0)
    return len(values), mean, np.square(values - mean).sum(axis=0)


def _start(mean: Floats, deviation: Floats, size: int, rng: np.random.Generator) -> Singles:
    """Units on the plane of the first two coordinates, two deviations to either side, jittered."""
    lattice = np.zeros((size, size, len(mean)))
    steps = np.linspace(-2, 2, size) if size > 1 else np.zeros(1)
    lattice[..., 0] = steps[:, None]
    if len(mean) > 1:
        lattice[..., 1] = steps
    lattice += _JITTER * rng.standard_normal(lattice.shape)
    codebook: Singles = (mean + deviation * lattice).astype(np.float32).reshape(size * size, len(mean))
    return codebook


def group_sums(rows: Singles, units: Ints, count: int) -> Floats:
    """Per unit of `count` the sum (count, k) of the rows (n, k) that are its own by `units` (n,), in their order."""
    mine = csc_array((np.ones(len(rows)), units, np.arange(len(rows) + 1)), shape=(count, len(rows)))
    sums: Floats = mine @ rows.astype(np.float64)
    return sums


def _smoothed(sums: Floats, counts: Floats, codebook: Singles, width: float) -> Singles:
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


def _search(codes: Singles, units: Units, without: Ints | None = None) -> Ints:
    """The nearest unit of every row, by exact distance in float64, lowest index first; `without` (n,): not this one."""
    found = np.empty(len(codes), np.int64)
    for first in range(0, len(codes), CHUNK):
        piece = slice(first, first + CHUNK)
        found[piece] = _search_chunk(codes[piece], units, None if without is None else without[piece])
    return found


def rounding(columns: int) -> float:
    """How far float32 scores of that many columns may be from their values, as a share of the largest possible."""
    return 2 * (columns + 2) * _EPSILON


def _search_chunk(codes: Singles, ready: Units, without: Ints | None) -> Ints:
    """float32 products find the candidates; float64 decides where they are nearer to each other than rounding."""
    scores: Singles = codes @ ready.places.T
    scores -= ready.halves
    every = np.arange(len(codes))
    if without is not None:
        scores[every, without] = -np.inf
    units: Ints = scores.argmax(axis=1)
    best = scores[every, units]
    reach = np.sqrt(np.square(codes, dtype=np.float64).sum(axis=1) * ready.largest) + ready.largest / 2
    bound = rounding(codes.shape[1]) * reach
    scores[every, units] = -np.inf
    doubtful = np.flatnonzero(scores.max(axis=1) >= best - bound)
    scores[every, units] = best
    # In pieces: where all units lie close together every unit is a candidate of every row.
    for first in range(0, len(doubtful), 128):
        rows = doubtful[first : first + 128]
        which, unit = np.nonzero(scores[rows] >= (best[rows] - bound[rows])[:, None])
        distance = distances(codes[rows[which]], ready.places, unit)
        order = np.lexsort((unit, distance, which))
        leaders = order[np.unique(which[order], return_index=True)[1]]
        units[rows[which[leaders]]] = unit[leaders]
    return units


def distances(codes: Singles, codebook: Singles, units: Ints) -> Floats:
    """Euclidean distance of every row to its unit, float64 (n,)."""
    distances = np.empty(len(codes))
    for first in range(0, len(codes), CHUNK):
        piece = slice(first, first + CHUNK)
        difference = codes[piece].astype(np.float64) - codebook[units[piece]]
        distances[piece] = np.sqrt(np.square(difference).sum(axis=1))
    return distances


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


def map_quality(source: Source, codebook: Singles, hits: Ints) -> MapQuality:
    """The quality of a map (K, k) for coordinates (n, k), in one pass; `hits` (K,): the training frames per unit.

    Errors are rounded to 9 digits. Raises VisionError if there are no rows.
    """
    falls = np.zeros(len(codebook), np.int64)
    distance, apart = 0.0, 0
    for counts, far, loose in each_chunk(source)(partial(_fall, Units.of(codebook))):
        falls += counts
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


def _fall(units: Units, rows: Singles) -> tuple[Ints, float, int]:
    """How many rows each unit got (K,), the sum of their distances, and how many have their next unit elsewhere."""
    first, far = nearest_units(rows, units)
    count, apart = len(units.places), 0
    if count > 1:
        size = round(count**0.5)
        second = _search(rows, units, without=first)
        down, right = first // size - second // size, first % size - second % size
        apart = int(np.count_nonzero(np.maximum(np.abs(down), np.abs(right)) > 1))
    return np.bincount(first, minlength=count), float(far.sum(dtype=np.float64)), apart
