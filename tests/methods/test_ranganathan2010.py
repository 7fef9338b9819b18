"""Change points: against the sum over all ways to cut a sequence and to name its segments."""

import itertools
from itertools import pairwise

import numpy as np
import pytest
from helpers.training_sets import followed, training_set_of, training_sets
from hypothesis import given, settings, strategies as st

from placerec.arrays import Floats, Ints
from placerec.methods import TrainingSet, ranganathan2010
from placerec.methods.training_set import log_word_p


def polya(words: list[int], alpha: Floats) -> float:
    """The probability of a segment's words, one after the other."""
    p = 1.0
    for i, word in enumerate(words):
        p *= (words[:i].count(word) + alpha[word]) / (i + alpha.sum())
    return p


def by_enumeration(words: list[int], elapsed: list[int], alphas: Floats, hazard: float) -> Floats:
    """The belief in each place after the last word."""
    T, C = len(words), len(alphas)
    belief = np.zeros(C)
    for cuts in itertools.product([False, True], repeat=T - 1):
        begins = [0, *(t for t in range(1, T) if cuts[t - 1])]
        p_cuts = 1.0
        for t in range(1, T):
            same = (1 - hazard) ** elapsed[t]
            p_cuts *= 1 - same if cuts[t - 1] else same
        segments = [words[a:b] for a, b in pairwise([*begins, T])]
        for places in itertools.product(range(C), repeat=len(segments)):
            p = p_cuts / C ** len(segments)
            for segment, c in zip(segments, places, strict=True):
                p *= polya(segment, alphas[c])
            belief[places[-1]] += p
    belief /= belief.sum()
    return belief


@given(
    training=training_sets(places=3), data=st.data(), concentration=st.sampled_from([1.0, 50.0]), unknown=st.booleans()
)
@settings(max_examples=40)
def test_all_ways_to_cut(training: TrainingSet, data: st.DataObject, concentration: float, unknown: bool) -> None:
    V = len(training.vocabulary)
    words = data.draw(st.lists(st.integers(0, V - 1), min_size=1, max_size=5))
    elapsed = [0, *data.draw(st.lists(st.integers(1, 40), min_size=len(words) - 1, max_size=len(words) - 1))]
    alphas = concentration * np.exp(log_word_p(training))
    if unknown:
        alphas = np.concatenate([alphas, np.full((1, V), concentration / V)])
    make_stepper = ranganathan2010.fit(training, concentration=concentration, unknown=unknown)
    found = followed(make_stepper, words, elapsed)
    hazard = ranganathan2010.hazard(training)
    for t in range(len(words)):
        expected = by_enumeration(words[: t + 1], elapsed, alphas, hazard)
        np.testing.assert_allclose(found[t], expected, rtol=1e-9)


def world(seed: int = 0) -> tuple[TrainingSet, Ints]:
    rng = np.random.default_rng(seed)
    likely = rng.dirichlet(np.full(20, 0.3), 3)
    training = training_set_of([[rng.choice(20, 200, p=p).tolist()] for p in likely], 20)
    return training, np.concatenate([rng.choice(20, 40, p=likely[c]) for c in (0, 1, 2)])


def test_few_beginnings_are_enough() -> None:
    training, words = world()
    every = followed(ranganathan2010.fit(training, most=1000), words.tolist())
    kept = followed(ranganathan2010.fit(training, most=30), words.tolist())
    np.testing.assert_allclose(kept, every, atol=0.01)
    right = every.argmax(axis=1) == np.repeat([0, 1, 2], 40)
    assert right.mean() > 0.8


def test_what_is_like_no_place_is_unknown() -> None:
    training, words = world()
    strange = np.flatnonzero(training.counts.sum(axis=0) <= np.median(training.counts.sum(axis=0)))
    new = np.random.default_rng(1).choice(strange, 40)
    found = followed(ranganathan2010.fit(training, unknown=True), [*words.tolist(), *new.tolist()])
    assert found.shape == (160, 4)
    assert (found[10:120, 3] > 0.5).mean() < 0.1
    assert (found[130:, 3] > 0.5).all()


def test_how_often_a_segment_ends_is_counted() -> None:
    steps = np.array([[90, 3], [2, 55]])
    assert ranganathan2010.hazard(training_set_of([[], []], 1, steps=steps)) == pytest.approx(6 / 300)
    assert ranganathan2010.hazard(training_set_of([[], []], 1)) == pytest.approx(1 / 150)
