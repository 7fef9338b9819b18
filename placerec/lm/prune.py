"""Smaller models: entropy pruning (Stolcke 1998), and leaving out what backing off would make more probable.

Sections 11.2 and 11.3 of our SRILM specification.
"""

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.lm.logs import LN10, p_of
from placerec.lm.mutable import SILENT, MutableModel, Trace, insert_prefixes, reweigh, settle_masses
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START

# Rows that are tried at once: what is computed on the way stays in the processor's cache.
_PART = 1 << 15


def prune(
    model: MutableModel,
    threshold: float,
    *,
    shortest: int = 2,
    history: MutableModel | None = None,
    trace: Trace = SILENT,
) -> None:
    """Section 11.2: take out n-grams that change perplexity little, longest first, and recompute all weights.

    `history`: a model over the same trie that says how probable contexts are (default: the model itself).
    """
    model.refresh_shorter()
    for n in range(model.order, max(2, shortest) - 1, -1):
        _prune_order(model, n, threshold, history or model, trace)
    reweigh(model, trace)


def _prune_order(model: MutableModel, n: int, threshold: float, history: MutableModel, trace: Trace) -> None:
    contexts = np.flatnonzero(model.is_context[n - 2])
    rows = np.flatnonzero(model.stored[n - 1])
    group = model.context_places(n - 1)[model.trie.prefix(n)[rows]]
    num, den, overfull = settle_masses(model, n, rows, group, contexts, None, trace)
    if overfull.any():
        tried = ~overfull[group]
        rows, group = rows[tried], group[tried]
    vocabulary = model.trie.vocabulary.index
    start, end = vocabulary.get(SENTENCE_START, -1), vocabulary.get(SENTENCE_END, -1)
    joint = joint_log10_p(history, n - 1, start=start, end=end)[contexts]
    weights = model.backoff[n - 2][contexts]
    shorter = model.backed_off(n - 1)
    gone = np.empty(len(rows), bool)
    for first in range(0, len(rows), _PART):
        row, its = rows[first : first + _PART], group[first : first + _PART]
        context, old = joint[its], model.log10_p[n - 1][row]
        less = shorter[model.trie.suffixes[n - 1][row]]
        p_old, left, lost = p_of(old), num[its], den[its]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            weight = (np.log10(left + p_old) - np.log10(lost + p_of(less))).astype(np.float32)
            new = less + weight
            change = (new - old).astype(np.float64)
            entropy = -p_of(context) * (p_old * change + left * (weight - weights[its]).astype(np.float64))
            gone[first : first + _PART] = (np.exp(entropy * LN10) - 1 < threshold) & ~model.is_context[n - 1][row]
        trace.trials(n, row, context, old, new, entropy, gone[first : first + _PART])
    model.stored[n - 1][rows[gone]] = False
    _forget_contexts(model, n, contexts[~overfull])
    trace.pruned(n, rows[gone])


def joint_log10_p(model: MutableModel, n: int, *, start: int, end: int) -> Singles:
    """log10 of the joint probability of the words of every row of order n, float32 (m_n,).

    `start` and `end` are the word numbers of <s> and </s>, -1 if not listed; the backed-off values must be fresh.
    """
    single = model.log10_p[0]
    total = np.where(np.isneginf(single) & ~model.predictable, np.float32(0), single)
    if start >= 0:
        total[start] = single[end] if end >= 0 else -np.inf
    for k in range(2, n + 1):
        value = model.backed_off(k)
        silent = ~model.predictable[model.trie.word(k)]
        total = total[model.trie.prefix(k)] + np.where(np.isneginf(value) & silent, np.float32(0), value)
    return total


def _forget_contexts(model: MutableModel, n: int, contexts: Ints) -> None:
    """Contexts of order n-1 that have no n-grams left, and no longer contexts, are none any more."""
    used = np.zeros(len(model.is_context[n - 2]), bool)
    used[model.trie.prefix(n)[np.flatnonzero(model.stored[n - 1])]] = True
    used[model.trie.suffixes[n - 1][np.flatnonzero(model.is_context[n - 1])]] = True
    empty = contexts[~used[contexts]]
    model.is_context[n - 2][empty] = False
    model.backoff[n - 2][empty] = 0


def prune_improbable(model: MutableModel, *, shortest: int = 2, trace: Trace = SILENT) -> None:
    """Section 11.3: take out n-grams that are less probable than by backing off, until there are none.

    Weights are recomputed after each round, the last one, too; contexts that lost their line get it back at the end.
    """
    model.refresh_shorter()
    removed = True
    while removed:
        removed = _improbable_round(model, shortest, trace)
        reweigh(model, trace)
    insert_prefixes(model, trace)


def _improbable_round(model: MutableModel, shortest: int, trace: Trace) -> bool:
    removed = False
    for n in range(max(2, shortest), model.order + 1):
        rows = np.flatnonzero(model.stored[n - 1])
        context = model.trie.prefix(n)[rows]
        with np.errstate(invalid="ignore"):
            backed_off = model.backed_off(n - 1)[model.trie.suffixes[n - 1][rows]] + model.backoff[n - 2][context]
        less = backed_off > model.log10_p[n - 1][rows]
        gone = rows[less]
        trace.improbable(n, gone, model.log10_p[n - 1][gone], backed_off[less])
        model.stored[n - 1][gone] = False
        _forget_contexts(model, n, np.flatnonzero(model.is_context[n - 2]))
        if n < model.order:
            model.refresh(n)
        trace.pruned(n, gone)
        removed |= len(gone) > 0
    return removed
