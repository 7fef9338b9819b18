"""SRILM's log-likelihood of classes, to the last digit: sums in float32, term by term (section T2.3).

The order of the terms is found from printed values: it alone gives the digits of all golden runs.
"""

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.lm.classes import ClassBigrams, Merger, xlogx


def printed_log_likelihood(words: Ints, classes: ClassBigrams, order: Ints) -> float:
    """log10 p of all bigrams by classes; `words` (V,): each word's count; `order` (K,): the classes in turn."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    pairs = np.lexsort((place[classes.right], place[classes.left]))
    return _sum(xlogx(words), xlogx(classes.count[pairs]), -2 * xlogx(classes.unigrams[order]))


def printed_cost(merger: Merger, kept: int, gone: int, order: Ints) -> float:
    """What merging candidate `gone` into `kept` does to the log-likelihood; `order` (K,): the classes in turn."""
    (after, before), (gone_after, gone_before) = merger.neighbours(kept), merger.neighbours(gone)
    corner = np.concatenate([gone_after[[gone, kept]], after[[gone, kept]]])
    own = merger.unigrams[[gone, kept]]
    others = order[(order != kept) & (order != gone)]
    return _sum(
        2 * xlogx(own),
        xlogx(corner.sum(keepdims=True)),
        -xlogx(corner),
        xlogx((gone_after + after)[others]),
        xlogx((gone_before + before)[others]),
        -xlogx(gone_after[others]),
        -2 * xlogx(own.sum(keepdims=True)),
        -xlogx(after[others]),
        -xlogx(gone_before[others]),
        -xlogx(before[others]),
    )


def _sum(*terms: Floats) -> float:
    """One after the other, each sum rounded to float32."""
    return float(np.cumsum(np.concatenate(terms).astype(np.float32), dtype=np.float32)[-1])
