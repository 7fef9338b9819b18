"""Bags of words: by hand, against the definitions, and against the filter that they become."""

from dataclasses import replace
from math import inf

import numpy as np
from helpers.training_sets import followed, training_set_of, training_sets
from hypothesis import given, strategies as st

from placerec.arrays import Floats
from placerec.hohmm import filter_stream, fixed_transition
from placerec.hohmm.filter import normalised
from placerec.methods import TrainingSet, guillaume2011
from placerec.methods.training_set import log_word_p

word_numbers = st.lists(st.integers(0, 4), min_size=1, max_size=25)
# p0 says w0, p1 says w1, ten to one.
TWO = training_set_of([[[0] * 9], [[1] * 9]], words=2)


def drawn(training: TrainingSet, words: list[int]) -> list[int]:
    return [word % len(training.vocabulary) for word in words]


@given(training=training_sets(), words=word_numbers)
def test_a_bag_that_never_changes_is_the_filter_that_never_leaves(training: TrainingSet, words: list[int]) -> None:
    words = drawn(training, words)
    even = replace(training, prior=np.full(len(training.places), 1 / len(training.places)))
    found = followed(guillaume2011.fit(even, threshold=inf), words)
    log10_p = log_word_p(training).T[words] / np.log(10)
    expected = filter_stream(log10_p, fixed_transition(len(training.places), 1.0)).belief
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def cusum(log_p: Floats, words: list[int], threshold: float) -> list[list[int]]:
    """The bags after each word: every rival's evidence, and since when, as lists."""
    places = range(len(log_p))
    bag: list[int] = []
    since: list[list[int]] = [[] for _ in places]
    evidence = [0.0 for _ in places]
    bags = []
    for word in words:
        bag = [*bag, word]
        best = int(np.argmax(log_p[:, bag].sum(axis=1)))
        for c in places:
            evidence[c] += log_p[c, word] - log_p[best, word]
            since[c] = [*since[c], word] if evidence[c] > 0 else []
            evidence[c] = max(evidence[c], 0)
        rival = int(np.argmax(evidence))
        if evidence[rival] >= threshold:
            bag, since, evidence = since[rival], [[] for _ in places], [0.0 for _ in places]
        bags.append(bag)
    return bags


@given(seed=st.integers(0, 1000), threshold=st.sampled_from([0.5, 2.0, guillaume2011.THRESHOLD]))
def test_cusum(seed: int, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    C, V = 3, 6
    likely = rng.dirichlet(np.full(V, 0.4), C)
    training = training_set_of([[rng.choice(V, 31, p=p).tolist()] for p in likely], V)
    words = np.concatenate([rng.choice(V, 12, p=likely[c]) for c in (0, 1, 2, 0)]).tolist()
    log_p = log_word_p(training)
    bags = cusum(log_p, words, threshold)
    expected = [normalised(np.log(training.prior) + log_p[:, bag].sum(axis=1)) for bag in bags]
    found = followed(guillaume2011.fit(training, threshold=threshold), words)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-12)


def test_a_change_is_noticed_after_two_words_and_the_bag_is_what_came_since() -> None:
    # A word is worth ln 10 = 2.3 nats; 4.6 are needed.
    belief = followed(guillaume2011.fit(TWO), [0] * 50 + [1] * 3)
    assert belief.argmax(axis=1).tolist() == [0] * 51 + [1] * 2
    np.testing.assert_allclose(belief[51], [1 / 101, 100 / 101], rtol=1e-12)


def test_without_a_detector_the_past_weighs_for_ever() -> None:
    assert not followed(guillaume2011.fit(TWO, threshold=inf), [0] * 50 + [1] * 40).argmax(axis=1).any()
