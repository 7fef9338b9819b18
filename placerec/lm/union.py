"""Several models as one table: one look-up per order answers for all of them, in a text or word by word.

The numbers are those of `BackoffModel.score`, to the last bit: the same float64 sums in the same order.
"""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.lm.backoff import BackoffModel
from placerec.lm.row_index import RowIndex
from placerec.lm.trie import Trie, Vocabulary, build_trie, endings, runs

# Words that are looked up together: the work space stays in cache, and memory does not grow with the text.
CHUNK = 1 << 16
# Up to so many possible n-grams of one order a table of them all finds a row; beyond, a hash table.
DIRECT = 1 << 20


@dataclass(frozen=True)
class ModelUnion:
    """C models over the n-grams of all of them; make one with `unite_models`.

    `log10_p[n-1]` float64 (m_n, C): of every n-gram under every model, by back-off where the model does not list it.
    `backoff[n-1]` float64 (m_n, C): log10 weights, 0 where the n-gram is no context of the model; none of order N.
    """

    trie: Trie
    log10_p: tuple[Floats, ...] = field(repr=False)
    backoff: tuple[Floats, ...] = field(repr=False)

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of each of T words after those before it: empty first context, no markers.

        Raises KeyError for a word that is not listed.
        """
        index = self.trie.vocabulary.index
        ids = np.fromiter(map(index.__getitem__, words), np.int64, len(words))
        scores = np.empty((len(ids), self.log10_p[0].shape[1]))
        for start in range(0, len(ids), CHUNK):
            before = max(0, start - self.trie.order + 1)
            scores[start : start + CHUNK] = self._score(ids[before : start + CHUNK])[start - before :]
        return scores

    def _score(self, ids: Ints) -> Floats:
        """log10 p (t, C) of word numbers (t,); the first word has no context."""
        row, best, answered = ids, ids.copy(), np.ones(len(ids), np.int8)
        contexts = []
        for n in range(2, self.trie.order + 1):
            context = np.full(len(ids), -1, np.int64)
            context[1:] = row[:-1]
            contexts.append(context)
            known = np.flatnonzero(context >= 0)
            row = np.full(len(ids), -1, np.int64)
            row[known] = self._find[n - 2](context[known] * len(self.trie.vocabulary) + ids[known])
            found = row >= 0
            np.copyto(best, row + self._starts[n - 1], where=found)
            np.copyto(answered, np.int8(n), where=found)
        scores = self._all_log10_p.take(best, axis=0)
        for k, context in enumerate(contexts, start=1):
            # Words that only a shorter context answers pay for this one; -1 is the row of those that do not.
            context[answered > k] = -1
            scores += self._padded_backoff[k - 1].take(context, axis=0)
        return scores

    @cached_property
    def _starts(self) -> Ints:
        """Where the rows of each order begin in `_all_log10_p`."""
        return np.cumsum([0] + [len(keys) for keys in self.trie.keys])

    @cached_property
    def _all_log10_p(self) -> Floats:
        return np.concatenate(self.log10_p)

    @cached_property
    def _padded_backoff(self) -> list[Floats]:
        return [np.concatenate([weights, np.zeros((1, weights.shape[1]))]) for weights in self.backoff]

    @cached_property
    def _find(self) -> list[Callable[[Ints], Ints]]:
        """Per order from 2 what finds the rows of keys."""
        sizes = [len(keys) * len(self.trie.vocabulary) for keys in self.trie.keys]
        return [
            _direct(keys, size) if size <= DIRECT else RowIndex(keys).find
            for keys, size in zip(self.trie.keys[1:], sizes[:-1], strict=True)
        ]

    def follow(self) -> Callable[[str], list[float]]:
        """A function to be asked for each word of a text in turn: its C values of `score`; KeyError as there.

        Constant memory: it remembers where the last N-1 words stand.
        """
        index, keys = self.trie.vocabulary.index, [keys.data for keys in self.trie.keys]
        V, longest = len(index), self.trie.order - 1
        contexts: list[int] = []  # Rows of the last 1, 2, ... words, -1 where they are not listed.

        def score(word: str) -> list[float]:
            nonlocal contexts
            number = index[word]
            rows, answered = [number], 1
            for n, context in enumerate(contexts, start=2):
                row = -1
                if context >= 0:
                    wanted, listed = context * V + number, keys[n - 1]
                    at = bisect_left(listed, wanted)
                    if at < len(listed) and listed[at] == wanted:
                        row, answered = at, n
                rows.append(row)
            scores: list[float] = self.log10_p[answered - 1][rows[answered - 1]].tolist()
            for k in range(answered, len(contexts) + 1):
                if contexts[k - 1] >= 0:
                    weights = self.backoff[k - 1][contexts[k - 1]].tolist()
                    scores = [p + weight for p, weight in zip(scores, weights, strict=True)]
            contexts = rows[:longest]
            return scores

        return score


def _direct(keys: Ints, size: int) -> Callable[[Ints], Ints]:
    """What finds the places of keys below `size` by a table of all of them."""
    table = np.full(size, -1, np.int64)
    table[keys] = np.arange(len(keys))
    return table.take


def unite_models(models: Sequence[BackoffModel]) -> ModelUnion:
    """One table of C models; a word that a model does not list has -inf under it."""
    trie = _united([_closed(model.trie) for model in models])
    log10_p, backoff = _columns(trie, models)
    for n in range(2, trie.order + 1):
        lower = log10_p[n - 2][trie.suffixes[n - 1]] + backoff[n - 2][trie.prefix(n)]
        log10_p[n - 1] = np.where(np.isnan(log10_p[n - 1]), lower, log10_p[n - 1])
    return ModelUnion(trie, tuple(log10_p), tuple(backoff))


def _closed(trie: Trie) -> Trie:
    """The trie with all endings of its n-grams."""
    if trie.closed:
        return trie
    groups = [trie.matrix(n) for n in range(1, trie.order + 1)]
    return build_trie(trie.vocabulary, trie.order, [*groups, *(end for group in groups for end in endings(group))])[0]


def _united(tries: Sequence[Trie]) -> Trie:
    """The trie of all n-grams of all `tries`."""
    vocabulary = Vocabulary.of(word for trie in tries for word in trie.vocabulary.words)
    words = [vocabulary.ids(trie.vocabulary.words) for trie in tries]
    keys, rows = [np.arange(len(vocabulary))], words
    for n in range(2, max(trie.order for trie in tries) + 1):
        # Numbers grow in the order of the text in every trie, so that each one's keys stay sorted.
        wanted = [
            row[trie.prefix(n)] * len(vocabulary) + word[trie.word(n)] if n <= trie.order else np.zeros(0, np.int64)
            for trie, word, row in zip(tries, words, rows, strict=True)
        ]
        keys.append(runs(np.sort(np.concatenate(wanted)))[0])
        rows = [np.searchsorted(keys[-1], key) for key in wanted]
    return Trie(vocabulary, tuple(keys))


def _columns(trie: Trie, models: Sequence[BackoffModel]) -> tuple[list[Floats], list[Floats]]:
    """Per order (m_n, C): the log10 p that models list, nan where they do not (-inf for words); backoff weights."""
    log10_p = [np.full((len(keys), len(models)), np.nan) for keys in trie.keys]
    backoff = [np.zeros((len(keys), len(models))) for keys in trie.keys[:-1]]
    log10_p[0][:] = -np.inf
    for c, model in enumerate(models):
        word = row = trie.vocabulary.ids(model.words)
        for n in range(1, model.order + 1):
            if n > 1:
                row = trie.find(n, row[model.trie.prefix(n)], word[model.trie.word(n)])
            log10_p[n - 1][row, c] = model.log10_ps[n - 1]
            if n < model.order:
                backoff[n - 1][row, c] = np.nan_to_num(model.backoffs[n - 1].astype(np.float64), neginf=-np.inf)
    return log10_p, backoff
