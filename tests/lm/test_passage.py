"""Running text against a model: the fast walk, the walk step by step, all words at once, and joint probabilities."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec.arrays import Ints
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.lm.draft import Draft, drafts_of
from placerec.lm.gather import trie_of
from placerec.lm.passage import (
    Passage,
    answers,
    joint,
    joint_of_rows,
    look_up,
    look_up_others,
    read_passage,
    spread,
    used_context,
)
from placerec.lm.row_index import RowIndex
from placerec.lm.trie import Vocabulary, build_trie, endings

texts = st.lists(st.lists(st.sampled_from("abcd"), min_size=1, max_size=8), min_size=1, max_size=5)


def trained(sentences: list[list[str]], order: int = 3) -> tuple[BackoffModel, Draft]:
    model = estimate(count_ngrams(sentences, order, vocabulary="abcd"), smoothing("witten-bell"))
    (draft,) = drafts_of([model], ["<s>", "<unk>"])
    return model, draft


def passage_of(draft: Draft, sentences: list[list[str]]) -> Passage:
    words = [["<s>", *sentence, "</s>"] for sentence in sentences]
    first = [place == 0 for sentence in words for place in range(len(sentence))]
    ids = draft.trie.vocabulary.ids([word for sentence in words for word in sentence])
    return Passage(ids, np.array(first), ~np.array(first))


@settings(max_examples=30, deadline=None)
@given(texts, texts, st.integers(1, 4))
def test_a_passage_scores_as_its_sentences_one_by_one(one: list[list[str]], other: list[list[str]], order: int) -> None:
    model, draft = trained(one, order)
    passage = passage_of(draft, other)
    reading = read_passage(draft, passage)
    expected = np.concatenate([model.score(["<s>", *sentence, "</s>"]) for sentence in other])
    log10_p = look_up(reading)
    np.testing.assert_allclose(log10_p, expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(log10_p, look_up_others(reading, passage.ids))
    np.testing.assert_array_equal(answers(reading), answers(reading, passage.ids))
    for t in range(len(passage.ids)):
        every = spread(reading, t)
        assert every[passage.ids[t]] == log10_p[t]
        others = np.full(len(passage.ids), t % len(every))
        assert look_up_others(reading, others)[t] == every[t % len(every)]


def test_answers_are_the_lengths_of_what_is_listed() -> None:
    _, draft = trained([["a", "b"]])
    passage = passage_of(draft, [["a", "b", "d", "c"]])
    passage.ids[3] = -1
    reading = read_passage(draft, passage)
    assert answers(reading).tolist() == [1, 2, 3, 0, 1, 1]
    assert np.isneginf(look_up(reading)[3])
    assert used_context(reading).tolist() == [0, 1, 2, 2, 0, 0]


def test_no_context_reaches_over_the_start_of_a_sequence() -> None:
    model, draft = trained([["a", "b"], ["b", "a"]])
    ids = draft.trie.vocabulary.ids(["a", "b", "a", "b"])
    passage = Passage(ids, np.array([True, False, True, False]), np.ones(4, bool))
    log10_p = look_up(read_passage(draft, passage))
    assert log10_p[:2].tolist() == log10_p[2:].tolist()
    assert log10_p[0] == np.float32(model.log10_p("a"))


def test_joint_probabilities_of_recent_words() -> None:
    model, draft = trained([["a", "b", "c"], ["a", "c"]])
    index = draft.trie.vocabulary.index
    passage = passage_of(draft, [["a", "b", "c"]])
    silent = ~draft.event[passage.ids]
    reading = read_passage(draft, passage)
    two = joint(reading, passage, 2, silent, start=index["<s>"], end=index["</s>"])
    end = model.log10_p("</s>")
    assert two[1] == pytest.approx(end)
    assert two[2] == pytest.approx(end + model.log10_p("a", ["<s>"]))
    assert two[4] == pytest.approx(model.log10_p("b") + model.log10_p("c", ["b"]))
    rows = draft.trie.find(2, index["a"] + np.zeros(1, np.int64), index["b"] + np.zeros(1, np.int64))
    of_rows = joint_of_rows(draft, 2, start=index["<s>"], end=index["</s>"])
    assert of_rows[rows[0]] == pytest.approx(model.log10_p("a") + model.log10_p("b", ["a"]))


whole_numbers = st.integers(0, 9) | st.integers(-(2**63), 2**63 - 1)


@settings(max_examples=50, deadline=None)
@given(st.lists(whole_numbers, max_size=300), st.lists(whole_numbers, max_size=50))
def test_an_index_finds_what_is_there_and_nothing_else(keys: list[int], others: list[int]) -> None:
    index = RowIndex(np.array(keys, np.int64))
    assert [keys[place] for place in index.find(np.array(keys, np.int64)).tolist()] == keys
    found = index.find(np.array(others, np.int64)).tolist()
    assert all(keys[place] == key if key in keys else place == -1 for key, place in zip(others, found, strict=True))
    assert index.distinct == (len(set(keys)) == len(keys))


def test_an_index_of_many_numbers_finds_each() -> None:
    keys = np.random.default_rng(0).permutation(100_000) * 7919
    index = RowIndex(keys)
    assert index.distinct
    np.testing.assert_array_equal(index.find(keys), np.arange(len(keys)))
    assert (index.find(keys + 1) == -1).all()
    assert not RowIndex(np.append(keys, keys[:1])).distinct


def test_an_index_of_one_number_many_times_finds_it() -> None:
    index = RowIndex(np.full(5000, 7))
    assert not index.distinct
    assert index.find(np.array([7, 8])).tolist() in [[place, -1] for place in range(5000)]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=4), max_size=20))
def test_gathering_lists_prefixes_and_endings(ngrams: list[list[int]]) -> None:
    vocabulary = Vocabulary.of("abcde")
    groups: list[Ints] = [np.array([ngram], np.int64) for ngram in sorted(ngrams, key=len)]
    trie, rows = trie_of(vocabulary, 4, groups)
    assert trie.closed
    plain, _ = build_trie(vocabulary, 4, [*groups, *(end for group in groups for end in endings(group))])
    for n in range(4):
        np.testing.assert_array_equal(trie.keys[n], plain.keys[n])
    for group, its in zip(groups, rows, strict=True):
        assert trie.matrix(group.shape[1])[its[-1][0]].tolist() == group[0].tolist()
