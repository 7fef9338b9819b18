"""One model from several: static interpolation, and the values of one model in the shape of another.

Sections 11.4 and 11.6 of our SRILM specification.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from placerec.arrays import Singles
from placerec.errors import LanguageModelError
from placerec.lm.backoff import BackoffModel
from placerec.lm.draft import Draft, drafts_of, reweigh
from placerec.lm.logs import log10, p_of
from placerec.lm.markers import SENTENCE_START, UNKNOWN
from placerec.lm.trace import SILENT, Trace


def interpolate(
    models: Sequence[BackoffModel], weights: Sequence[float], *, non_events: Iterable[str] = (SENTENCE_START, UNKNOWN)
) -> BackoffModel:
    """The back-off model that stands for the weighted mean of `models`.

    It lists the n-grams of all of them, each with the mean of their probabilities; backoff weights are recomputed.
    Raises LanguageModelError unless there is one weight >= 0 per model and they sum to 1.
    """
    if len(models) != len(weights) or not models:
        raise LanguageModelError(f"{len(weights)} weights for {len(models)} models; give one per model")
    if min(weights) < 0 or abs(sum(weights) - 1) > 1e-6:
        raise LanguageModelError(f"the weights {tuple(weights)} must be 0 or more and sum to 1")
    draft, *others = drafts_of(models, list(non_events))
    for k, other in enumerate(others, start=1):
        merge(draft, other, merge_weight(weights, k))
    return draft.model()


def merge_weight(weights: Sequence[float], k: int) -> float:
    """The weight of what was merged so far when component k >= 1 joins it."""
    total = sum(weights[: k + 1])
    return 1 - weights[k] / total if weights[k] and total else 1.0


def merge(draft: Draft, other: Draft, weight: float, trace: Trace = SILENT) -> None:
    """Section 11.4: mix `other`, over the same trie, into `draft`, whose share is `weight`."""
    mixed: list[Singles] = []
    for n in range(1, draft.order + 1):
        mixed.append(_mix(draft.backed_off(n), other.backed_off(n), weight))
    for n in range(draft.order, 0, -1):
        new = np.flatnonzero(other.stored[n - 1] & ~draft.stored[n - 1])
        draft.stored[n - 1][new] = True
        if n > 1:
            draft.add_nodes(n - 1, np.unique(draft.trie.prefix(n)[new]))
        stored = draft.stored[n - 1]
        draft.log10_p[n - 1][stored] = mixed[n - 1][stored]
    reweigh(draft, trace)


def _mix(a: Singles, b: Singles, weight: float) -> Singles:
    return log10(weight * p_of(a) + (1 - weight) * p_of(b))
