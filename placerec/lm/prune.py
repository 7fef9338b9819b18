"""Smaller models: entropy pruning (Stolcke 1998), and leaving out what backing off would make more probable.

Sections 11.2 and 11.3 of our SRILM specification.
"""

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.backoff import BackoffModel
from placerec.lm.draft import Draft, context_masses, drafts_of, insert_prefixes, reweigh, settle_masses
from placerec.lm.logs import EPSILON, LN10, p_of
from placerec.lm.markers import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.lm.trace import SILENT, Trace


def pruned(model: BackoffModel, threshold: float, *, shortest: int = 2) -> BackoffModel:
    """`model` without the n-grams, of `shortest` words or more, that raise perplexity by less than `threshold`.

    `threshold` is relative: 1e-8 leaves out what changes perplexity by less than one part in 10^8.
    """
    (draft,) = drafts_of([model], [SENTENCE_START, UNKNOWN])
    prune(draft, threshold, shortest=shortest)
    return draft.model()


def prune(
    draft: Draft, threshold: float, *, shortest: int = 2, history: Draft | None = None, trace: Trace = SILENT
) -> None:
    """Section 11.2: take out n-grams that change perplexity little, longest first, and recompute all weights.

    `history`: a model over the same trie that says how probable contexts are (default: the model itself).
    """
    draft.refresh_all()
    for n in range(draft.order, max(2, shortest) - 1, -1):
        _prune_order(draft, n, threshold, history or draft, trace)
    reweigh(draft, trace)


def _prune_order(draft: Draft, n: int, threshold: float, history: Draft, trace: Trace) -> None:
    contexts = np.flatnonzero(draft.node[n - 2])
    rows = np.flatnonzero(draft.stored[n - 1])
    group = np.searchsorted(contexts, draft.trie.prefix(n)[rows])
    num, den = context_masses(draft, n, contexts, rows, group)
    num[np.abs(num) < EPSILON] = 0
    den[np.abs(den) < EPSILON] = 0
    num, den, overfull = settle_masses(draft, n, rows, group, contexts, num, den, trace)
    tried = ~overfull[group]
    gone = _try(draft, n, threshold, history, rows[tried], contexts, group[tried], num, den, trace)
    draft.stored[n - 1][gone] = False
    _forget_contexts(draft, n, contexts[~overfull])
    draft.refresh(n)
    trace.pruned(n, gone)


def _try(
    draft: Draft,
    n: int,
    threshold: float,
    history: Draft,
    rows: Ints,
    contexts: Ints,
    group: Ints,
    num: Floats,
    den: Floats,
    trace: Trace,
) -> Ints:
    """Which of `rows`, n-grams of the contexts `contexts[group]`, can go."""
    vocabulary = draft.trie.vocabulary.index
    start, end = vocabulary.get(SENTENCE_START, -1), vocabulary.get(SENTENCE_END, -1)
    context = joint_log10_p(history, n - 1, start=start, end=end)[contexts][group]
    old = draft.log10_p[n - 1][rows]
    shorter = draft.backed_off(n - 1)[draft.trie.suffixes[n - 1][rows]]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        weight = (np.log10(num[group] + p_of(old)) - np.log10(den[group] + p_of(shorter))).astype(np.float32)
        new = shorter + weight
        change = (new - old).astype(np.float64)
        left = num[group] * (weight - draft.backoff[n - 2][contexts][group]).astype(np.float64)
        entropy = -p_of(context) * (p_of(old) * change + left)
        gone = (np.exp(entropy * LN10) - 1 < threshold) & ~draft.node[n - 1][rows]
    trace.trials(n, rows, context, old, new, entropy, gone)
    return rows[gone]


def joint_log10_p(draft: Draft, n: int, *, start: int, end: int) -> Singles:
    """log10 of the joint probability of the words of every row of order n, float32 (m_n,); as `score.joint_log10_p`.

    `start` and `end` are the word numbers of <s> and </s>, -1 if not listed; the backed-off values must be fresh.
    """
    single = draft.log10_p[0]
    total = np.where(np.isneginf(single) & ~draft.event, np.float32(0), single)
    if start >= 0:
        total[start] = single[end] if end >= 0 else -np.inf
    for k in range(2, n + 1):
        value = draft.backed_off(k)
        silent = ~draft.event[draft.trie.word(k)]
        total = total[draft.trie.prefix(k)] + np.where(np.isneginf(value) & silent, np.float32(0), value)
    return total


def _forget_contexts(draft: Draft, n: int, contexts: Ints) -> None:
    """Contexts of order n-1 that have no n-grams left, and no longer contexts, are none any more."""
    used = np.zeros(len(draft.node[n - 2]), bool)
    used[draft.trie.prefix(n)[draft.stored[n - 1]]] = True
    used[draft.trie.suffixes[n - 1][draft.node[n - 1]]] = True
    empty = contexts[~used[contexts]]
    draft.node[n - 2][empty] = False
    draft.backoff[n - 2][empty] = 0


def prune_improbable(draft: Draft, *, shortest: int = 2, trace: Trace = SILENT) -> None:
    """Section 11.3: take out n-grams that are less probable than by backing off, until there are none.

    Weights are recomputed after each round; contexts that lost their own line get it back at the end.
    """
    draft.refresh_all()
    while _improbable_round(draft, shortest, trace):
        reweigh(draft, trace)
    insert_prefixes(draft, trace)


def _improbable_round(draft: Draft, shortest: int, trace: Trace) -> bool:
    removed = False
    for n in range(max(2, shortest), draft.order + 1):
        rows = np.flatnonzero(draft.stored[n - 1])
        context = draft.trie.prefix(n)[rows]
        with np.errstate(invalid="ignore"):
            backed_off = draft.backed_off(n - 1)[draft.trie.suffixes[n - 1][rows]] + draft.backoff[n - 2][context]
        gone = rows[backed_off > draft.log10_p[n - 1][rows]]
        draft.stored[n - 1][gone] = False
        _forget_contexts(draft, n, np.flatnonzero(draft.node[n - 2]))
        draft.refresh(n)
        trace.pruned(n, gone)
        removed |= len(gone) > 0
    return removed
