"""Majority and naive Bayes, by hand."""

import numpy as np
from helpers.training_sets import followed, training_set_of

from placerec.methods import naive_bayes

# p0 saw w0 w0 w1, p1 saw w1.
LESSON = training_set_of([[[0, 0], [1]], [[1]]], words=3)


def test_the_prior_is_that_of_the_words() -> None:
    np.testing.assert_allclose(LESSON.prior, [3.5 / 5, 1.5 / 5], rtol=1e-15)


def test_majority_never_changes_its_mind() -> None:
    np.testing.assert_array_equal(followed(naive_bayes.fit_majority(LESSON), [1, 1, 2]), np.tile(LESSON.prior, (3, 1)))


def test_naive_bayes() -> None:
    # (n + 1) / (N + 3): p0 has 3/6 2/6 1/6, p1 has 1/4 2/4 1/4.
    weighed = np.array([[3 / 6, 1 / 4], [2 / 6, 2 / 4], [1 / 6, 1 / 4]]) * [3.5, 1.5]
    expected = weighed / weighed.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(followed(naive_bayes.fit(LESSON), [0, 1, 2, 0]), expected[[0, 1, 2, 0]], rtol=1e-14)
