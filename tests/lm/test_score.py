"""Scoring whole texts, single words, all words at once and several models at once, beside a plain walk."""

from collections.abc import Sequence

import numpy as np
import pytest
from helpers.mutable_models import mutable_models
from hypothesis import given, settings, strategies as st

from placerec.arrays import Ints
from placerec.lm import BackoffModel, count_ngrams, estimate, score, smoothing, with_unigrams
from placerec.lm.backoff import unite_models
from placerec.lm.mutable import MutableModel
from placerec.lm.score import (
    Contexts,
    Ngrams,
    ScoreTables,
    TokenSequence,
    Values,
    build_regular_tables,
    build_tables,
    joint_log10_p,
)

WORDS = list("abcde")
texts = st.lists(st.sampled_from(WORDS), max_size=40)
corpora = st.lists(st.lists(st.lists(st.sampled_from(WORDS), max_size=8), max_size=4), min_size=1, max_size=4)
names = st.sampled_from(["witten-bell", "lidstone-backoff", "absolute"])
# The last keeps trigrams of which it drops the ending: tables that are not closed.
minima = st.sampled_from([(1,), (1, 1, 2), (1, 2, 1)])
# The largest code that is allowed: none, or so small that rows stand for n-grams from some order on.
limits = st.sampled_from([1 << 62, 300, 30])


def models_of(
    corpus: list[list[list[str]]],
    orders: list[int],
    name: str = "witten-bell",
    minimum: tuple[int, ...] = (1,),
    *,
    markers: bool = False,
) -> list[BackoffModel]:
    return [
        estimate(
            count_ngrams(sentences, order, vocabulary=WORDS, markers=markers),
            smoothing(name),
            min_count=minimum,
            non_events=[] if markers else ["</s>"],
        )
        for sentences, order in zip(corpus, orders, strict=False)
    ]


def walked(model: BackoffModel, words: Sequence[str], kind: type[np.floating]) -> tuple[np.floating, int]:
    """log10 p of the last word, and the length of the n-gram that answers: n-gram by n-gram, in the order of sums."""
    p, weights = {}, {}
    for n in range(1, model.order + 1):
        columns = model.trie.texts(n), model.log10_probs[n - 1].tolist(), model.backoffs[n - 1].tolist()
        for text, log10_p, backoff in zip(*columns, strict=True):
            p[tuple(text.split())] = log10_p
            weights[tuple(text.split())] = 0.0 if np.isnan(backoff) else backoff
    ngram = tuple(words[-model.order :])
    paid: list[np.floating] = []
    while ngram and ngram not in p:
        paid.insert(0, kind(weights.get(ngram[:-1], 0.0)))
        ngram = ngram[1:]
    found = kind(p.get(ngram, -np.inf))
    if kind is np.float32:
        return found + np.sum(paid, dtype=kind), len(ngram)
    for weight in paid:
        found += weight
    return found, len(ngram)


def tables_of(model: BackoffModel) -> tuple[ScoreTables, MutableModel]:
    """The model's tables in float32, and the mutable that they are made of."""
    (mutable,) = mutable_models([model], ["<s>", "<unk>"])
    return mutable.tables(np.arange(len(mutable.trie.vocabulary)), len(mutable.trie.vocabulary)), mutable


def sequence_of(mutable: MutableModel, sentences: list[list[str]]) -> TokenSequence:
    words = [["<s>", *sentence, "</s>"] for sentence in sentences]
    first = [place == 0 for sentence in words for place in range(len(sentence))]
    ids = mutable.trie.vocabulary.ids([word for sentence in words for word in sentence])
    return TokenSequence(ids, np.array(first, bool), ~np.array(first, bool))


def looked_up(tables: ScoreTables, sequence: TokenSequence) -> tuple[Values, Ints]:
    digits = tables.digits(sequence.ids)
    contexts = Contexts(tables, digits, np.flatnonzero(sequence.first))
    log10_p, answered = tables.find(contexts, digits)
    return log10_p, answered.astype(np.int64)


