"""From counts to a back-off model, with SRILM's arithmetic: section 6 of our SRILM specification.

Log probabilities and weights are stored in float32 and computed in float64 from what is stored: the roundings, and
the order of the operations, are what makes the printed digits equal.
"""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from placerec.errors import LanguageModelError
from placerec.lm.backoff import BackoffModel, Singles
from placerec.lm.counts import SENTENCE_END, SENTENCE_START, UNKNOWN, NgramCounts
from placerec.lm.discounts import Floats, Smoothing
from placerec.lm.trie import Ints, Trie, per_context

EPSILON = 3e-6
LN10 = 2.30258509299404568402
Mask = NDArray[np.bool_]
log = logging.getLogger(__name__)


@dataclass
class _Draft:
    """The model while it grows; every array lies beside the rows of the counts' trie.

    `stored`: has a log probability of its own. `base` + `weight` (float32): the log probability by back-off, `base` of
    the longest stored ending and `weight` the backoff weights paid on the way, summed from short contexts to long.
    `node`: is a context of the model; `backoff` its weight.
    """

    trie: Trie
    event: Mask
    stored: list[Mask] = field(default_factory=list)
    log10_p: list[Singles] = field(default_factory=list)
    base: list[Singles] = field(default_factory=list)
    weight: list[Singles] = field(default_factory=list)
    node: list[Mask] = field(default_factory=list)
    backoff: list[Singles] = field(default_factory=list)

    def __post_init__(self) -> None:
        for keys in self.trie.keys:
            size = len(keys)
            self.stored.append(np.zeros(size, bool))
            self.node.append(np.zeros(size, bool))
            for column in (self.log10_p, self.base):
                column.append(np.full(size, -np.inf, np.float32))
            for column in (self.weight, self.backoff):
                column.append(np.zeros(size, np.float32))

    def backed_off(self, n: int) -> Singles:
        """log10 p float32 (m_n,) of every row of order n under the model as it stands."""
        return self.base[n - 1] + self.weight[n - 1]

    def refresh(self, n: int) -> None:
        """Bring `base` and `weight` of order n up to date with what is stored."""
        stored, log10_p = self.stored[n - 1], self.log10_p[n - 1]
        if n == 1:
            self.base[0] = log10_p
            return
        shorter, context = self.trie.suffixes[n - 1], self.trie.prefix(n)
        paid = np.where(self.node[n - 2], self.backoff[n - 2], np.float32(0))[context]
        self.base[n - 1] = np.where(stored, log10_p, self.base[n - 2][shorter])
        self.weight[n - 1] = np.where(stored, np.float32(0), self.weight[n - 2][shorter] + paid)


def estimate(
    counts: NgramCounts,
    smoothing: Smoothing,
    *,
    min_count: Sequence[int] = (1,),
    non_events: Iterable[str] = (),
    open_vocabulary: bool = False,
) -> BackoffModel:
    """The back-off model of `counts` under `smoothing` (see `placerec.lm.discounts.smoothing`).

    `min_count`: n-grams of order n seen less than `min_count[n-1]` times are left out, the last entry repeats.
    `non_events`: words that are never predicted (but may be context), beside <s>; <unk> is one unless
    `open_vocabulary`. Raises LanguageModelError if no word is left to predict.
    """
    trie = counts.trie
    if any(m < 1 for m in min_count) or not min_count:
        raise LanguageModelError(f"minimum counts {tuple(min_count)} must be 1 or more, one per order")
    silent = {*non_events, SENTENCE_START} | (set() if open_vocabulary else {UNKNOWN})
    event = ~trie.vocabulary.mask(silent)
    if not event.any():
        raise LanguageModelError("the vocabulary holds no word that could be predicted; is the vocabulary file empty?")
    draft = _Draft(trie, event)
    _store_unigram_markers(draft, counts)
    closed_context = _closed_contexts(trie, open_vocabulary)
    for n in range(1, trie.order + 1):
        minimum = min_count[min(n, len(min_count)) - 1]
        _estimate_order(draft, counts, n, smoothing, minimum, closed_context[n - 1])
        _weigh_contexts(draft, n)
        draft.refresh(n)
    _insert_prefixes(draft)
    return _compact(draft)


def _store_unigram_markers(draft: _Draft, counts: NgramCounts) -> None:
    """<s> is listed always, other non-events where the text holds them; <unk> never while it is one."""
    vocabulary = draft.trie.vocabulary
    listed = ~draft.event & counts.seen & ~vocabulary.mask([UNKNOWN])
    draft.stored[0] |= listed | vocabulary.mask([SENTENCE_START])


def _closed_contexts(trie: Trie, open_vocabulary: bool) -> list[Mask]:
    """Per order n, the (n-1)-grams, bool, that nothing is estimated for: they end in </s> or hold a closed <unk>."""
    end = trie.vocabulary.mask([SENTENCE_END])
    unknown = trie.vocabulary.mask([] if open_vocabulary else [UNKNOWN])
    closed = [np.zeros(1, bool), end | unknown]
    holds_unknown = unknown
    for n in range(2, trie.order):
        holds_unknown = holds_unknown[trie.prefix(n)] | unknown[trie.word(n)]
        closed.append(holds_unknown | end[trie.word(n)])
    return closed


