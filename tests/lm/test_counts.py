"""Counting: against plain loops, for any order and vocabulary."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec import reference
from placerec.lm import NgramCounts, count_ngrams, format_counts

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


def test_nothing_to_count() -> None:
    counts = count_ngrams([], 3, vocabulary=["a"], markers=False)
    assert as_counter(counts) == {}
    assert not counts.seen[0].any()
