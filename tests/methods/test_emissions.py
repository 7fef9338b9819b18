"""Systems that give the filter other probabilities of words: against slow versions, and against an ARPA file."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import VOCABULARY, write_tokens
from helpers.training_sets import training_set_of, training_sets
from helpers.typed_commands import done
from hypothesis import given, strategies as st

from placerec.arrays import Floats
from placerec.hohmm import Emissions
from placerec.methods import TrainingSet, decode, dubois2011, mtd, wu2009
from placerec.methods.tables import count_pairs
from placerec.model import ModelOptions, train_lm

FITS: tuple[Callable[[TrainingSet], Emissions], ...] = (wu2009.fit, dubois2011.fit, mtd.fit)
# What an ARPA file keeps of a logarithm.
ROUNDED = 1e-6


def lidstone(visits: Sequence[Sequence[int]], word: int, V: int, context: tuple[int, int] | None = None) -> float:
    """(c + 1) / (N + V), of a word alone or `context` = (lag, word) before it."""
    if context is None:
        after = [w for visit in visits for w in visit]
    else:
        lag, first = context
        after = [visit[i] for visit in visits for i in range(lag, len(visit)) if visit[i - lag] == first]
    return (after.count(word) + 1) / (len(after) + V)


@pytest.mark.parametrize("fit", FITS)
@given(training=training_sets(), data=st.data())
def test_probabilities_sum_to_1_and_streams_agree(
    fit: Callable[[TrainingSet], Emissions], training: TrainingSet, data: st.DataObject
) -> None:
    words = data.draw(st.lists(st.sampled_from(training.vocabulary), max_size=8))
    emissions = fit(training)
    every = np.array([emissions.score([*words, word])[-1] for word in training.vocabulary])
    np.testing.assert_allclose((10**every).sum(axis=0), 1, atol=ROUNDED * 10)
    follow = emissions.follow()
    expected = emissions.score(words)
    assert expected.shape == (len(words), len(training.places))
    for word, row in zip(words, expected, strict=True):
        np.testing.assert_allclose(follow(word), row, rtol=1e-13)


@given(training=training_sets())
def test_wu2009_is_one_word_at_a_time(training: TrainingSet) -> None:
    V = len(training.vocabulary)
    visits = [[visit.tolist() for visit in place] for place in training.sentences]
    expected = [[lidstone(place, w, V) for place in visits] for w in range(V)]
    np.testing.assert_allclose(10 ** wu2009.fit(training).score(training.vocabulary), expected, rtol=ROUNDED * 10)


@pytest.mark.parametrize("extra", [(), ("--smooth",), ("--per", "second"), ("--transition", "learned")])
@pytest.mark.parametrize("delta", [None, 0.3])
def test_wu2009_is_order_1_to_the_byte(extra: tuple[str, ...], delta: float | None, tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens")
    runs = [tokens / "run1.tsv", tokens / "run2.tsv"]
    train_lm(runs, tmp_path / "model", options=ModelOptions(1, "lidstone-backoff", delta), as_in_paper=True)
    args = ("decode", tokens, "-m", tmp_path / "model", *extra)
    for out, method in (("a", ()), ("b", ("--method", "wu2009"))):
        done(*args, *method, "-o", tmp_path / out)
    for name in ("run1.tsv", "run2.tsv", "run3.tsv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_wu2009_does_not_depend_on_the_models(tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens")
    runs = [tokens / "run1.tsv", tokens / "run2.tsv"]
    train_lm(runs, tmp_path / "one", options=ModelOptions(1, "lidstone-backoff"), as_in_paper=True)
    train_lm(runs, tmp_path / "two", options=ModelOptions(2, "witten-bell"), as_in_paper=True)
    [expected] = decode([tokens / "run3.tsv"], tmp_path / "one")
    [found] = decode([tokens / "run3.tsv"], tmp_path / "two", method="wu2009")
    np.testing.assert_array_equal(found.belief, expected.belief)
    assert set(found.words) <= set(VOCABULARY)


@given(training=training_sets(), data=st.data())
def test_dubois2011(training: TrainingSet, data: st.DataObject) -> None:
    V = len(training.vocabulary)
    ids = data.draw(st.lists(st.integers(0, V - 1), min_size=1, max_size=6))
    visits = [[visit.tolist() for visit in place] for place in training.sentences]
    expected = [[lidstone(place, w, V, (1, ids[t - 1]) if t else None) for place in visits] for t, w in enumerate(ids)]
    found = dubois2011.fit(training).score([f"w{w}" for w in ids])
    np.testing.assert_allclose(10**found, expected, rtol=1e-12)


def mixture(visits: Sequence[Sequence[int]], weights: Sequence[float], words: Sequence[int], V: int) -> float:
    """P of the last word after those before it, by the formula."""
    *context, word = words
    alone = lidstone(visits, word, V)
    p = weights[0] * alone
    for lag, weight in enumerate(weights[1:], start=1):
        first = context[-lag] if lag <= len(context) else None
        after = Counter(
            visit[i]
            for visit in visits
            for i in range(lag, len(visit))
            if first is not None and visit[i - lag] == first
        )
        p += weight * (after[word] / after.total() if after else alone)
    return p


@given(training=training_sets(), data=st.data())
def test_mtd_is_the_mixture(training: TrainingSet, data: st.DataObject) -> None:
    V = len(training.vocabulary)
    ids = data.draw(st.lists(st.integers(0, V - 1), min_size=1, max_size=6))
    weights = mtd.mixture_weights(training, [count_pairs(training, lag) for lag in (1, 2, 3)])
    visits = [[visit.tolist() for visit in place] for place in training.sentences]
    expected = [
        [mixture(place, row, ids[: t + 1], V) for place, row in zip(visits, weights.tolist(), strict=True)]
        for t in range(len(ids))
    ]
    np.testing.assert_allclose(10 ** mtd.fit(training).score([f"w{w}" for w in ids]), expected, rtol=1e-12)


def test_mtd_leaves_each_word_out_of_what_predicts_it() -> None:
    # 0 1 0 1 0 2: without itself, the last word is 1/2 + 0/2 after 0 (seen twice before 1), 1 of its kind alone.
    training = training_set_of([[[0, 1, 0, 1, 0, 2]]], words=3)
    parts = mtd.left_out_parts(training, [count_pairs(training, 1), count_pairs(training, 2)], 0)
    alone = [3 / 8, 2 / 8, 3 / 8, 2 / 8, 3 / 8, 1 / 8]
    # After 0: 1, 1, 2. After 1: 0, 0. Two apart, after 0: 0, 0; after 1: 1, 2.
    lag_1 = [alone[0], 1 / 2, 1 / 1, 1 / 2, 1 / 1, 0]
    lag_2 = [alone[0], alone[1], 1 / 1, 0, 1 / 1, 0]
    np.testing.assert_allclose(parts, np.transpose([alone, lag_1, lag_2]), rtol=1e-15)


def slow_em(parts: Floats, steps: int) -> list[float]:
    k = parts.shape[1]
    weights = [1 / k] * k
    for _ in range(steps):
        shares = [1.0] * k
        for row in parts.tolist():
            whole = sum(w * p for w, p in zip(weights, row, strict=True))
            shares = [s + w * p / whole for s, w, p in zip(shares, weights, row, strict=True)]
        weights = [s / (len(parts) + k) for s in shares]
    return weights


@given(st.lists(st.lists(st.floats(0.01, 1), min_size=3, max_size=3), max_size=30))
def test_em_rises_and_is_em(rows: list[list[float]]) -> None:
    parts = np.array(rows).reshape(-1, 3)
    weights, found = mtd.best_weights(parts)
    assert all(b >= a - 1e-9 for a, b in pairwise(found))
    assert math.isclose(weights.sum(), 1)
    np.testing.assert_allclose(weights, slow_em(parts, len(found) - 1 if len(found) < mtd.STEPS else mtd.STEPS))


def test_mtd_finds_the_lag_that_tells() -> None:
    """A word repeats what stood two words before; the one just before says nothing."""
    rng = np.random.default_rng(0)
    visit = rng.integers(0, 6, 2).tolist()
    for _ in range(600):
        visit.append(visit[-2] if rng.random() < 0.8 else int(rng.integers(6)))
    training = training_set_of([[visit]], words=6)
    weights = mtd.mixture_weights(training, [count_pairs(training, lag) for lag in (1, 2, 3)])
    assert weights[0].argmax() == 2
    assert weights[0, 2] > 0.8
