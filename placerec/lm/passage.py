"""Running text against a model: which n-gram answers for each word, and with what probability.

The rule is that of section 6.8 of our SRILM specification, for all words of a text at once; sums in float32.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.lm.row_index import RowIndex

if TYPE_CHECKING:
    from placerec.lm.draft import Draft


class Passage(NamedTuple):
    """Sequences of words, one behind the other: word numbers `ids` (T,), -1 for a word that no model knows.

    `first` bool (T,): a sequence starts here, words before it are no context. `scored` bool (T,): the word is
    predicted; the others are context only.
    """

    ids: Ints
    first: Mask
    scored: Mask

    @staticmethod
    def of_rows(ngrams: Ints) -> "Passage":
        """N-grams, a matrix of word numbers int64 (m, n), whose last words are predicted."""
        position = np.tile(np.arange(ngrams.shape[1]), len(ngrams))
        return Passage(ngrams.reshape(-1), position == 0, position == ngrams.shape[1] - 1)

    @property
    def place(self) -> Ints:
        """How many words of its sequence stand before each word, int64 (T,)."""
        position = np.arange(len(self.ids))
        return position - np.maximum.accumulate(np.where(self.first, position, 0))


class Reading:
    """Where a model finds the words of a passage: `rows[n-1]` (T,) of the n-gram that ends at each word, or -1."""

    def __init__(self, draft: "Draft", first: Mask, ids: Ints) -> None:
        self.draft, self.first, self.rows = draft, first, [ids]

    def before(self, k: int) -> Ints:
        """Rows of order k (T,): the k words before each word; -1 where they are not listed or not of its sequence."""
        row = np.empty(len(self.first), np.int64)
        row[1:] = self.rows[k - 1][:-1]
        row[self.starts] = -1
        return row

    @cached_property
    def starts(self) -> Ints:
        """Where sequences start."""
        starts: Ints = np.flatnonzero(self.first)
        return starts

    @cached_property
    def contexts(self) -> list[Ints]:
        """Per length k, `before(k)` where it is a context of the model, else -1."""
        found = []
        for k in range(1, self.draft.order):
            row = self.before(k)
            found.append(np.where(_marked(self.draft.node[k - 1], row), row, -1))
        return found


def read_passage(draft: "Draft", passage: Passage) -> Reading:
    """Find the passage's n-grams in the model."""
    reading = Reading(draft, passage.first, passage.ids)
    unlisted = np.flatnonzero(passage.ids < 0)
    for n in range(2, draft.order + 1):
        before = reading.before(n - 1)
        before[unlisted] = -1
        reading.rows.append(_find(draft, n, before, passage.ids))
    return reading


def _find(draft: "Draft", n: int, prefix: Ints, word: Ints) -> Ints:
    """Rows of order n (q,), -1 where there is none; `word` is listed wherever `prefix` is."""
    keys, V = draft.trie.keys[n - 1], len(draft.trie.vocabulary)
    if not len(keys) or 4 * len(word) < len(keys):
        return draft.trie.find(n, prefix, word)
    # Where the prefix is -1 this is negative, and no key.
    wanted = prefix * V
    wanted += word
    highest = len(draft.trie.keys[n - 2]) * V
    return RowIndex(keys).find(wanted) if highest > 4 * len(word) else _find_directly(keys, wanted, highest)


def _find_directly(keys: Ints, wanted: Ints, highest: int) -> Ints:
    """The same with a table of all keys that are possible, below `highest`; negative numbers are none."""
    places = np.full(highest + 1, -1, np.int32)
    places[keys] = np.arange(len(keys))
    # What is negative looks up the last place, which is free.
    return places[np.maximum(wanted, -1)].astype(np.int64)


def _marked(mask: Mask, rows: Ints) -> Mask:
    """bool (q,): whether `mask` (m,) holds at each of `rows`; not where they are -1."""
    return (rows >= 0) & mask[rows] if len(mask) else np.zeros(len(rows), bool)


def climb(reading: Reading, words: Ints | None = None) -> Iterator[tuple[Singles, Singles, Ints]]:
    """With at most 0, 1, ... order-1 words of context, (T,): what is found, as `base` + `weight` float32, and how long.

    Their sum is log10 p; `weight` is what backing off costs. Length 0: not even a unigram. The arrays are the same in
    every step. `words` (T,): other words in the places of the passage's own.
    """
    draft = reading.draft
    ids = reading.rows[0] if words is None else words
    base = np.full(len(ids), -np.inf, np.float32)
    answered = np.zeros(len(ids), np.int64)
    weight = np.zeros(len(ids), np.float32)
    found = np.flatnonzero(ids >= 0)
    found = found[draft.stored[0][ids[found]]]
    base[found] = draft.log10_p[0][ids[found]]
    answered[found] = 1
    yield base, weight, answered
    for n in range(2, draft.order + 1):
        context = reading.contexts[n - 2]
        at = np.flatnonzero((context >= 0) & (ids >= 0))
        weight[at] += draft.backoff[n - 2][context[at]]
        row = reading.rows[n - 1][at] if words is None else _find(draft, n, context[at], words[at])
        listed = _marked(draft.stored[n - 1], row)
        found, row = at[listed], row[listed]
        base[found] = draft.log10_p[n - 1][row]
        weight[found] = 0
        answered[found] = n
        yield base, weight, answered


