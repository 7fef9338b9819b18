"""The order in which SRILM comes by the contexts of a model: a trie of hash tables, from the most recent word on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Ints, Mask
from placerec.lm.mutable import MutableModel
from placerec.lm.trie import Trie, build_trie
from placerec.srilm.order.hashing import table_order, walk_order

NEVER = np.iinfo(np.int64).max
# The place of each of some rows, int64, in the order in which SRILM comes by: (order, rows) -> places.
ContextOrder = Callable[[int, Ints], Ints]
# More than there are contexts of one length, times the lengths of n-grams.
_LATER = 1 << 50
# Behind all contexts of which it is known when they were made.
_LAST = 1 << 40


@dataclass(frozen=True)
class ContextTimes:
    """When each context was put into the trie: `created` int64 (m_n,) per order beside the rows, NEVER if it was not.

    It may lack the highest order, which has no contexts.
    `numbers` int64 (V,): SRILM's number of each word. `expected`: the size of vocabulary that the model was made for.
    """

    trie: Trie
    created: Sequence[Ints] = field(repr=False)
    numbers: Ints = field(repr=False)
    expected: int = 0


def message_order(trie: Trie, found: Callable[[], ContextTimes]) -> ContextOrder:
    """Gives the places of contexts of a model over `trie` in SRILM's walk; `found` tells when contexts were made.

    It is asked where that is needed. Contexts that it does not know come last, in the order of their words.
    """
    ranks: list[Ints] = []

    def places(n: int, contexts: Ints) -> Ints:
        if n == 1:
            return contexts
        times = found()
        if not ranks:
            ranks.extend(context_ranks(times))
        row = _same_rows(trie, times.trie, n - 1, contexts)
        known = ranks[n - 2][row] if n - 1 <= len(ranks) and len(ranks[n - 2]) else np.full(len(row), NEVER)
        known = np.where(row >= 0, known, NEVER)
        late = np.flatnonzero(known == NEVER)
        if len(late):
            *_, last = (rank for _, rank in zip(range(n - 1), trie.context_ranks(), strict=False))
            known[late] = _LAST + last[contexts[late]]
        return known

    return places


def _same_rows(trie: Trie, other: Trie, n: int, rows: Ints) -> Ints:
    """The rows of `other` that hold the words of `rows` of order n of `trie`, -1 where there are none."""
    numbers = np.empty((len(rows), n), np.int64)
    for k in range(n, 0, -1):
        numbers[:, k - 1] = trie.word(k)[rows]
        rows = trie.prefix(k)[rows] if k > 1 else rows
    own = other.vocabulary.ids(trie.vocabulary.words)[numbers]
    found = own[:, 0]
    for k in range(2, n + 1):
        found = other.find(k, found, own[:, k - 1])
    return found


def context_ranks(times: ContextTimes) -> list[Ints]:
    """Per length of context, the place of each row in SRILM's walk, int64 (m_n,); NEVER for what is no context."""
    trie = times.trie
    ranks: list[Ints] = []
    oldest, above = trie.keys[0], np.zeros(len(trie.vocabulary), np.int64)
    for k, created in enumerate(times.created[: trie.order - 1], start=1):
        if k > 1:
            oldest, above = oldest[trie.prefix(k)], ranks[-1][trie.suffixes[k - 1]]
        rows = np.flatnonzero(created < NEVER)
        rows = rows[np.lexsort((created[rows], above[rows]))]
        table: Ints = np.cumsum(np.diff(above[rows], prepend=above[rows][:1]) > 0)
        keys = times.numbers[oldest[rows]].astype(np.uint64)
        walked = rows[table_order(table, keys, size_hint=times.expected if k == 1 else 0)]
        rank = np.full(len(trie.keys[k - 1]), NEVER)
        rank[walked] = np.arange(len(walked))
        ranks.append(rank)
    return ranks


def merged_times(
    times: ContextTimes, other: ContextTimes, model: MutableModel, added: Sequence[Ints], numbers: Ints
) -> ContextTimes:
    """When the contexts of a model were made, after another one was merged into it.

    `times`, `other`: of both models, before; `model`: over a trie with the n-grams of both, whose words have these
    `numbers` int64 (V,); `added`, per order: the contexts, rows of order n-1, of the other model's n-grams that this
    one did not have. SRILM makes them from the longest contexts on, as it comes by the other model's.
    """
    trie = model.trie
    created = [np.full(len(keys), NEVER) for keys in trie.keys]
    for n, own in enumerate(times.created, start=1):
        rows = np.flatnonzero(own < NEVER)
        created[n - 1][_same_rows(times.trie, trie, n, rows)] = own[rows]
    now = 1 + max((int(own[own < NEVER].max(initial=0)) for own in created), default=0)
    walk = message_order(trie, lambda: other)
    for n in range(trie.order, 1, -1):
        rows, stamp = added[n - 1], now + walk(n, added[n - 1])
        now += _LATER
        for k in range(n - 1, 0, -1):
            new = created[k - 1][rows] == NEVER
            rows, stamp = rows[new], stamp[new]
            np.minimum.at(created[k - 1], rows, stamp)
            rows = trie.suffixes[k - 1][rows]
    return ContextTimes(trie, created, numbers, times.expected)


def noted_order(
    trie: Trie, missing: Sequence[Ints], is_context: Sequence[Mask], walk: ContextOrder, numbers: Ints
) -> list[Ints]:
    """The n-grams that need a line (section 6.7), rows per order, in the order in which SRILM gives them one.

    SRILM walks over the contexts (`walk` gives their places), short ones first, and notes the n-gram of each and its
    prefixes that are `missing`, longest first, in a trie from the most recent word to the oldest.
    """
    first = [np.full(len(keys), NEVER) for keys in trie.keys]
    for n in range(1, trie.order):
        rows = np.intersect1d(missing[n - 1], np.flatnonzero(is_context[n - 1]))
        first[n - 1][rows] = n * _LATER + walk(n + 1, rows) * trie.order
    for n in range(trie.order, 1, -1):
        np.minimum.at(first[n - 2], trie.prefix(n)[missing[n - 1]], first[n - 1][missing[n - 1]] + 1)
    backwards = [trie.matrix(n)[rows][:, ::-1] for n, rows in enumerate(missing, start=1)]
    noted, rows_of = build_trie(trie.vocabulary, trie.order, backwards)
    stamps = [np.full(len(keys), NEVER) for keys in noted.keys]
    for n, its in enumerate(rows_of):
        for stamp, rows in zip(stamps, its, strict=False):
            np.minimum.at(stamp, rows, first[n][missing[n]])
    orders, walked = walk_order(noted, [stamp < NEVER for stamp in stamps], stamps, numbers)
    found = []
    for n, rows in enumerate(missing, start=1):
        place = np.empty(len(noted.keys[n - 1]), np.int64)
        place[walked[orders == n]] = np.arange(int((orders == n).sum()))
        found.append(rows[np.argsort(place[rows_of[n - 1][-1]], kind="stable")])
    return found
