"""Which n-grams there are, with their prefixes and endings."""

import numpy as np
from hypothesis import given, settings, strategies as st

from placerec.arrays import Ints
from placerec.lm.trie import build_trie, closed_trie, endings
from placerec.lm.vocabulary import Vocabulary


@settings(max_examples=50, deadline=None)
@given(st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=4), max_size=20))
def test_closed_tries_list_prefixes_and_endings(ngrams: list[list[int]]) -> None:
    vocabulary = Vocabulary.of("abcde")
    groups: list[Ints] = [np.array([ngram], np.int64) for ngram in sorted(ngrams, key=len)]
    trie, rows = closed_trie(vocabulary, 4, groups)
    assert trie.closed
    plain, _ = build_trie(vocabulary, 4, [*groups, *(end for group in groups for end in endings(group))])
    for n in range(4):
        np.testing.assert_array_equal(trie.keys[n], plain.keys[n])
    for group, its in zip(groups, rows, strict=True):
        assert trie.matrix(group.shape[1])[its[-1][0]].tolist() == group[0].tolist()