def look_up(reading: Reading) -> Singles:
    """log10 p float32 (T,) of the passage's words; the model's backed-off values must be fresh."""
    draft, T = reading.draft, len(reading.first)
    base, weight = np.full(T, -np.inf, np.float32), np.zeros(T, np.float32)
    left = np.arange(T)
    levels = []
    # The longest n-gram that is listed knows what backing off below it costs; longer contexts add their weights.
    for n in range(draft.order, 0, -1):
        row = reading.rows[n - 1][left]
        listed = row >= 0
        found = left[listed]
        base[found], weight[found] = draft.base[n - 1][row[listed]], draft.weight[n - 1][row[listed]]
        left = left[~listed]
        levels.append(left)
    for k in range(1, draft.order):
        at = levels[draft.order - 1 - k]
        at = at[(at > 0) & ~reading.first[at]]
        context = reading.rows[k - 1][at - 1]
        known = _marked(draft.node[k - 1], context)
        weight[at[known]] += draft.backoff[k - 1][context[known]]
    with np.errstate(invalid="ignore"):
        return base + weight


def look_up_others(reading: Reading, words: Ints) -> Singles:
    """log10 p float32 (T,) of `words` (T,) in the places of the passage's words."""
    *_, (base, weight, _) = climb(reading, words)
    with np.errstate(invalid="ignore"):
        return base + weight


def answers(reading: Reading, words: Ints | None = None) -> Ints:
    """The length (T,) of the n-gram that gives each probability, 0 if not even a unigram does."""
    *_, (_, _, answered) = climb(reading, words)
    return answered


def spread(reading: Reading, t: int) -> Singles:
    """log10 p float32 (V,) of every word of the vocabulary in the place of word `t`."""
    draft = reading.draft
    base = np.where(draft.stored[0], draft.log10_p[0], np.float32(-np.inf))
    weight = np.zeros(len(base), np.float32)
    for n in range(2, draft.order + 1):
        context = int(reading.contexts[n - 2][t])
        if context < 0:
            break
        weight += draft.backoff[n - 2][context]
        V, keys = len(base), draft.trie.keys[n - 1]
        start, stop = np.searchsorted(keys, [context * V, (context + 1) * V])
        rows = np.arange(start, stop)[draft.stored[n - 1][start:stop]]
        words = keys[rows] % V
        base[words] = draft.log10_p[n - 1][rows]
        weight[words] = 0
    with np.errstate(invalid="ignore"):
        return base + weight


def used_context(reading: Reading) -> Ints:
    """How many words of context the model has a node for at each word, int64 (T,)."""
    used = np.zeros(len(reading.rows[0]), np.int64)
    for context in reading.contexts:
        used += context >= 0
    return used


def joint(reading: Reading, passage: Passage, length: int, silent: Mask, *, start: int, end: int) -> Singles:
    """log10 of the joint probability of the last `length` words before each word, float32 (T,).

    Each is predicted from those of them that stand before it, by at most order-1. The oldest counts as `end` (the
    number of </s>) if it is `start` (that of <s>); words that are `silent`, bool (T,), and have probability 0 are left
    out (section 11.2 of our SRILM specification).
    """
    draft = reading.draft
    levels = np.stack([base + weight for base, weight, _ in climb(reading)])
    as_end = draft.log10_p[0][end] if end >= 0 and draft.stored[0][end] else np.float32(-np.inf)
    place, total = passage.place, np.zeros(len(passage.ids), np.float32)
    for back in range(length, 0, -1):
        at = np.flatnonzero(place >= back)
        depth = np.minimum(length, place[at]) - back
        value = levels[np.minimum(depth, draft.order - 1), at - back]
        opening = (depth == 0) & (passage.ids[at - back] == start)
        value = np.where(opening, as_end, np.where(np.isneginf(value) & silent[at - back], np.float32(0), value))
        total[at] += value
    return total


def joint_of_rows(draft: "Draft", n: int, *, start: int, end: int) -> Singles:
    """The same for the words of every row of order n: log10 of their joint probability, float32 (m_n,).

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