def _estimate_order(
    draft: _Draft, counts: NgramCounts, n: int, smoothing: Smoothing, minimum: int, closed: Mask
) -> None:
    """Sections 6.2 to 6.4: the probabilities of order n."""
    trie, V = draft.trie, int(draft.event.sum())
    context = trie.prefix(n) if n > 1 else np.zeros(len(trie.keys[0]), np.int64)
    rows = np.flatnonzero(draft.event[trie.word(n)] & ~closed[context])
    if n == 1:
        rows = rows[counts.seen[rows]]
    contexts, group = np.unique(context[rows], return_inverse=True)
    count = counts.counts[n - 1][rows].astype(np.float64)
    total = per_context(group, len(contexts), count)
    types = per_context(group, len(contexts))
    if n == 1:
        lower = np.full(len(rows), np.float32(-np.log10(V)), np.float32)
    else:
        draft.refresh(n - 1)
        lower = draft.backed_off(n - 1)[trie.suffixes[n - 1][rows]]
    kept = count >= minimum
    interpolate = np.full(len(contexts), smoothing.interpolate)
    p = np.zeros(len(rows))
    todo = np.ones(len(contexts), bool)
    while todo.any():
        at = todo[group]
        factor, weight = smoothing.discount(count[at], total[group[at]], types[group[at]], V)
        part = factor * count[at] / total[group[at]]
        p[at] = np.where(interpolate[group[at]], part + weight * _p(lower[at]), part)
        spent = per_context(group[kept & at], len(contexts), p[kept & at])
        todo &= (types < V) & (spent > 1 - EPSILON)
        # A context that leaves nothing to unseen words is done again, first without interpolation, then thinner.
        total = np.where(todo & ~interpolate, total + 1, total)
        interpolate &= ~todo
    draft.log10_p[n - 1][rows[kept]] = np.log10(p[kept]).astype(np.float32)
    draft.stored[n - 1][rows[kept]] = True


def _weigh_contexts(draft: _Draft, n: int) -> None:
    """Section 6.5: the backoff weights of all contexts of length n-1, from what order n stored."""
    rows = np.flatnonzero(draft.stored[n - 1])
    if n == 1:
        rows = rows[draft.event[rows]]
        num = 1 - _p(draft.log10_p[0][rows]).sum()
        _spread_unigram_mass(draft, num if num >= EPSILON else 0.0)
        return
    context = draft.trie.prefix(n)[rows]
    contexts, group = np.unique(context, return_inverse=True)
    shorter = draft.backed_off(n - 1)[draft.trie.suffixes[n - 1][rows]]
    num = 1 - per_context(group, len(contexts), _p(draft.log10_p[n - 1][rows]))
    den = 1 - per_context(group, len(contexts), _p(shorter))
    num[np.abs(num) < EPSILON] = 0
    den[np.abs(den) < EPSILON] = 0
    stuck = (den < EPSILON) & (num > EPSILON)
    if stuck.any():
        log.debug("order %d: %d contexts have seen every word; their probabilities are scaled to 1", n, stuck.sum())
        scale = np.where(stuck, -np.log10(1 - np.where(stuck, num, 0)), 0).astype(np.float32)
        draft.log10_p[n - 1][rows] += scale[group]
        num[stuck] = den[stuck] = 0
    overfull = ~stuck & (num < 0)
    num[~overfull & (den <= 0)] = 0
    den[~overfull & (den <= 0)] = 0
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where((num < EPSILON) & (den < EPSILON), 0, np.log10(num) - np.log10(den))
    weight[overfull] = -np.inf
    draft.backoff[n - 2][contexts] = weight.astype(np.float32)
    draft.node[n - 2][contexts] = True
    node = contexts
    for k in range(n - 1, 1, -1):
        node = np.unique(draft.trie.suffixes[k - 1][node])
        draft.node[k - 2][node] = True


def _spread_unigram_mass(draft: _Draft, mass: float) -> None:
    """Section 6.6: what the seen unigrams leave goes to the words without one, or to all if there are none."""
    draft.stored[0] |= draft.event
    zero = draft.event & np.isneginf(draft.log10_p[0])
    if zero.any():
        if mass > 0:
            draft.log10_p[0][zero] = np.float32(np.log10(mass / zero.sum()))
        return
    lifted = _p(draft.log10_p[0][draft.event]) + mass / draft.event.sum()
    draft.log10_p[0][draft.event] = np.log10(lifted).astype(np.float32)


def _insert_prefixes(draft: _Draft) -> None:
    """Section 6.7: a context needs a line for its weight; those that have none get their backed-off value."""
    trie = draft.trie
    missing: list[Ints] = [np.zeros(0, np.int64)] * trie.order
    needed = np.zeros(0, np.int64)
    for n in range(trie.order - 1, 0, -1):
        lacking = draft.node[n - 1] & ~draft.stored[n - 1]
        lacking[needed[~draft.stored[n - 1][needed]]] = True
        missing[n - 1] = np.flatnonzero(lacking)
        needed = np.unique(trie.prefix(n)[missing[n - 1]]) if n > 1 else needed
    for n, rows in enumerate(missing, start=1):
        draft.refresh(n)
        draft.log10_p[n - 1][rows] = draft.backed_off(n)[rows]
        draft.stored[n - 1][rows] = True
        draft.refresh(n)


def _compact(draft: _Draft) -> BackoffModel:
    """The model without the rows that hold nothing."""
    backoffs = [
        np.where(node, backoff, np.float32(np.nan)).astype(np.float32)[stored]
        for node, backoff, stored in zip(draft.node, draft.backoff, draft.stored, strict=True)
    ]
    return BackoffModel(
        draft.trie.keep(draft.stored),
        tuple(log10_p[stored] for log10_p, stored in zip(draft.log10_p, draft.stored, strict=True)),
        tuple(backoffs),
    )


def _p(log10_p: Singles) -> Floats:
    """Probabilities float64 of float32 log10 probabilities, by the specification's exp(x ln 10)."""
    return np.exp(log10_p.astype(np.float64) * LN10)
