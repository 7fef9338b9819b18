"""From counts to a back-off model, with SRILM's arithmetic: section 6 of our SRILM specification."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.errors import LanguageModelError, refuse_string
from placerec.lm.backoff import BackoffModel
from placerec.lm.counts import NgramCounts
from placerec.lm.discounts import Context, Rule
from placerec.lm.logs import EPSILON, LN10, log10, log10_of_sum, p_of
from placerec.lm.mutable import SILENT, MutableModel, Trace, insert_prefixes, weigh_contexts
from placerec.lm.smoothings import Smoothing
from placerec.lm.trie import Trie, per_context, runs
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN


def estimate(
    counts: NgramCounts,
    smoothing: Smoothing,
    *,
    min_count: Sequence[int] = (1,),
    non_events: Iterable[str] = (),
    open_vocabulary: bool = False,
) -> BackoffModel:
    """The back-off model of `counts` under `smoothing` (see `placerec.lm.smoothing`).

    `min_count`: n-grams of order n seen less than `min_count[n-1]` times are left out, the last entry repeats.
    `non_events`: words that are never predicted (but may be context), beside `<s>`; `<unk>` is one unless
    `open_vocabulary`. Raises LanguageModelError if no word is left to predict.
    """
    refuse_string(non_events, LanguageModelError)
    if any(m < 1 for m in min_count) or not min_count:
        raise LanguageModelError(f"minimum counts {tuple(min_count)} must be 1 or more, one per order")
    vocabulary = counts.trie.vocabulary
    silent = {*non_events, SENTENCE_START} | (set() if open_vocabulary else {UNKNOWN})
    rules = []
    for n in range(1, counts.order + 1):
        counts, discount = smoothing.fit(counts, n, ~vocabulary.mask(silent))
        rules.append(Rule(discount, smoothing.interpolate, min_count[min(n, len(min_count)) - 1]))
    model = estimate_mutable(counts, rules, non_events=non_events, open_vocabulary=open_vocabulary)
    if not model.predictable.any():
        raise LanguageModelError("the vocabulary holds no word that could be predicted; is the vocabulary file empty?")
    insert_prefixes(model, SILENT)
    return model.model()


def estimate_mutable(
    counts: NgramCounts,
    rules: Sequence[Rule],
    *,
    non_events: Iterable[str] = (),
    open_vocabulary: bool = False,
    unknown: str = UNKNOWN,
    meta: Ints | None = None,
    trust_totals: bool = False,
    alias_counts: Ints | None = None,
    trace: Trace = SILENT,
) -> MutableModel:
    """The model of `counts` by one rule per order, before missing prefixes are inserted.

    `unknown`: the word that stands for those outside the vocabulary.
    `meta` int64 (V,): k for a word that stands for k occurrences, as often as its count says, 0 for one that stands for
    some occurrences, -1 for other words (section 4.5 of our SRILM specification).
    `trust_totals`: a context's own count is its total. `alias_counts` int64 (V,): how many names each word has.
    """
    trie = counts.trie
    occurrences = np.full(len(trie.vocabulary), -1) if meta is None else meta
    silent = {*non_events, SENTENCE_START} | (set() if open_vocabulary else {unknown})
    predictable = ~trie.vocabulary.mask(silent) & (occurrences < 0)
    model = MutableModel(
        trie, predictable, np.ones(len(predictable), np.int64) if alias_counts is None else alias_counts
    )
    # <s> is listed always, other non-events where the counts hold them (and words); <unk> never while it is one.
    listed = ~predictable & ~(occurrences >= 0) & counts.seen[0] & ~trie.vocabulary.mask([unknown])
    listed &= bool(counts.counts[0][predictable & counts.seen[0]].sum() > 0)
    model.stored[0] |= listed | trie.vocabulary.mask([SENTENCE_START])
    closed = _closed_contexts(trie, None if open_vocabulary else unknown)
    for n, rule in enumerate(rules, start=1):
        trace.discarded_contexts(n, int((closed[n - 1] & _seen(counts, n - 1)).sum()))
        _estimate_order(model, counts, n, rule, closed[n - 1], occurrences, unknown, trust_totals, trace)
        trace.order_done(n)
        weigh_contexts(model, n, trace)
        model.refresh(n)
    return model


# SRILM adds 1 to a context's count until 3 in a million is left: a million steps do for counts of 3e11.
_MOST_STEPS = 1e6
# N-grams times attempts that are told at once.
_AT_ONCE = 1 << 18
# N-grams that are estimated at once: what is computed on the way stays in the processor's cache.
_BLOCK = 1 << 15


def _seen(counts: NgramCounts, n: int) -> Mask:
    return counts.seen[n - 1] if n else np.ones(1, bool)


def _closed_contexts(trie: Trie, closed_word: str | None) -> list[Mask]:
    """Per order n, the (n-1)-grams, bool, that nothing is estimated for: they end in </s> or hold `closed_word`."""
    end = trie.vocabulary.mask([SENTENCE_END])
    unknown = trie.vocabulary.mask([closed_word] if closed_word else [])
    closed = [np.zeros(1, bool), end | unknown]
    holds_unknown = unknown
    for n in range(2, trie.order):
        holds_unknown = holds_unknown[trie.prefix(n)] | unknown[trie.word(n)]
        closed.append(holds_unknown | end[trie.word(n)])
    return closed


def _estimate_order(
    model: MutableModel,
    counts: NgramCounts,
    n: int,
    rule: Rule,
    closed: Mask,
    meta: Ints,
    unknown: str,
    trust_totals: bool,
    trace: Trace,
) -> None:
    """Sections 6.2 to 6.4: the probabilities of order n."""
    trie = model.trie
    prefix = trie.prefix(n) if n > 1 else np.zeros(len(trie.keys[0]), np.int64)
    rows = np.flatnonzero(counts.seen[n - 1] & ~closed[prefix])
    word = trie.word(n)[rows]
    contexts, group = runs(prefix[rows])
    del prefix
    stats = _statistics(counts, n, rows, group, len(contexts), model.predictable[word], meta, word)
    if trust_totals and n > 1:
        stats = Context(counts.counts[n - 2][contexts].astype(np.float64), stats.types, stats.types2, stats.types3)
    alive = stats.total[group] > 0
    count = counts.counts[n - 1][rows].astype(np.float64)
    alive &= (meta[word] < 0) & ((count != 0) if n > 1 else True)
    kept = alive & model.predictable[word]
    # Of single words only the unknown one is said to be discarded.
    silent = alive & ~model.predictable[word] & (trie.vocabulary.mask([unknown])[word] if n == 1 else True)
    silent_of = per_context(group[silent], len(contexts))
    size = model.names + int((meta >= 0).sum())
    if not kept.all():
        rows, group, count = rows[kept], group[kept], count[kept]
    order = _Order(n, rule, size, rows, group, count, _lower(model, n, rows), contexts, stats, silent_of)
    _fill_order(model, order, trace)


def _lower(model: MutableModel, n: int, rows: Ints) -> Singles:
    """log10 p float32 (m,) of n-grams by the shorter context, the uniform one at the end."""
    if n == 1:
        return np.full(len(rows), np.float32(-np.log10(max(1, model.names))), np.float32)
    model.refresh(n - 1)
    return model.backed_off(n - 1)[model.trie.suffixes[n - 1][rows]]


def _statistics(
    counts: NgramCounts, n: int, rows: Ints, group: Ints, size: int, predictable: Mask, meta: Ints, word: Ints
) -> Context:
    """Section 6.2, per context (size,): totals and types over the words that are events, and what meta counts add."""
    count = counts.counts[n - 1][rows].astype(np.float64)
    if (meta < 0).all():
        columns = (np.where(predictable, count, 0), predictable, predictable & (count >= 2), predictable & (count >= 3))
        return Context(*(per_context(group, size, column) for column in columns))
    times = meta[word]
    tag = (times >= 0) & (n > 1)
    total_tag, type_tag = tag & (times == 0), tag & (times > 0)
    return Context(
        total=per_context(group, size, np.where(type_tag, times * count, np.where(predictable | total_tag, count, 0))),
        types=per_context(group, size, np.where(type_tag, count, (predictable | total_tag).astype(np.float64))),
        types2=per_context(group, size, np.where(type_tag, count * (times >= 2), predictable & (count >= 2))),
        types3=per_context(group, size, np.where(type_tag, count * (times >= 3), predictable & (count >= 3))),
    )


@dataclass(frozen=True)
class _Order:
    """What order `n` is estimated from: n-grams `rows` (m,), their counts, their log10 p by the shorter context.

    `contexts[group]` are their contexts, of which `stats` tells; `size` is V with the meta words. `silent`: how many
    n-grams of each context are left out, as their last word is never predicted.
    """

    n: int
    rule: Rule
    size: int
    rows: Ints
    group: Ints
    count: Floats
    lower: Singles
    contexts: Ints
    stats: Context
    silent: Floats


def _fill_order(model: MutableModel, order: _Order, trace: Trace) -> None:
    """Sections 6.3 and 6.4: store p of the n-grams of `order`."""
    rule, n, group = order.rule, order.n, order.group
    interpolate = np.full(len(order.contexts), rule.interpolate and rule.discount is not None)
    total = order.stats.total
    roomy = (order.stats.types < model.names) & rule.exhaustible & (rule.discount is not None)
    p = np.zeros(len(order.rows))
    log10_p = np.zeros(len(order.rows), np.float32)
    kept = np.zeros(len(order.rows), bool)
    todo = np.ones(len(order.contexts), bool)
    attempt = 0
    while todo.any():
        tried = todo[group]
        trace.discarded_ngrams(n, int(order.silent[todo].sum()), 0)
        for part in _parts(tried, whole=trace.every_attempt):
            p[part], log10_p[part], kept[part] = _attempt(order, part, total, interpolate, attempt, trace)
        tried &= kept
        spent = per_context(group, len(order.contexts), np.where(tried, p, 0))
        todo = todo & roomy & (spent > 1 - EPSILON)
        if not todo.any():
            break
        # A context that leaves nothing to unseen words is done again, first without interpolation, then thinner.
        again, used = np.flatnonzero(todo), np.flatnonzero(tried & todo[group])
        place, interpolated = np.searchsorted(again, group[used]), bool(interpolate[again].any())
        trace.no_mass(n, attempt, order.contexts[again], place, order.rows[used], p[used], interpolated=interpolated)
        _check_reachable(n, total[todo], spent[todo])
        if attempt < 2 or trace.every_step:
            total = np.where(todo & ~interpolate, total + 1, total)
        else:
            least = _least_total(order, again, total[again])
            if trace.every_attempt:
                _tell_attempts(order, again, total[again], least, attempt + 1, trace)
            total[again] = least
        interpolate = interpolate & ~todo
        attempt += 1
    stored = order.rows[kept]
    model.log10_p[n - 1][stored] = log10_p[kept]
    model.stored[n - 1][stored] = True
    if n > 1:
        model.add_contexts(n - 1, runs(model.trie.prefix(n)[stored])[0])


def _parts(which: Mask, *, whole: bool) -> Iterator[slice | Ints]:
    """The n-grams of a mask in parts of _BLOCK, or all at once: where attempts are told, so are whole contexts."""
    at = None if which.all() else np.flatnonzero(which)
    number = len(which) if at is None else len(at)
    size = max(1, number) if whole else _BLOCK
    for start in range(0, number, size):
        part = slice(start, start + size)
        yield part if at is None else at[part]


def _least_total(order: _Order, contexts: Ints, total: Floats) -> Floats:
    """The totals (c,) of contexts, counted up from `total` in steps of 1, that leave something to unseen words."""
    of = np.full(len(order.contexts), -1)
    of[contexts] = np.arange(len(contexts))
    at = np.flatnonzero(of[order.group] >= 0)
    group, stats, count = of[order.group[at]], order.stats, order.count[at]

    def enough(steps: Floats) -> Mask:
        types = [column[contexts][group] for column in (stats.types, stats.types2, stats.types3)]
        tried = Context((total + steps)[group], *types)
        factor, _ = _discounted(order.rule, count, tried, order.size)
        return per_context(group, len(contexts), factor * count / tried.total) <= 1 - EPSILON

    low, high = np.zeros(len(contexts)), np.ones(len(contexts))
    while (short := ~enough(high)).any():
        low, high = np.where(short, high, low), np.where(short, 2 * high, high)
    while (high - low > 1).any():
        middle = np.floor((low + high) / 2)
        fits = enough(middle)
        low, high = np.where(fits, low, middle), np.where(fits, middle, high)
    return total + high


def _tell_attempts(order: _Order, contexts: Ints, total: Floats, least: Floats, attempt: int, trace: Trace) -> None:
    """Tell of the attempts of contexts (c,) with totals between `total` and `least` (c,), which both are done apart."""
    stats = order.stats
    for context, start, stop in zip(contexts.tolist(), total.tolist(), least.tolist(), strict=True):
        at = np.flatnonzero(order.group == context)
        types = [column[[context]] for column in (stats.types, stats.types2, stats.types3)]
        size, told = max(1, _AT_ONCE // max(1, len(at))), attempt
        for first in np.arange(start + 1, stop, size).tolist():
            totals = np.arange(first, min(stop, first + size))[:, None]
            factor, _ = _discounted(order.rule, order.count[at], Context(totals, *types), order.size)
            p = factor * order.count[at] / totals
            gone = int(np.broadcast_to(factor == 0, p.shape).sum())
            trace.discarded_ngrams(order.n, int(order.silent[context]) * len(p), gone)
            trace.again(order.n, told, int(order.contexts[context]), order.rows[at], p)
            told += len(p)


def _check_reachable(n: int, total: Floats, spent: Floats) -> None:
    """Raise LanguageModelError where counts (C,) are so large that adding 1 has (almost) no effect on what is left."""
    far = ((spent - 1 + EPSILON) * total > _MOST_STEPS) | (total >= 2.0**53)
    if far.any():
        raise LanguageModelError(
            f"a context of the {n}-grams was counted {total[far].max():g} times: so often that what it leaves to unseen"
            " words is lost in rounding; divide the counts, or use another smoothing"
        )


def _attempt(
    order: _Order, at: slice | Ints, total: Floats, interpolate: Mask, attempt: int, trace: Trace
) -> tuple[Floats, Singles, Mask]:
    """p of the n-grams `at` with these totals, log10 p, and which of them are kept."""
    group, count, lower, stats = order.group[at], order.count[at], order.lower[at], order.stats
    context = Context(total[group], stats.types[group], stats.types2[group], stats.types3[group])
    factor, weight = _discounted(order.rule, count, context, order.size)
    mixed = interpolate[group]
    part = factor * count / context.total
    p = np.where(mixed, part + weight * p_of(lower), part)
    log10_p = log10_of_sum(p, [lower], [np.where(mixed, weight, 0)], start=part) if mixed.any() else log10(p)
    kept = factor != 0
    if trace.every_attempt and mixed.any():
        # What these contexts leave is told: next to nothing, where the exp of numpy and of the C library differ.
        spent = per_context(group[kept], len(total), p[kept])
        told = np.flatnonzero(mixed & (spent > 1 - EPSILON)[group])
        exact = [math.exp(one * LN10) for one in lower[told].tolist()]
        p[told] = part[told] + weight[told] * np.array(exact)
    trace.probabilities(
        order.n,
        attempt,
        order.rows[at][kept],
        count[kept],
        context.total[kept],
        factor[kept],
        (weight[kept], lower[kept]) if mixed.any() else None,
        log10_p[kept],
    )
    trace.discarded_ngrams(order.n, 0, int((~kept).sum()))
    return p, log10_p, kept


def _discounted(rule: Rule, count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
    """The rule's factor, 1 for counts of 0 and 0 below the minimum, and its weight of the lower order."""
    if rule.discount is None:
        return np.where((count > 0) & (count < rule.minimum), 0.0, 1.0), np.zeros_like(count)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor, weight = rule.discount(count, context, V)
    return np.where(count <= 0, 1.0, np.where(count < rule.minimum, 0.0, factor)), weight
