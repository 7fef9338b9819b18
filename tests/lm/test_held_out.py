"""Weights of Jelinek-Mercer smoothing, held out sentence by sentence: beside sums by hand."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.lm import count_ngrams, estimate, smoothing
from placerec.lm.check import context_sums
from placerec.lm.held_out import bins_of, held_out_weights
from placerec.lm.text import train_ngrams

WORDS = ["a", "b", "c", "d"]
texts = st.lists(st.lists(st.sampled_from(WORDS), min_size=1, max_size=9), max_size=7)


def pairs(sentence: Sequence[str]) -> list[tuple[str, str]]:
    return [*pairwise(sentence)]


def held_out_words(sentences: list[list[str]]) -> Iterator[tuple[int, float, int, float]]:
    """For each word its context's count and the shares in other sentences: of the pair, and of the word, with N."""
    singles, contexts = Counter(w for s in sentences for w in s), Counter(h for s in sentences for h, _ in pairs(s))
    both = Counter(p for s in sentences for p in pairs(s))
    for sentence in sentences:
        own, own_both = Counter(sentence), Counter(pairs(sentence))
        own_contexts = Counter(h for h, _ in pairs(sentence))
        left = singles.total() - len(sentence)
        for i, word in enumerate(sentence):
            single = (singles[word] - own[word]) / left if left else math.nan
            if i == 0:
                yield 0, math.nan, singles.total(), single
                continue
            pair = sentence[i - 1], word
            others = contexts[pair[0]] - own_contexts[pair[0]]
            ratio = (both[pair] - own_both[pair]) / others if others else math.nan
            yield contexts[pair[0]], ratio, singles.total(), single


def objective(weight: float, words: list[tuple[float, float]]) -> float:
    """ln p of words with one imagined word of either part, half each."""
    fits = sum(math.log(weight * ratio + (1 - weight) * lower) for ratio, lower in words)
    return fits + 0.5 * math.log(weight) + 0.5 * math.log(1 - weight)


@settings(max_examples=60, deadline=None)
@given(texts)
def test_weights_make_each_sentence_most_probable_to_the_others(sentences: list[list[str]]) -> None:
    counts = count_ngrams(sentences, 2, vocabulary=WORDS, markers=False)
    predictable = ~counts.trie.vocabulary.mask(["<s>", "</s>", "<unk>"])
    one, two = (held_out_weights(counts, n, predictable, sentences) for n in (1, 2))
    words = [*held_out_words(sentences)]
    total = sum(map(len, sentences))
    singles = [(single, 1 / len(WORDS)) for _, _, _, single in words if not math.isnan(single)]
    weight = one[bins_of(np.array([total]))[0]]
    of_bin: dict[int, list[tuple[float, float]]] = {}
    for size, ratio, _, single in words:
        if not math.isnan(ratio):
            lower = 1 / len(WORDS) if math.isnan(single) else weight * single + (1 - weight) / len(WORDS)
            of_bin.setdefault(int(math.log2(size)), []).append((ratio, lower))
    for found, tried in [(weight, singles), *((two[k], its) for k, its in of_bin.items())]:
        best = objective(found, tried)
        assert all(objective(other, tried) <= best + 1e-7 for other in np.linspace(0.01, 0.99, 50).tolist())
    untold = np.ones(len(two), bool)
    untold[[*of_bin]] = False
    assert (two[untold] == 0.5).all()


@pytest.mark.parametrize("markers", [True, False])
def test_models_of_held_out_sentences_sum_to_1_and_differ_from_those_without(markers: bool) -> None:
    rng = np.random.default_rng(0)
    sentences = [[f"w{i}" for i in rng.zipf(1.5, 30) if i < 40] for _ in range(20)]
    fitted = train_ngrams(sentences, 3, smoothing="jelinek-mercer", markers=markers)
    for n, _, sums in context_sums(fitted):
        assert np.abs(sums - 1).max() < 2e-5, n
    counts = count_ngrams(sentences, 3, markers=markers)
    without = estimate(counts, smoothing("jelinek-mercer"), non_events=() if markers else ["</s>"])
    assert fitted.log10_p("w1", ["w2"]) != pytest.approx(without.log10_p("w1", ["w2"]), abs=1e-3)
    held = [[f"w{i}" for i in rng.zipf(1.5, 30) if i < 40] for _ in range(20)]
    ppl, other = fitted.perplexity(held).ppl, without.perplexity(held).ppl
    assert ppl is not None
    assert other is not None
    assert ppl < other
