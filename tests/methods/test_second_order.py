"""A place that depends on the two before it: against the sum over all paths, and by hand."""

import itertools

import numpy as np
import pytest
from helpers.training_sets import followed, training_set_of, training_sets
from hypothesis import given, settings, strategies as st

from placerec.arrays import Floats
from placerec.errors import ModelError
from placerec.hohmm import filter_stream, learned_transition
from placerec.methods import TrainingSet, second_order


def log10_emissions(training: TrainingSet, words: list[int]) -> Floats:
    names = [f"w{w}" for w in words]
    return np.stack([model.score(names) for model in training.models.values()], axis=1)


def step_p(training: TrainingSet, before: int, now: int, then: int) -> float:
    """From a place that was entered from `before`: by the formulas of the module."""
    assert training.steps is not None
    assert training.triples is not None
    C = len(training.places)
    row = [(int(training.steps[now, d]) + 1 / C) / (int(training.steps[now].sum()) + 1) for d in range(C)]
    if then == now:
        return row[now]
    after = training.triples[before, now]
    return (1 - row[now]) * (int(after[then]) + row[then] / (1 - row[now])) / (int(after.sum()) + 1)


def by_enumeration(training: TrainingSet, words: list[int], elapsed: list[int]) -> Floats:
    """The belief at the last word: over all paths through the frames, and all places before them."""
    C = len(training.places)
    log10_p = log10_emissions(training, words)
    at = np.cumsum(elapsed).tolist()
    belief = np.zeros(C)
    for path in itertools.product(range(C), repeat=at[-1] + 1):
        seen = 10.0 ** sum(log10_p[i, path[frame]] for i, frame in enumerate(at))
        for previous in range(C):
            if previous == path[0]:
                continue
            before, p = previous, 1.0
            for now, then in itertools.pairwise(path):
                p *= step_p(training, before, now, then)
                before = now if then != now else before
            belief[path[-1]] += p * seen
    belief /= belief.sum()
    return belief


@given(training=training_sets(places=3).filter(lambda training: len(training.places) > 1), data=st.data())
@settings(max_examples=25)
def test_all_paths(training: TrainingSet, data: st.DataObject) -> None:
    words = data.draw(st.lists(st.integers(0, len(training.vocabulary) - 1), min_size=1, max_size=4))
    elapsed = [0, *data.draw(st.lists(st.sampled_from([1, 1, 2]), min_size=len(words) - 1, max_size=len(words) - 1))]
    found = followed(second_order.fit(training), words, elapsed)
    np.testing.assert_allclose(found[-1], by_enumeration(training, words, elapsed), rtol=1e-9)


@given(training=training_sets().filter(lambda training: len(training.places) > 1))
def test_steps_lead_somewhere(training: TrainingSet) -> None:
    stay, change = second_order.pair_transitions(training)
    different = ~np.eye(len(stay), dtype=bool)
    np.testing.assert_allclose((stay + change.sum(axis=2))[different], 1, rtol=1e-12)


def test_without_any_triple_it_is_the_first_order() -> None:
    rng = np.random.default_rng(3)
    steps, nothing = rng.integers(0, 30, (3, 3)), np.zeros((3, 3, 3), np.int64)
    training = training_set_of([[rng.integers(0, 5, 30).tolist()] for _ in range(3)], 5, steps=steps, triples=nothing)
    words = rng.integers(0, 5, 60).tolist()
    expected = filter_stream(log10_emissions(training, words), learned_transition(steps)).belief
    np.testing.assert_allclose(followed(second_order.fit(training), words), expected, rtol=1e-9)


def test_where_one_goes_depends_on_where_one_came_from() -> None:
    """p0 and p3 lead to the corridor p1; who came from p0 goes on to p2, who came from p3 back to it."""
    steps = np.array([[50, 9, 0, 0], [0, 50, 9, 9], [0, 0, 50, 0], [0, 9, 0, 50]])
    triples = np.zeros((4, 4, 4), np.int64)
    triples[0, 1, 2] = triples[3, 1, 3] = 9
    # w2 says p2 or p3, alike.
    sentences = [[[0] * 30], [[1] * 30], [[2] * 30], [[3] * 15, [2] * 30]]
    training = training_set_of(sentences, 4, order=1, steps=steps, triples=triples)
    from_p0 = followed(second_order.fit(training), [0, 0, 0, 1, 1, 1, 2])[-1]
    from_p3 = followed(second_order.fit(training), [3, 3, 3, 1, 1, 1, 2])[-1]
    assert from_p0[2] > 0.9
    assert from_p3[3] > 0.8


def test_a_model_of_sentences_does_not_tell_what_follows_what() -> None:
    with pytest.raises(ModelError, match="train it on token streams"):
        second_order.fit(training_set_of([[[0]], [[0]]], 1))
