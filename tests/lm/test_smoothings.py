"""Smoothings that are fitted to counts: Kneser-Ney where it can be fitted, and what it says where it cannot."""

import numpy as np
import pytest

from placerec.errors import LanguageModelError
from placerec.lm import SMOOTHINGS, count_ngrams, estimate, smoothing
from placerec.lm.check import context_sums
from placerec.lm.discounts import (
    counts_of_counts,
    good_turing_factors,
    kneser_ney_discount,
    left_neighbour_counts,
    modified_kneser_ney_discounts,
)
from placerec.lm.smoothings import SRILM_OPTIONS


def zipf_text(words: int = 300, tokens: int = 6000) -> list[list[str]]:
    """Text in which some words are rare and few pairs come twice: what Kneser-Ney was made for."""
    generator = np.random.default_rng(1)
    rank = np.minimum(generator.zipf(1.3, tokens), words) - 1
    return [[f"w{i}" for i in rank[start : start + 20]] for start in range(0, tokens, 20)]


@pytest.mark.parametrize("name", SMOOTHINGS)
def test_every_smoothing_sums_to_one_on_natural_counts(name: str) -> None:
    counts = count_ngrams(zipf_text(), 3)
    model = estimate(counts, smoothing(name))
    for n, _, sums in context_sums(model):
        assert np.abs(sums - 1).max() < 2e-5, n
    assert SRILM_OPTIONS.keys() == set(SMOOTHINGS)


def test_kneser_ney_counts_left_neighbours() -> None:
    # "a b" three times and "c b" once: b follows 2 words, a and c one each (a follows <s> and itself: 2).
    counts = count_ngrams([["a", "b"], ["a", "b"], ["a", "a", "b"], ["c", "b"]], 2)
    event = ~counts.trie.vocabulary.mask(["<s>", "<unk>"])
    changed = left_neighbour_counts(counts, 1, event)
    found = dict(zip(changed.trie.texts(1), changed.counts[0].tolist(), strict=True))
    assert found == {"a": 2, "b": 2, "c": 1, "</s>": 1, "<s>": 4, "<unk>": 0}


def test_discounts_by_hand() -> None:
    assert kneser_ney_discount(6, 2) == pytest.approx(0.6)
    # y = 6 / (6 + 2 * 2) = 0.6; D1 = 1 - 2 * 0.6 * 2 / 6, D2 = 2 - 3 * 0.6 * 1 / 2, D3 = 3 - 4 * 0.6 * 1 / 1.
    assert modified_kneser_ney_discounts(6, 2, 1, 1) == pytest.approx((0.6, 1.1, 0.6))


def test_good_turing_by_hand() -> None:
    # n1 = 10, n2 = 4, n3 = 2: A = 3 * 2 / 10 = 0.6; r1 = 0.8, f1 = 0.2 / 0.4; r2 = 0.75, f2 = 0.15 / 0.4.
    factors, warnings = good_turing_factors(np.array([0, 10, 4, 2]), 2)
    assert factors == pytest.approx([1.0, 0.5, 0.375])
    assert warnings == []
    assert good_turing_factors(np.array([0, 0, 4, 2]), 2) == (
        None,
        ["warning: no singleton counts", "GT discounting disabled"],
    )


def test_counts_of_counts_leave_out_what_is_no_event() -> None:
    counts = count_ngrams([["a", "b"], ["a", "c"]], 2)
    event = ~counts.trie.vocabulary.mask(["<s>", "<unk>"])
    # a and </s> twice, b and c once; <s> is no event.
    assert counts_of_counts(counts, 1, 3, event, np.zeros(len(event), np.int64)).tolist() == [0, 2, 2, 0]


@pytest.mark.parametrize("name", [name for name in SMOOTHINGS if "kneser-ney" in name])
def test_kneser_ney_says_why_it_fails(name: str) -> None:
    counts = count_ngrams([["a", "b", "a", "b"]], 2, vocabulary=["a", "b"], markers=False)
    with pytest.raises(LanguageModelError) as error:
        estimate(counts, smoothing(name), non_events=["</s>"])
    assert str(error.value) == (
        "Kneser-Ney fails at order 1: it needs n-grams seen once, twice and more; there are n1 = 2, n2 = 0, n3 = 0,"
        " n4 = 0; closed vocabularies of few words are like that; use witten-bell"
    )


def test_absolute_takes_at_most_a_whole_count() -> None:
    with pytest.raises(LanguageModelError, match=r"delta 1\.5 must be a number above 0 and at most 1"):
        smoothing("absolute", 1.5)
