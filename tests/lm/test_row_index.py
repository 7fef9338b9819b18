"""The hash table: many numbers at once, one at a time, and the numbers again."""

import numpy as np
from hypothesis import given, settings, strategies as st

from placerec.lm.row_index import RowIndex

whole_numbers = st.integers(0, 9) | st.integers(-(2**63), 2**63 - 1)


@settings(max_examples=50, deadline=None)
@given(st.lists(whole_numbers, max_size=300), st.lists(whole_numbers, max_size=50))
def test_an_index_finds_what_is_there_and_nothing_else(keys: list[int], others: list[int]) -> None:
    index = RowIndex(np.array(keys, np.int64))
    assert [keys[place] for place in index.find(np.array(keys, np.int64)).tolist()] == keys
    found = index.find(np.array(others, np.int64)).tolist()
    assert all(keys[place] == key if key in keys else place == -1 for key, place in zip(others, found, strict=True))
    assert index.distinct == (len(set(keys)) == len(keys))


@settings(max_examples=50, deadline=None)
@given(st.sets(whole_numbers, max_size=300), st.lists(whole_numbers, max_size=50))
def test_single_numbers_are_found_where_many_are(keys: set[int], others: list[int]) -> None:
    index = RowIndex(np.array([*keys], np.int64))
    find, every = index.finder(), [*keys, *others]
    assert [find(number) for number in every] == index.find(np.array(every, np.int64)).tolist()
    assert index.keys().tolist() == [*keys]


def test_an_index_of_many_numbers_finds_each() -> None:
    keys = np.random.default_rng(0).permutation(100_000) * 7919
    index = RowIndex(keys)
    assert index.distinct
    np.testing.assert_array_equal(index.find(keys), np.arange(len(keys)))
    np.testing.assert_array_equal(index.keys(), keys)
    assert (index.find(keys + 1) == -1).all()
    find = index.finder()
    assert [find(key) for key in keys[::97].tolist()] == list(range(len(keys)))[::97]
    assert not RowIndex(np.append(keys, keys[:1])).distinct


def test_an_index_of_one_number_many_times_finds_it() -> None:
    index = RowIndex(np.full(5000, 7))
    assert not index.distinct
    assert index.find(np.array([7, 8])).tolist() in [[place, -1] for place in range(5000)]
