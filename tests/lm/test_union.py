"""Several models as one table: the numbers of each model, to the last bit, in one go and word by word."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing, union, with_unigrams
from placerec.lm.union import unite_models

WORDS = list("abcde")
texts = st.lists(st.sampled_from(WORDS), max_size=40)
corpora = st.lists(st.lists(st.lists(st.sampled_from(WORDS), max_size=8), max_size=4), min_size=1, max_size=4)
names = st.sampled_from(["witten-bell", "lidstone-backoff", "absolute"])
# The last keeps trigrams of which it drops the ending: tables that are not closed.
minima = st.sampled_from([(1,), (1, 1, 2), (1, 2, 1)])


def models_of(
    corpus: list[list[list[str]]], orders: list[int], name: str = "witten-bell", minimum: tuple[int, ...] = (1,)
) -> list[BackoffModel]:
    return [
        estimate(
            count_ngrams(sentences, order, vocabulary=WORDS, markers=False),
            smoothing(name),
            min_count=minimum,
            non_events=["</s>"],
        )
        for sentences, order in zip(corpus, orders, strict=False)
    ]


@settings(max_examples=60)
@given(corpora, texts, st.lists(st.integers(1, 4), min_size=4, max_size=4), names, minima)
def test_the_union_scores_as_each_model_does(
    corpus: list[list[list[str]]], text: list[str], orders: list[int], name: str, minimum: tuple[int, ...]
) -> None:
    models = models_of(corpus, orders, name, minimum)
    united = unite_models(models)
    expected = np.stack([model.score(text) for model in models], axis=1)
    assert np.array_equal(united.score(text), expected)
    follow = united.follow()
    assert np.array_equal(np.array([follow(word) for word in text]).reshape(expected.shape), expected)


@pytest.mark.parametrize(("chunk", "direct"), [(1, 1 << 20), (3, 0), (7, 1 << 20)])
def test_long_texts_are_scored_in_pieces(chunk: int, direct: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    corpus = [[[WORDS[i] for i in rng.integers(5, size=60)]] for _ in range(3)]
    text = [WORDS[i] for i in rng.integers(5, size=50)]
    models = models_of(corpus, [4, 3, 4])
    expected = np.stack([model.score(text) for model in models], axis=1)
    monkeypatch.setattr(union, "CHUNK", chunk)
    monkeypatch.setattr(union, "DIRECT", direct)
    assert np.array_equal(unite_models(models).score(text), expected)


def test_words_that_only_one_model_lists_are_impossible_for_the_other() -> None:
    one, other = models_of([[["a", "b"]], [["b", "a"]]], [2, 2])
    united = unite_models([with_unigrams(one, ["z"]), other])
    assert united.score(["a", "z"])[1].tolist() == [-np.inf, -np.inf]
    with pytest.raises(KeyError, match="nothing"):
        united.score(["nothing"])
    with pytest.raises(KeyError, match="nothing"):
        united.follow()("nothing")