@settings(max_examples=60, deadline=None)
@given(corpora, texts, st.lists(st.integers(1, 4), min_size=4, max_size=4), names, minima, limits)
def test_models_alone_together_and_word_by_word_score_as_a_plain_walk_does(
    corpus: list[list[list[str]]], text: list[str], orders: list[int], name: str, minimum: tuple[int, ...], limit: int
) -> None:
    models = models_of(corpus, orders, name, minimum)
    expected = np.array([[walked(model, text[: t + 1], np.float64)[0] for model in models] for t in range(len(text))])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(score, "_MOST_CODES", limit)
        united = unite_models(models)
        assert np.array_equal(np.array([model.score(text) for model in models]).T.reshape(expected.shape), expected)
    assert np.array_equal(united.score(text).reshape(expected.shape), expected)
    follow = united.follow()
    assert np.array_equal(np.array([follow(word) for word in text]).reshape(expected.shape), expected)


@settings(max_examples=40, deadline=None)
@given(corpora, corpora, st.integers(1, 4), names, limits)
def test_single_precision_sums_weights_first(
    one: list[list[list[str]]], others: list[list[list[str]]], order: int, name: str, limit: int
) -> None:
    (model,) = models_of(one[:1], [order], name, markers=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(score, "_MOST_CODES", limit)
        tables, mutable = tables_of(model)
    sentences = [*others[0], ["a", "nothing", "b"]]
    sequence = sequence_of(mutable, sentences)
    log10_p, answered = looked_up(tables, sequence)
    marked = [["<s>", *sentence, "</s>"] for sentence in sentences]
    expected = [walked(model, words[: t + 1], np.float32) for words in marked for t in range(len(words))]
    assert log10_p.dtype == np.float32
    assert (log10_p.tolist(), answered.tolist()) == ([float(p) for p, _ in expected], [n for _, n in expected])


@settings(max_examples=30, deadline=None)
@given(corpora, texts, st.integers(1, 4), limits)
def test_distributions_hold_every_word_in_a_place(
    corpus: list[list[list[str]]], text: list[str], order: int, limit: int
) -> None:
    models = models_of(corpus, [order] * 4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(score, "_MOST_CODES", limit)
        every = [tables_of(models[0])[0], unite_models(models).tables]
    for tables in every:
        digits = tables.digits(tables_of(models[0])[1].trie.vocabulary.ids([*text, "nothing", "a"]))
        contexts = Contexts(tables, digits, np.array([0, len(text) // 2]))
        columns = [tables.find(contexts, np.full(len(digits), word + 1))[0] for word in range(tables.V)]
        for t in range(len(digits)):
            assert np.array_equal(tables.distribution(contexts, t), np.array([column[t] for column in columns]))


def test_answers_are_the_lengths_of_what_is_listed() -> None:
    (model,) = models_of([[["a", "b"]]], [3], markers=True)
    tables, mutable = tables_of(model)
    sequence = sequence_of(mutable, [["a", "b", "d", "c"]])
    sequence.ids[3] = -1
    log10_p, answered = looked_up(tables, sequence)
    assert answered.tolist() == [1, 2, 3, 0, 1, 1]
    assert np.isneginf(log10_p[3])
    contexts = Contexts(tables, tables.digits(sequence.ids), np.array([0]))
    assert contexts.lengths.tolist() == [0, 1, 2, 2, 0, 0]


def test_no_context_reaches_over_the_start_of_a_sequence() -> None:
    (model,) = models_of([[["a", "b"], ["b", "a"]]], [3], markers=True)
    tables, mutable = tables_of(model)
    ids = mutable.trie.vocabulary.ids(["a", "b", "a", "b"])
    log10_p, _ = looked_up(tables, TokenSequence(ids, np.array([True, False, True, False]), np.ones(4, bool)))
    assert log10_p[:2].tolist() == log10_p[2:].tolist()
    assert log10_p[0] == np.float32(model.log10_p("a"))


def test_contexts_without_a_probability_of_their_own_are_paid_for_and_do_not_answer() -> None:
    ones = np.ones(2, np.float32)
    pairs = Ngrams(np.array([[0, 1], [1, 0]]), -ones / 2, ones / 8, np.array([True, True]), np.array([True, False]))
    triples = Ngrams(np.array([[1, 0, 1]]), -ones[:1] / 4, ones[:1], np.array([False]))
    tables = build_tables(
        2, [[Ngrams(np.array([[0], [1]]), -ones, ones / 4, np.array([True, True]))], [pairs], [triples]]
    )
    digits = np.array([2, 1, 1, 1, 2])
    contexts = Contexts(tables, digits, np.array([0]))
    log10_p, answered = tables.find(contexts, digits)
    assert answered.tolist() == [1, 1, 1, 1, 2]
    # b; a after b, which is a context only; a after "b a", which is one too; a after a; and "a b".
    assert log10_p.tolist() == [-1, -1 + 1 / 4, -1 + 1 / 4 + 1 / 8, -1 + 1 / 4, -1 / 2]
    assert tables.distribution(contexts, 1).tolist() == [-1 + 1 / 4, -1 + 1 / 4]


@pytest.mark.parametrize("chunk", [1, 3, 7])
def test_long_texts_are_scored_in_pieces(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    corpus = [[[WORDS[i] for i in rng.integers(5, size=60)]] for _ in range(3)]
    text = [WORDS[i] for i in rng.integers(5, size=50)]
    models = models_of(corpus, [4, 3, 4])
    expected = unite_models(models).score(text)
    monkeypatch.setattr(score, "CHUNK", chunk)
    assert np.array_equal(unite_models(models).score(text), expected)


def test_words_that_only_one_model_lists_are_impossible_for_the_other() -> None:
    one, other = models_of([[["a", "b"]], [["b", "a"]]], [2, 2])
    united = unite_models([with_unigrams(one, ["z"]), other])
    assert united.score(["a", "z"])[1].tolist() == [-np.inf, -np.inf]
    with pytest.raises(KeyError, match="nothing"):
        united.score(["nothing"])
    with pytest.raises(KeyError, match="nothing"):
        united.follow()("nothing")


def test_joint_probabilities_of_recent_words() -> None:
    (model,) = models_of([[["a", "b", "c"], ["a", "c"]]], [3], markers=True)
    tables, mutable = tables_of(model)
    index, sequence = mutable.trie.vocabulary.index, sequence_of(mutable, [["a", "b", "c"]])
    silent = ~mutable.predictable[sequence.ids]
    two = joint_log10_p(tables, sequence, 2, silent, start=index["<s>"], end=index["</s>"])
    end = model.log10_p("</s>")
    assert two[1] == pytest.approx(end)
    assert two[2] == pytest.approx(end + model.log10_p("a", ["<s>"]))
    assert two[4] == pytest.approx(model.log10_p("b") + model.log10_p("c", ["b"]))


def ngrams(*listed: list[int], weighted: bool = True) -> list[Ngrams]:
    m = len(listed)
    ones = np.ones(m, np.float32)
    return [Ngrams(np.array(listed, np.int64).reshape(m, -1), -ones, -ones, np.full(m, weighted))]


def test_numbers_beyond_the_vocabulary_are_not_listed() -> None:
    tables = build_tables(2, [ngrams([0], [1]), ngrams([1, 1])])
    assert tables.digits(np.array([-1, 0, 1, 2, 7])).tolist() == [0, 1, 2, 0, 0]


@pytest.mark.parametrize("limit", [1 << 62, 5])
def test_only_regular_models_get_tables_at_once(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(score, "_MOST_CODES", limit)
    unigrams = ngrams([0], [1])
    assert build_regular_tables(2, [unigrams, ngrams([0, 1])])
    assert build_regular_tables(2, [unigrams, [*ngrams([0, 1]), *ngrams([1, 1])], [], []])
    assert build_regular_tables(2, [unigrams, ngrams([0, 1], [0, 1])]) is None
    assert build_regular_tables(2, [ngrams([0], [1], weighted=False), ngrams([0, 1])]) is None
    assert build_regular_tables(2, [ngrams([1]), ngrams([0, 1])]) is None


@pytest.mark.parametrize("V", [2**31, 2**40])
def test_large_vocabularies_have_long_ngrams_too(V: int) -> None:
    words = [0, V - 1, 5, V // 2]
    orders = [
        ngrams([0], [V - 1], [5], [V // 2]),
        ngrams(words[:2], words[1:3], words[2:]),
        ngrams(words[:3], words[1:]),
        ngrams(words),
    ]
    digits = np.array(words) + 1
    tables = build_regular_tables(V, orders)
    assert tables is not None
    log10_p, answered = tables.find(Contexts(tables, digits, np.zeros(1, np.int64)), digits)
    assert answered.tolist() == [1, 2, 3, 4]
    assert log10_p.tolist() == [-1] * 4
