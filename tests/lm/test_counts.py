"""Counting: against plain loops, for any order and vocabulary."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from hypothesis import given, settings, strategies as st

from placerec import reference
from placerec.lm import NgramCounts, count_ngrams, format_counts
from placerec.lm.counts import count_text, recomputed, tabulate
from placerec.lm.stored_text import StoredText
from placerec.lm.vocabulary import Vocabulary

sentences_of_words = st.lists(st.lists(st.sampled_from(["a", "b", "c", "d"]), max_size=8), max_size=6)


def as_counter(counts: NgramCounts) -> Counter[tuple[str, ...]]:
    found: Counter[tuple[str, ...]] = Counter()
    for n in range(1, counts.order + 1):
        for text, count in zip(counts.trie.texts(n), counts.counts[n - 1].tolist(), strict=True):
            if count:
                found[tuple(text.split(" "))] = count
    return found


@given(sentences_of_words, st.integers(1, 9))
def test_counts_are_those_of_the_plain_twin(sentences: list[list[str]], order: int) -> None:
    counts = count_ngrams(sentences, order, markers=False)
    assert as_counter(counts) == reference.count(sentences, order)


@given(sentences_of_words)
def test_markers_are_counted_around_each_sentence(sentences: list[list[str]]) -> None:
    marked = [["<s>", *sentence, "</s>"] for sentence in sentences if sentence]
    assert as_counter(count_ngrams(sentences, 3)) == reference.count(marked, 3)


@settings(max_examples=10)
@given(st.integers(0, 2**32))
def test_windows_too_wide_for_one_number_are_counted_too(seed: int) -> None:
    # 3000 words and order 9 need 104 bits, so a window is packed into two columns.
    generator = np.random.default_rng(seed)
    vocabulary = [f"w{i:04d}" for i in range(3000)]
    sentences = [[vocabulary[i] for i in generator.choice(3000, 40)] for _ in range(5)]
    sentences += [sentences[0][:20]] * 2
    counts = count_ngrams(sentences, 9, vocabulary=vocabulary, markers=False)
    assert as_counter(counts) == reference.count(sentences, 9)


def test_words_outside_a_closed_vocabulary_are_unknown() -> None:
    counts = count_ngrams([["a", "x", "b"]], 2, vocabulary=["a", "b"], markers=False)
    assert as_counter(counts) == {
        ("a",): 1, ("<unk>",): 1, ("b",): 1, ("a", "<unk>"): 1, ("<unk>", "b"): 1,
    }  # fmt: skip


def test_markers_in_the_text_are_not_doubled() -> None:
    given_markers = count_ngrams([["<s>", "a", "</s>"]], 2)
    assert as_counter(given_markers) == as_counter(count_ngrams([["a"]], 2))


def test_counts_file_puts_extensions_behind_their_prefix() -> None:
    counts = count_ngrams([["a-b", "a"], ["a", "b"]], 2, markers=False)
    # A word's extensions come before the next word, even where bytes would sort otherwise ("a b" > "a-b").
    assert format_counts(counts) == "a\t2\na b\t1\na-b\t1\na-b a\t1\nb\t1\n"


def test_recomputed_counts_are_the_sums_of_their_extensions() -> None:
    counts = count_ngrams([["a", "b", "a", "b"], ["b"]], 3, markers=False)
    # Trigrams "a b a" and "b a b"; what nothing extends keeps its count.
    assert as_counter(recomputed(counts)) == Counter(
        {("a",): 1, ("b",): 1, ("a", "b"): 1, ("b", "a"): 1, ("a", "b", "a"): 1, ("b", "a", "b"): 1}
    )


def test_recomputed_counts_leave_out_what_is_not_counted() -> None:
    counts = tabulate(Vocabulary.of(["a", "b"]), 2, [np.array([[0, 1]])], [np.array([5])])
    hidden = replace(
        counts, seen=(np.array([True, True]), np.zeros(1, bool)), counts=(np.array([2, 3]), counts.counts[1])
    )
    assert recomputed(hidden).counts[0].tolist() == [2, 3]
    assert recomputed(replace(hidden, seen=(hidden.seen[0], np.ones(1, bool)))).counts[0].tolist() == [5, 3]


def test_nothing_to_count() -> None:
    counts = count_ngrams([], 3, vocabulary=["a"], markers=False)
    assert as_counter(counts) == {}
    assert not counts.seen[0].any()


@contextmanager
def little_memory() -> Iterator[None]:
    """Blocks of a few words, of which hardly one is held in memory, and runs that are merged at once."""
    with (
        patch("placerec.lm.stored_text.BLOCK", 5),
        patch("placerec.lm.counts.BLOCK", 5),
        patch("placerec.lm.stored_text.IN_MEMORY", 8),
        patch("placerec.lm.stored_text.WAITING", 3),
    ):
        yield


def same(one: NgramCounts, other: NgramCounts) -> bool:
    groups = (one.trie.keys, one.counts, one.seen), (other.trie.keys, other.counts, other.seen)
    assert [array.dtype for group in groups[0] for array in group] == [a.dtype for group in groups[1] for a in group]
    return one.trie.vocabulary == other.trie.vocabulary and all(
        np.array_equal(a, b) for x, y in zip(*groups, strict=True) for a, b in zip(x, y, strict=True)
    )


# Orders above 15 need more bits than one number has.
@given(sentences_of_words, st.integers(1, 40), st.sampled_from([None, (), ("a", "b")]), st.booleans())
def test_little_memory_changes_nothing(
    sentences: list[list[str]], order: int, vocabulary: tuple[str, ...] | None, markers: bool
) -> None:
    expected = count_ngrams(sentences, order, vocabulary=vocabulary, markers=markers)
    with little_memory():
        assert same(count_ngrams(iter(sentences), order, vocabulary=vocabulary, markers=markers), expected)


def stored(sentences: list[list[int]], weights: list[float], dtype: type) -> StoredText:
    text = StoredText()
    for sentence, weight in zip(sentences, weights, strict=True):
        text.add(np.array(sentence, np.int64), np.array([len(sentence)]), np.array([weight], dtype))
    return text


weighted_sentences = st.lists(
    st.tuples(st.lists(st.integers(0, 300), max_size=8), st.sampled_from([0.0, 0.1, 0.7, 3.0, 1e9])), max_size=12
)


@given(weighted_sentences, st.integers(1, 9), st.booleans())
def test_weights_are_added_up_in_the_order_of_the_text(
    weighted: list[tuple[list[int], float]], order: int, fractional: bool
) -> None:
    sentences = [sentence for sentence, _ in weighted]
    weights = [weight if fractional else int(weight) for _, weight in weighted]
    words = Vocabulary.of(f"{i:03d}" for i in range(301))
    expected: dict[tuple[str, ...], float] = {}
    for sentence, weight in zip(sentences, weights, strict=True):
        for ngram, times in reference.count([[words.words[i] for i in sentence]], order).items():
            for _ in range(times):
                expected[ngram] = expected.get(ngram, 0) + weight
    with little_memory():
        text = stored(sentences, weights, float if fractional else int)
        counts = count_text(text, order, words, fractional=fractional)
    found = {}
    for n in range(1, order + 1):
        rows = np.flatnonzero(counts.seen[n - 1])
        texts = counts.trie.texts(n)
        found.update({tuple(texts[row].split(" ")): counts.counts[n - 1][row] for row in rows})
    assert found == expected


def test_a_text_is_gone_through_again_and_again() -> None:
    generator = np.random.default_rng(0)
    pieces = [generator.integers(0, 10**size, 7) for size in (1, 9, 3, 1, 5)]
    with little_memory():
        text = StoredText()
        for piece in pieces:
            text.add(piece, np.array([3, 0, 4]))
            assert next(iter(text)).ids.tolist() == pieces[0].tolist()
        for _ in range(2):
            assert np.concatenate([block.ids for block in text]).tolist() == np.concatenate(pieces).tolist()
            assert np.concatenate([block.lengths for block in text]).tolist() == [3, 4] * 5
    assert text.tokens == 35


def test_real_counts_without_weights_are_the_whole_ones() -> None:
    text = StoredText()
    text.add(np.array([0, 1, 0]), np.array([3]))
    counts = count_text(text, 2, Vocabulary.of("ab"), fractional=True)
    assert [count.dtype for count in counts.counts] == [float, float]
    assert as_counter(counts) == {("a",): 2, ("b",): 1, ("a", "b"): 1, ("b", "a"): 1}
