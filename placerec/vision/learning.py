"""How a map is learned: the rows that train, and what came of it."""

import logging
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Mask, Singles
from placerec.errors import VisionError, counted
from placerec.vision.chunks import Source, SpooledRows, Stream, chunks, first_unusable
from placerec.vision.options import DictionaryOptions
from placerec.vision.pca import Pca
from placerec.vision.som import EpochProgress, Som, map_quality, train_som
from placerec.vision.spec import DescriptorSpec

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Quality:
    """What came of it, over the frames that were used; the errors, entropy and dead units are those of `MapQuality`.

    `explained`: the share of the variance that the components keep; `needed`: the components that would keep 99 %.
    """

    frames: int
    used: int
    epochs: int
    explained: float
    needed: int
    quantisation_error: float
    topographic_error: float
    entropy: float
    dead: int


@dataclass(frozen=True, eq=False)
class TrainingRows:
    """The descriptors that train, all or drawn: `kept` bool (frames,), None for all; `rng`: the state for the map."""

    source: Source
    kept: Mask | None
    rng: np.random.Generator


def training_rows(descriptors: Source, spec: DescriptorSpec, options: DictionaryOptions) -> TrainingRows:
    """Check the descriptors as they come, and draw the share that `options` tells; raises VisionError."""
    rng = np.random.Generator(np.random.PCG64(options.seed))
    source = _checked_source(descriptors, spec)
    if options.fraction == 1:
        return TrainingRows(source, None, rng)
    n = len(source) if isinstance(source, np.ndarray) else sum(map(len, chunks(source)))
    kept = np.zeros(n, np.bool_)
    kept[rng.permutation(n)[: max(1, round(options.fraction * n))]] = True
    return TrainingRows(some_rows(source, kept), kept, rng)


def warn_of_few(frames: int, *sizes: int) -> None:
    """A warning for every size of map that has more units than there are frames to train it."""
    for size in sizes:
        if frames < size * size:
            there = counted(frames, "frame")
            log.warning("%s cannot fill the %d words of a map of size %d; take a smaller --size", there, size**2, size)


def learn_map(
    codes: SpooledRows, pca: Pca, rows: TrainingRows, options: DictionaryOptions, progress: EpochProgress | None = None
) -> tuple[Som, Quality]:
    """Learn a map from the coordinates of the training rows in PCA space."""
    som = train_som(
        codes,
        options.size,
        # Every map of a set begins with the state that a map of its own would.
        rng=deepcopy(rows.rng),
        rule=options.rule,
        width=options.width,
        epochs=options.epochs,
        progress=progress,
    )
    got = map_quality(codes, som.codebook, som.hits)
    errors = got.quantisation_error, got.topographic_error, got.entropy, got.dead
    frames = codes.rows if rows.kept is None else len(rows.kept)
    return som, Quality(frames, codes.rows, som.epochs, pca.explained, pca.needed, *errors)


def _checked_source(descriptors: Source, spec: DescriptorSpec) -> Source:
    if not callable(descriptors):
        return checked_rows(descriptors, spec)
    give = descriptors

    def pieces() -> Iterator[Singles]:
        first = 0
        for piece in give():
            yield checked_rows(piece, spec, first)
            first += len(piece)

    return pieces


def checked_rows(descriptors: Singles, spec: DescriptorSpec, first: int = 0) -> Singles:
    """The descriptors as float32; `first`: the index of their first row, for the message."""
    rows = np.asarray(descriptors)
    if rows.ndim != 2 or rows.dtype.kind not in "uif":
        raise VisionError(f"descriptors are float32 (n, {spec.length}), and these are {rows.dtype} {rows.shape}")
    if rows.shape[1] != spec.length:
        raise VisionError(f"the descriptors have {rows.shape[1]} values, and the dictionary's have {spec.length}")
    rows = rows.astype(np.float32, copy=False)
    # One frame, as it comes on the robot, is checked in a tenth of the time that pieces take.
    if len(rows) == 1 and np.logical_and.reduce(np.isfinite(rows[0])):
        return rows
    bad = first_unusable(rows)
    if bad is not None:
        raise VisionError(f"descriptor {first + bad} (from 0) holds NaN or infinite values; leave it out")
    return rows


def some_columns(source: Source, columns: slice | list[int]) -> Source:
    """Some columns of the rows of a source; the source as it is if they are all."""
    if columns == slice(None):
        return source
    return lambda: (np.ascontiguousarray(rows[:, columns]) for rows in chunks(source))


def some_rows(source: Source, kept: Mask) -> Stream:
    """Some rows of a source, in their order."""

    def pieces() -> Iterator[Singles]:
        first = 0
        for rows in chunks(source):
            yield rows[kept[first : first + len(rows)]]
            first += len(rows)

    return pieces
