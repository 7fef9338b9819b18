"""Which n-grams there are, with their prefixes and endings."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.arrays import Ints
from placerec.lm import trie as module
from placerec.lm.trie import Trie, build_trie, closed_trie, endings, united_trie
from placerec.lm.vocabulary import Vocabulary

VOCABULARY = Vocabulary.of("abcde")
NGRAMS = st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=4), max_size=20)


def groups_of(ngrams: list[list[int]]) -> list[Ints]:
    """The n-grams, those of one length in one group, as they come."""
    return [
        np.array([ngram for ngram in ngrams if len(ngram) == n], np.int64).reshape(-1, n)
        for n in sorted({len(ngram) for ngram in ngrams})
    ]


@settings(max_examples=50, deadline=None)
@given(NGRAMS)
def test_closed_tries_list_prefixes_and_endings(ngrams: list[list[int]]) -> None:
    groups: list[Ints] = [np.array([ngram], np.int64) for ngram in sorted(ngrams, key=len)]
    trie, rows = closed_trie(VOCABULARY, 4, groups)
    assert trie.closed
    plain, _ = build_trie(VOCABULARY, 4, [*groups, *(end for group in groups for end in endings(group))])
    for n in range(4):
        np.testing.assert_array_equal(trie.keys[n], plain.keys[n])
    for group, its in zip(groups, rows, strict=True):
        assert trie.matrix(group.shape[1])[its[-1][0]].tolist() == group[0].tolist()


@settings(max_examples=100, deadline=None)
@given(NGRAMS)
def test_rows_of_prefixes_are_told_however_n_grams_are_grouped(ngrams: list[list[int]]) -> None:
    groups = groups_of(ngrams)
    trie, rows = build_trie(VOCABULARY, 4, groups)
    for group, its in zip(groups, rows, strict=True):
        for n, row in enumerate(its, start=1):
            np.testing.assert_array_equal(trie.matrix(n)[row], group[:, :n])


@settings(max_examples=50, deadline=None)
@given(NGRAMS)
def test_a_built_trie_knows_the_endings_that_another_one_looks_up(ngrams: list[list[int]]) -> None:
    trie, _ = build_trie(VOCABULARY, 4, groups_of(ngrams))
    for known, found in zip(trie.suffixes, Trie(trie.vocabulary, trie.keys).suffixes, strict=True):
        np.testing.assert_array_equal(known, found)


@settings(max_examples=50, deadline=None)
@given(NGRAMS, NGRAMS)
def test_a_united_trie_has_the_n_grams_and_endings_of_both(one: list[list[int]], other: list[list[int]]) -> None:
    narrow = Vocabulary.of("abce")
    tries = [
        closed_trie(VOCABULARY, 4, groups_of(one))[0],
        closed_trie(narrow, 3, groups_of([[min(word, 3) for word in ngram[:3]] for ngram in other]))[0],
    ]
    united, rows = united_trie(VOCABULARY, tries)
    for trie, its in zip(tries, rows, strict=True):
        for n in range(1, trie.order + 1):
            numbers = VOCABULARY.ids(trie.vocabulary.words)[trie.matrix(n)]
            np.testing.assert_array_equal(united.matrix(n)[its[n - 1]], numbers)
    for known, found in zip(united.suffixes, Trie(VOCABULARY, united.keys).suffixes, strict=True):
        np.testing.assert_array_equal(known, found)


def test_keys_that_leave_no_room_for_places_give_the_same_trie(monkeypatch: pytest.MonkeyPatch) -> None:
    ngrams = groups_of(np.random.default_rng(0).integers(0, 5, (60, 3)).tolist())
    plain, rows = build_trie(VOCABULARY, 3, ngrams)
    monkeypatch.setattr(module, "_BITS", 0)
    again, their_rows = build_trie(VOCABULARY, 3, ngrams)
    for n in range(3):
        np.testing.assert_array_equal(plain.keys[n], again.keys[n])
        np.testing.assert_array_equal(rows[0][n], their_rows[0][n])
