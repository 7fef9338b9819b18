"""`mtd`: Berchtold's mixture transition distribution (Berchtold & Raftery 2002) as emissions of the filter.

P(w_t | w_t-1, ... w_t-L, c) = l_0 u_c(w_t) + sum over lags g of l_g B_g,c(w_t-g, w_t): a memory of L words with L
tables of pairs in place of one of (L+1)-grams (readings 3.11). u_c is Lidstone's (n_c(w) + delta) / (n_c + delta V);
B_g,c is the frequency of w_t after w_t-g, g words apart. The weights l of each place are found by EM, with every
training word left out of the counts that predict it; without that, lag 1, which fits best what it has seen, would take
everything.

Simplified: the transitions between places are the filter's own, and not a mixture over lags as in Berchtold's model.
Where w_t-g is before the sequence or was never followed by anything, u_c stands for B_g,c. In training, the words
before a visit are not known, as for n-grams.
"""

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.methods.tables import PairCounts, PairEmissions, before, count_pairs
from placerec.methods.training_set import TrainingSet, log_word_p

LAGS = 3
# EM ends after so many steps, or when a step gives less than this in nats per word.
STEPS, ENOUGH = 200, 1e-9


def fit(training: TrainingSet, lags: int = LAGS) -> PairEmissions:
    """Emissions of a word after the `lags` words before it."""
    pairs = [count_pairs(training, lag) for lag in range(1, lags + 1)]
    alone = np.exp(log_word_p(training)).T
    weights = mixture_weights(training, pairs)

    def score(ids: Ints, context: Ints) -> Floats:
        p = alone[ids] * weights[:, 0]
        for g, table in enumerate(pairs):
            counts, totals = table.look_up(context[g], ids)
            p += weights[:, g + 1] * np.where(totals > 0, counts / np.maximum(totals, 1), alone[ids])
        return np.log10(p)

    return PairEmissions(training.vocabulary, lags, score)


def mixture_weights(training: TrainingSet, pairs: list[PairCounts]) -> Floats:
    """The weights l_0, l_1... of each place, float64 (C, 1 + lags), rows sum to 1; equal where nothing was seen."""
    return np.array([best_weights(left_out_parts(training, pairs, c))[0] for c in range(len(training.places))])


def left_out_parts(training: TrainingSet, pairs: list[PairCounts], c: int) -> Floats:
    """What the parts of the mixture give each of the n training words of place c without itself, (n, 1 + lags)."""
    visits, V, delta = training.sentences[c], len(training.vocabulary), training.delta
    nothing = np.zeros(0, np.int64)
    ids = np.concatenate([nothing, *visits])
    context = np.concatenate([before(visit, len(pairs)) for visit in (nothing, *visits)], axis=1)
    counts = np.bincount(ids, minlength=V)[ids]
    alone = (counts - 1 + delta) / (len(ids) - 1 + delta * V)
    parts = [alone]
    for table, first in zip(pairs, context, strict=True):
        seen, totals = (part[:, c] for part in table.look_up(first, ids))
        parts.append(np.where(totals > 1, (seen - 1) / np.maximum(totals - 1, 1), alone))
    return np.stack(parts, axis=1)


def best_weights(parts: Floats) -> tuple[Floats, list[float]]:
    """The most probable weights (k,) for `parts` (n, k), and the log posterior before each step of EM.

    A Dirichlet prior adds one word to each part: none becomes impossible.
    """
    n, k = parts.shape
    weights = np.full(k, 1 / k)
    found: list[float] = []
    for _ in range(STEPS):
        joint = parts * weights
        total = joint.sum(axis=1)
        found.append(float(np.log(total).sum() + np.log(weights).sum()))
        if len(found) > 1 and found[-1] - found[-2] < ENOUGH * n:
            break
        weights = ((joint / total[:, None]).sum(axis=0) + 1) / (n + k)
    return weights, found
