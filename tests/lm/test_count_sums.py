"""Counts files read back, and counts taken away: the inverse of writing and of adding."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.errors import LanguageModelError
from placerec.lm import NgramCounts, count_ngrams, format_counts
from placerec.lm.counts import add_counts, count_texts, read_counts, subtract_counts

VOCABULARY = ("a", "b", "c", "d")
SENTENCES = st.lists(st.lists(st.sampled_from(VOCABULARY), max_size=8), max_size=6)


def count(sentences: list[list[str]], order: int, markers: bool) -> NgramCounts:
    return count_ngrams(sentences, order, vocabulary=VOCABULARY, markers=markers)


def same(first: NgramCounts, second: NgramCounts) -> bool:
    """Whether two tables hold the same n-grams, in the same rows, with the same counts."""
    pairs = [(first.trie.keys, second.trie.keys), (first.counts, second.counts), (first.seen, second.seen)]
    return first.trie.vocabulary == second.trie.vocabulary and all(
        len(a) == len(b) and all(map(np.array_equal, a, b)) for a, b in pairs
    )


@given(SENTENCES, st.integers(1, 4), st.booleans())
def test_a_counts_file_is_read_back_as_it_was(sentences: list[list[str]], order: int, markers: bool) -> None:
    counts = count(sentences, order, markers)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.counts"
        path.write_text(format_counts(counts))
        assert same(read_counts(path, counts.trie.vocabulary, order), counts)


@given(SENTENCES, SENTENCES, st.integers(1, 4), st.booleans())
def test_what_is_left_is_as_if_it_alone_had_been_counted(
    kept: list[list[str]], gone: list[list[str]], order: int, markers: bool
) -> None:
    both = add_counts(count(kept, order, markers), count(gone, order, markers))
    assert same(both, count([*kept, *gone], order, markers))
    assert same(subtract_counts(both, count(gone, order, markers)), count(kept, order, markers))


@given(st.lists(SENTENCES, max_size=4), st.integers(1, 4), st.booleans(), st.integers(1, 9))
def test_pieces_of_texts_counted_apart_are_the_counts_of_the_texts(
    texts: list[list[list[str]]], order: int, markers: bool, block: int
) -> None:
    strange = [[*text, ["a", "strange", "b"]] for text in texts]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("placerec.lm.counts.BLOCK", block)
        found = list(count_texts([*texts, *strange], order, vocabulary=VOCABULARY, markers=markers))
    assert len(found) == 2 * len(texts)
    for counts, text in zip(found, [*texts, *strange], strict=True):
        assert same(counts, count(text, order, markers))


def test_a_count_below_zero_names_the_ngram() -> None:
    total, part = count([["a", "b"], ["b", "c"]], 2, False), count([["b"], ["b", "c"], ["b", "c"]], 2, False)
    with pytest.raises(LanguageModelError, match="'b' would be left with the count -1"):
        subtract_counts(total, part)
    with pytest.raises(LanguageModelError, match="'a b' would be left with the count -1"):
        subtract_counts(count([list("ba")], 2, False), count([list("ab")], 2, False))


@pytest.mark.parametrize("line", ["a", "a\tx", "a b c\t1", "a  b\t1", "zz\t1", "\t1", "a\t1.5"])
def test_a_line_that_is_no_count_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "x.counts"
    path.write_text(f"a\t1\n{line}\n")
    with pytest.raises(LanguageModelError, match=r"x\.counts:2: .* is no n-gram of the vocabulary, of at most 2 words"):
        read_counts(path, count([], 2, False).trie.vocabulary, 2)
