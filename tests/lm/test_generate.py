"""Text drawn from a model: reproducible, true to the probabilities, and always ending."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Singles
from placerec.lm.score import draw_word, generate

P = np.array([0.1, 0.6, 0.3])


def log_p(history: Sequence[int]) -> Singles:
    log10_p: Singles = np.log10(P).astype(np.float32)
    return log10_p


def test_the_same_seed_draws_the_same_words() -> None:
    texts = [generate(log_p, [], 0, np.random.Generator(np.random.PCG64(7)), order=1) for _ in range(2)]
    assert texts[0] == texts[1]
    assert 0 not in texts[0]


def test_words_come_as_often_as_they_are_probable() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    drawn = np.bincount([draw_word(P, rng) for _ in range(20000)], minlength=3) / 20000
    np.testing.assert_allclose(drawn, P, atol=0.015)


def test_histories_are_as_long_as_the_model_uses_them() -> None:
    seen: list[list[int]] = []

    def spread(history: Sequence[int]) -> Singles:
        seen.append(list(history))
        log10_p: Singles = np.log10(np.array([1e-9, 0.5, 0.5])).astype(np.float32)
        return log10_p

    words = generate(spread, [2, 2], 0, np.random.Generator(np.random.PCG64(3)), order=3, longest=4)
    assert len(words) == 4
    assert seen == [[2, 2], [2, words[0]], words[0:2], words[1:3]]


def test_where_nothing_can_follow_the_text_ends() -> None:
    nothing = np.full(3, -np.inf, np.float32)
    assert generate(lambda history: nothing, [], 0, np.random.Generator(np.random.PCG64(3)), order=2) == []
