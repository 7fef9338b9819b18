"""Models as look-up tables: the answers of a Draft, and when there can be no such tables."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from placerec.lm import count_ngrams, estimate, smoothing
from placerec.lm.draft import Draft, drafts_of
from placerec.lm.lookup import Entries, build_lookup
from placerec.lm.passage import Passage, answers, look_up, look_up_others, read_passage

texts = st.lists(st.lists(st.sampled_from("abcd"), min_size=1, max_size=8), min_size=1, max_size=5)


def entries_of(draft: Draft, n: int, *, pieces: int = 2) -> list[Entries]:
    """What is stored of order n, last row first."""
    rows = np.flatnonzero(draft.stored[n - 1])[::-1]
    words, log10_p, node, backoff = draft.trie.matrix(n), draft.log10_p[n - 1], draft.node[n - 1], draft.backoff[n - 1]
    return [Entries(words[its], log10_p[its], node[its], backoff[its]) for its in np.array_split(rows, pieces)]


@given(texts, texts, st.integers(1, 4))
def test_the_answers_are_those_of_the_draft(one: list[list[str]], other: list[list[str]], order: int) -> None:
    model = estimate(count_ngrams(one, order, vocabulary="abcd"), smoothing("witten-bell"))
    (draft,) = drafts_of([model], ["<s>", "<unk>"])
    vocabulary = draft.trie.vocabulary
    sentences = [["<s>", *words, "x", *words, "</s>"] for words in other]
    ids = vocabulary.ids([word for words in sentences for word in words])
    first = np.array([place == 0 for words in sentences for place in range(len(words))])
    reading = read_passage(draft, Passage(ids, first, ~first))
    lookup = build_lookup(len(vocabulary), [entries_of(draft, n) for n in range(1, order + 1)])
    assert lookup is not None
    digits = lookup.digits(ids)
    contexts = lookup.contexts(digits, np.flatnonzero(first))
    log10_p, answered = lookup.find(contexts, digits)
    np.testing.assert_array_equal(log10_p, look_up(reading))
    np.testing.assert_array_equal(answered, answers(reading))
    for word in range(len(vocabulary)):
        words = np.full(len(ids), word)
        found, _ = lookup.find(contexts, lookup.digits(words))
        np.testing.assert_array_equal(found, look_up_others(reading, words))


def entries(*ngrams: list[int], weighted: bool = True) -> list[Entries]:
    m = len(ngrams)
    ones = np.ones(m, np.float32)
    return [Entries(np.array(ngrams, np.int64).reshape(m, -1), -ones, np.full(m, weighted), -ones)]


def test_numbers_beyond_the_vocabulary_are_not_listed() -> None:
    lookup = build_lookup(2, [entries([0], [1]), entries([1, 1])])
    assert lookup is not None
    assert lookup.digits(np.array([-1, 0, 1, 2, 7])).tolist() == [0, 1, 2, 0, 0]


def test_some_models_need_a_draft() -> None:
    unigrams = entries([0], [1])
    assert build_lookup(2, [unigrams, entries([0, 1])])
    assert build_lookup(2, [unigrams, entries([0, 1], [0, 1])]) is None
    assert build_lookup(2, [entries([0], [1], weighted=False), entries([0, 1])]) is None
    assert build_lookup(2, [entries([1]), entries([0, 1])]) is None
    assert build_lookup(2**31, [unigrams, entries([0, 1])])
    assert build_lookup(2**32, [unigrams, entries([0, 1])]) is None
