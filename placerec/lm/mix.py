"""Several models as one: merged into a back-off model, or mixed while a text is scored.

Sections 11.4 to 11.6 of our SRILM specification. Where components are mixed their probabilities are given as log10,
float32, stacked: (K, T) for K models and T words.
"""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.logs import LN10, log10, log10_of_sum, p_of
from placerec.lm.mutable import SILENT, MutableModel, Trace, reweigh
from placerec.lm.trie import runs

# Rows that are mixed at once: what is computed on the way stays in the processor's cache.
_PART = 1 << 15


def merge_weight(weights: Sequence[float], k: int) -> float:
    """The weight of what was merged so far when component k >= 1 joins it."""
    total = sum(weights[: k + 1])
    return 1 - weights[k] / total if weights[k] and total else 1.0


def merge(model: MutableModel, other: MutableModel, weight: float, trace: Trace = SILENT) -> None:
    """Section 11.4: mix `other`, over the same trie, into `model`, whose share is `weight`."""
    mixed = [_mixed_order(model, other, n, weight) for n in range(1, model.order + 1)]
    for n in range(model.order, 0, -1):
        new = np.flatnonzero(other.stored[n - 1] & ~model.stored[n - 1])
        model.stored[n - 1][new] = True
        if n > 1:
            model.add_contexts(n - 1, runs(model.trie.prefix(n)[new])[0])
        np.copyto(model.log10_p[n - 1], mixed[n - 1], where=model.stored[n - 1])
    reweigh(model, trace)


def _mixed_order(model: MutableModel, other: MutableModel, n: int, weight: float) -> Singles:
    """log10 p float32 (m_n,) of the rows of order n in the mixture."""
    mixed = np.empty(len(model.base[n - 1]), np.float32)
    for start in range(0, len(mixed), _PART):
        part = slice(start, start + _PART)
        mixed[part] = _mean([model.backed_off(n, part), other.backed_off(n, part)], [weight, 1 - weight])
    return mixed


def mixed(log10_probs: Singles, weights: Floats) -> Singles:
    """log10 of the mean probability, float32 (T,); `weights` (K,), or (K, T) for each word, need not sum to 1."""
    weights = weights[:, None] if weights.ndim == 1 else weights
    return _mean([*log10_probs], [*weights], _sum(weights))


def _mean(log10_probs: Sequence[Singles], weights: Sequence[Floats | float], divisor: Floats | float = 1.0) -> Singles:
    total = np.zeros(len(log10_probs[0]))
    for log10_p, weight in zip(log10_probs, weights, strict=True):
        total += weight * p_of(log10_p)
    return log10_of_sum(total / divisor, log10_probs, weights, divisor=divisor)


def posteriors(weights: Sequence[float], joints: Singles, scale: float) -> Floats:
    """The weights (K, T) after the models have been seen to give the recent words log10 p `joints` (K, T).

    Each weight is multiplied by 10^(scale * joint), and they sum to 1; where all vanish they are the plain ones.
    """
    plain = np.array(weights, np.float64)[:, None]
    joints = joints if scale else np.zeros_like(joints)
    with np.errstate(invalid="ignore"):
        seen = plain * np.exp((scale * joints.astype(np.float64)).astype(np.float32).astype(np.float64) * LN10)
    seen = np.nan_to_num(seen)
    total = _sum(seen)
    return np.where(total > 0, seen, plain) / np.where(total > 0, total, plain.sum())


def loglinear(log10_probs: Singles, weights: Sequence[float]) -> Singles:
    """The weighted sum of the log probabilities, float32 (T,), not normalised."""
    total = np.zeros(log10_probs.shape[1:], np.float32)
    for log10_p, weight in zip(log10_probs, weights, strict=True):
        if weight:
            total = (total + (weight * log10_p.astype(np.float64))).astype(np.float32)
    return total


def _sum(weights: Floats) -> Floats:
    total = np.zeros(weights.shape[1])
    for weight in weights:
        total = total + weight
    return total


class Cache:
    """The last `size` words before each word of a text, as an estimate of its probability.

    `ids` int64 (T,) is the text; `counted` bool (T,) the words that enter the cache.
    """

    def __init__(self, ids: Ints, counted: Mask, size: int) -> None:
        places = np.flatnonzero(counted)
        self.size, self.counted = size, counted
        self.stop: Ints = np.cumsum(counted) - counted
        self.start = np.maximum(0, self.stop - size)
        self.words = ids[places]
        # Word by word, in the order of the text: how often a word stands between two places is a difference.
        self._width = len(places) + 1
        self._sorted = np.sort(self.words * self._width + np.arange(len(places)))

    def shares(self, words: Ints) -> Floats:
        """The share of the cache that each of `words` (T,) has in its place, float64 (T,); 0 where it is empty."""
        held = np.searchsorted(self._sorted, words * self._width + self.stop)
        held = held - np.searchsorted(self._sorted, words * self._width + self.start)
        shares: Floats = np.where(words >= 0, held, 0) / np.maximum(1, self.stop - self.start)
        return shares

    def distribution(self, t: int, size: int, *, after: bool = False) -> Floats:
        """The share of each of `size` words in the cache at word `t`, or right after it, float64 (size,)."""
        stop = int(self.stop[t] + (after and self.counted[t]))
        recent = self.words[max(0, stop - self.size) : stop]
        return np.bincount(recent, minlength=size)[:size] / max(1, len(recent))


def with_cache(log10_p: Singles, shares: Floats, weight: float) -> Singles:
    """log10 of (1 - weight) p + weight * share, float32 (T,); the share takes the way over its float32 logarithm."""
    return _mean([log10_p, log10(shares)], [1 - weight, weight])
