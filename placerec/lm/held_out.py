"""Weights of Jelinek-Mercer smoothing, from sentences that are held out in turn.

F. Jelinek and R. Mercer, "Interpolated estimation of Markov source parameters from sparse data", 1980: p(w | h) is
l c(hw) / c(h) + (1 - l) p(w | h'), with one weight l for all contexts that were seen about as often. The weights are
those under which each sentence is most probable to the counts of the others, found by EM, order by order from the
shortest, and drawn to 1/2 as by one word more.
"""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.lm.counts import NgramCounts, numbered, occurrences
from placerec.lm.stored_text import StoredText
from placerec.lm.trie import per_context
from placerec.lm.vocabulary import SENTENCE_END, UNKNOWN

# Contexts seen once, 2 or 3 times, 4 to 7 times, and so on.
BINS = 32
_STEPS, _CLOSE_ENOUGH = 200, 1e-6


def bins_of(total: Floats) -> Ints:
    """Which weight is that of contexts seen `total` >= 1 times (m,)."""
    return np.minimum(np.log2(np.maximum(total, 1)), BINS - 1).astype(np.int64)


def held_out_weights(counts: NgramCounts, n: int, predictable: Mask, sentences: Sequence[Sequence[str]]) -> Floats:
    """The weights of order n, float64 (BINS,), above 0 and below 1; 1/2 where no sentence tells.

    `counts` are those of the sentences together; `predictable` bool (V,): the words that are predicted.
    """
    trie = counts.trie
    index, ends = trie.vocabulary.index, trie.vocabulary.index.get(SENTENCE_END)
    text = StoredText()
    markers = ends is not None and bool(counts.counts[0][ends] > 0)
    for tokens, lengths in numbered(sentences, lambda word: index.get(word, index[UNKNOWN]), markers):
        text.add(tokens, lengths)
    rows, visits, ids = _rows(text, counts, n)
    predicted = predictable[ids]
    p = np.full(int(predicted.sum()), 1 / max(1, int(predictable.sum())))
    weights = np.full(BINS, 0.5)
    for k in range(1, n + 1):
        ratio, size, known = _held_out(counts, k, predictable, rows[k - 1][predicted], visits[predicted])
        bins = bins_of(size)
        weights = _fitted(ratio[known], p[known], bins[known])
        weight = weights[bins]
        p = np.where(known, weight * ratio + (1 - weight) * p, p)
    return weights


def _rows(text: StoredText, counts: NgramCounts, n: int) -> tuple[list[Ints], Ints, Ints]:
    """For all words (T,) of a text the rows of the n-grams of orders 1 to n that end there, -1 where there is none.

    And the number of the sentence (T,), and the words' numbers (T,).
    """
    rows: list[list[Ints]] = [[np.zeros(0, np.int64)] for _ in range(n)]
    sentences, ids, before = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], 0
    for block, found in occurrences(text, counts.trie):
        for k, (position, row) in enumerate(found[:n], start=1):
            ending = np.full(len(block.ids), -1, np.int64)
            ending[position + k - 1] = row
            rows[k - 1].append(ending)
        sentences.append(before + np.repeat(np.arange(len(block.lengths)), block.lengths))
        ids.append(block.ids.astype(np.int64))
        before += len(block.lengths)
    return [np.concatenate(parts) for parts in rows], np.concatenate(sentences), np.concatenate(ids)


def _held_out(
    counts: NgramCounts, k: int, predictable: Mask, rows: Ints, sentences: Ints
) -> tuple[Floats, Floats, Mask]:
    """Of words (T,) after their contexts of k-1 words: the share that they have in the other sentences, float64 (T,).

    And how often the contexts were seen in all sentences, float64 (T,), and whether the others have them, bool (T,).
    """
    trie = counts.trie
    contexts = trie.prefix(k) if k > 1 else np.zeros(len(trie.keys[0]), np.int64)
    there = rows >= 0
    row, sentence = rows[there], sentences[there]
    count = counts.counts[k - 1].astype(np.float64)
    events = predictable[trie.word(k)]
    total = per_context(contexts[events], int(contexts.max(initial=0)) + 1, count[events])[contexts[row]]
    left = total - _own(sentence, contexts[row])
    ratio, size, known = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows), bool)
    ratio[there] = np.maximum(count[row] - _own(sentence, row), 0) / np.maximum(left, 1)
    size[there], known[there] = total, left > 0
    return ratio, size, known


def _own(sentence: Ints, row: Ints) -> Floats:
    """How often the sentence (m,) of each row (m,) has that row."""
    keys = sentence * (int(row.max(initial=0)) + 1) + row
    _, inverse, often = np.unique(keys, return_inverse=True, return_counts=True)
    own: Floats = often[inverse].astype(np.float64)
    return own


def _fitted(ratio: Floats, lower: Floats, bins: Ints) -> Floats:
    """The weights (BINS,) of two parts of a mixture, given what each gives the words (T,), by EM."""
    weights = np.full(BINS, 0.5)
    size = np.bincount(bins, minlength=BINS) + 1.0
    for _ in range(_STEPS):
        weight = weights[bins]
        own = weight * ratio
        taken = np.bincount(bins, own / (own + (1 - weight) * lower), BINS)
        before, weights = weights, (taken + 0.5) / size
        if np.abs(weights - before).max() < _CLOSE_ENOUGH:
            break
    return weights
