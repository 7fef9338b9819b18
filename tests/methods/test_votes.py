"""Accumulation in bins and votes, by hand and against the definitions."""

import math

import numpy as np
from helpers.training_sets import followed, training_set_of, training_sets
from hypothesis import given, strategies as st

from placerec.hohmm.filter import normalised
from placerec.methods import TrainingSet, filliat2008, pronobis2010
from placerec.methods.training_set import log_word_p

# p0 says w0, p1 says w1, ten to one.
TWO = training_set_of([[[0] * 9], [[1] * 9]], words=2)


def test_a_robot_that_stands_still_is_one_witness_a_bin() -> None:
    found = followed(pronobis2010.fit(TWO, frames=3, bins=2), [0, 0, 0, 0, 1, 1, 1])
    # The margins of the bins: ln 10; then + ln 10; + 0 in the mean of 0 and 1; - ln 10 / 3; then the next pair of bins.
    margins = np.log(10) * np.array([1, 1, 1, 2, 1, 1 - 1 / 3, -1 / 3 - 1])
    expected = [[1 / (1 + np.exp(-m)), 1 / (1 + np.exp(m))] for m in margins]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_who_is_not_sure_keeps_the_belief() -> None:
    make_stepper = pronobis2010.fit(TWO, frames=1, bins=2, confidence=2.5)
    # One word gives 2.3 nats, two of a kind 4.6, two of different kinds nothing.
    p0, p1 = [100 / 101, 1 / 101], [1 / 101, 100 / 101]
    expected = [[1 / 2, 1 / 2], p0, p0, p0, p0, p1]
    np.testing.assert_allclose(followed(make_stepper, [0, 0, 1, 0, 1, 1]), expected, rtol=1e-12)


@given(
    training=training_sets(),
    data=st.lists(st.tuples(st.integers(0, 4), st.integers(1, 7)), min_size=1, max_size=25),
    frames=st.integers(1, 4),
    bins=st.integers(1, 4),
)
def test_accumulation(training: TrainingSet, data: list[tuple[int, int]], frames: int, bins: int) -> None:
    words = [word % len(training.vocabulary) for word, _ in data]
    elapsed = [0, *[frames for _, frames in data[1:]]]
    at = np.cumsum(elapsed) // frames
    log_p = log_word_p(training)
    belief = np.full(len(training.places), 1 / len(training.places))
    expected = []
    for t in range(len(words)):
        scores = np.zeros(len(training.places))
        for b in range(at[t] - bins + 1, at[t] + 1):
            inside = [words[i] for i in range(t + 1) if at[i] == b]
            if inside:
                scores += log_p[:, inside].mean(axis=1)
        ordered = sorted(scores)
        if len(ordered) == 1 or ordered[-1] - ordered[-2] >= 0.7:
            belief = normalised(scores)
        expected.append(belief)
    found = followed(pronobis2010.fit(training, frames=frames, bins=bins, confidence=0.7), words, elapsed)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


# w0 is known to p0 alone, w1 to p0 and p1, w2 to all three, w3 to nobody.
THREE = training_set_of([[[0, 1, 2, 2]], [[1, 2]], [[2]]], words=4)


def test_what_words_vote() -> None:
    rare, common = math.log(3), math.log(3 / 2)
    expected = [[rare, 0.0, 0.0], [common, common, 0.0], [0.0] * 3, [0.0] * 3]
    np.testing.assert_allclose(filliat2008.word_votes(THREE), expected, rtol=1e-15)


def test_votes_are_counted_until_one_place_is_clear() -> None:
    rare, common = np.log(3), np.log(3 / 2)
    found = followed(filliat2008.fit(THREE, quality=0.5), [2, 1, 1, 0, 1, 0, 3])
    # Nobody voted; two are even; p0 is clear; the next votes do not count until p0 is clear again.
    votes = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0], *[[rare + 2 * common, 2 * common, 0]] * 2])
    votes = np.concatenate([votes, [[rare + common, common, 0]] * 2])
    np.testing.assert_allclose(found, votes / votes.sum(axis=1, keepdims=True), rtol=1e-12)


def test_a_decision_is_made_after_so_many_words_at_the_latest() -> None:
    found = followed(filliat2008.fit(THREE, most=2), [1, 1, 0, 1, 1])
    even, p0 = [0.5, 0.5, 0.0], [1.0, 0.0, 0.0]
    expected = [even, even, p0, p0, even]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
