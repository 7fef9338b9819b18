"""Maps of one kind of descriptors in one projection each: those that placerec has, and others to compare them with.

plain, pn, half: as in placerec. visits: by the scatter about the mean of each visit, so that what changes from visit to
visit of a place does not count as noise. slow: by the covariance of frames five apart, which needs no labels. tenth: by
the scatter about the mean of places with a tenth of its mean variance added in every direction, however few frames.
"""

from collections.abc import Callable

import numpy as np

from placerec.arrays import Ints
from placerec.vision import Descriptors, Dictionary, DictionaryOptions
from placerec.vision.chunks import SpooledRows, spooled
from placerec.vision.learning import learn_map, training_rows
from placerec.vision.pca import Pca, fit_pca, moments, projected
from placerec.vision.views import half_whitened, place_normalised, place_numbers, place_scatter, whitened

APART = 5


def learned(frames: Descriptors, projection: str, options: DictionaryOptions) -> Dictionary:
    """The dictionary of one of PROJECTIONS of the descriptors of some frames, which are in the order of time."""
    rows = training_rows(frames.values, frames.spec, options)
    pca = fit_pca(moments(rows.source), options.components)
    with spooled(projected(rows.source, pca)) as codes:
        found = PROJECTIONS[projection](pca, codes, frames)
    with spooled(projected(rows.source, found)) as codes:
        som, quality = learn_map(codes, found, rows, options)
    return Dictionary(frames.spec, found, som.codebook, som.hits, options, quality)


def visit_numbers(frames: Descriptors) -> Ints:
    """The number of the visit that each frame is of, int64 (n,), -1 where it has no label."""
    sequences, places = np.array(frames.sequences), np.array(frames.places)
    begins = (sequences[1:] != sequences[:-1]) | (places[1:] != places[:-1])
    return np.where(places == "", -1, np.cumsum(np.concatenate([[False], begins])))


def _about_places(pca: Pca, codes: SpooledRows, frames: Descriptors) -> Pca:
    return place_normalised(pca, codes, place_numbers(frames.table.places, codes.rows))


def _about_visits(pca: Pca, codes: SpooledRows, frames: Descriptors) -> Pca:
    return place_normalised(pca, codes, visit_numbers(frames))


def _slow(pca: Pca, codes: SpooledRows, frames: Descriptors) -> Pca:
    """Two frames lie about their mean as half of their difference tells: each pair is a place of its own."""
    rows, sequences = np.concatenate([*codes()]), np.array(frames.sequences)
    before = np.flatnonzero(sequences[:-APART] == sequences[APART:])
    with spooled(np.concatenate([rows[before], rows[before + APART]])) as pairs:
        return place_normalised(pca, pairs, np.tile(np.arange(len(before)), 2))


def _tenth(pca: Pca, codes: SpooledRows, frames: Descriptors) -> Pca:
    covariance = place_scatter(codes, place_numbers(frames.table.places, codes.rows)).covariance
    k = len(covariance)
    return whitened(pca, covariance + 0.1 * np.trace(covariance) / k * np.eye(k))


PROJECTIONS: dict[str, Callable[[Pca, SpooledRows, Descriptors], Pca]] = {
    "plain": lambda pca, codes, frames: pca,
    "pn": _about_places,
    "visits": _about_visits,
    "half": lambda pca, codes, frames: half_whitened(pca),
    "slow": _slow,
    "tenth": _tenth,
}
