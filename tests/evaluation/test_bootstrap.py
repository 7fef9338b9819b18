"""Intervals and pairs: against drawing sequences one by one, and what is drawn."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.small_world import beliefs_of

from placerec.errors import EvaluationError
from placerec.evaluation.bootstrap import compare_pairs, count_blocks, draw, interval
from placerec.hohmm.beliefs import Beliefs

PLACES = ("hall", "kitchen")


def judged(name: str, truth: str, best: str) -> Beliefs:
    """A sequence from letters: h and k, a dot where unlabelled."""
    label = {"h": "hall", "k": "kitchen", ".": ""}
    belief = np.array([[1.0, 0.0] if letter == "h" else [0.0, 1.0] for letter in best])
    return beliefs_of(name, PLACES, [label[letter] for letter in truth], [label[letter] for letter in best], belief)


THREE = [judged("a", "hhkk", "hhkh"), judged("b", "..hh", "hhkh"), judged("c", "kkkk", "kkkk"), judged("d", "..", "hk")]


def test_blocks_are_sequences_with_a_label() -> None:
    frames, right, what = count_blocks(THREE)
    assert what == "sequences"
    assert frames.tolist() == [4, 2, 4]
    assert right.tolist() == [3, 1, 4]


def test_the_visits_of_a_single_sequence_are_drawn() -> None:
    frames, right, what = count_blocks([judged("a", "hhk..kkhh", "hkkhhhkhh"), THREE[3]])
    assert what == "visits"
    assert frames.tolist() == [2, 3, 2]
    assert right.tolist() == [1, 2, 2]


def test_nothing_labelled_is_refused() -> None:
    with pytest.raises(EvaluationError, match="label"):
        count_blocks([THREE[3]])


def test_draws_are_by_the_seed_and_of_as_many_blocks() -> None:
    first, again, other = (draw(5, seed, 100) for seed in (0, 0, 1))
    assert first.shape == (100, 5)
    assert (first.sum(axis=1) == 5).all()
    assert (first == again).all()
    assert (first != other).any()


def test_the_interval_is_that_of_sequences_drawn_one_by_one() -> None:
    rng = np.random.default_rng(0)
    frames = rng.integers(5, 100, 8)
    right = np.array([rng.integers(0, n + 1) for n in frames], np.float64)
    drawn = draw(8, 0, 500)
    shares = []
    for row in drawn:
        picked = [block for block, times in enumerate(row) for _ in range(times)]
        assert len(picked) == 8
        shares.append(sum(right[block] for block in picked) / sum(frames[block] for block in picked))
    assert interval(drawn, right, frames) == pytest.approx((np.quantile(shares, 0.025), np.quantile(shares, 0.975)))


def test_the_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    """Accuracies of 40 sequences around 0.7, in 200 recordings: a nominal 95 % may miss a few."""
    rng = np.random.default_rng(0)
    covered = 0
    frames = np.full(40, 50)
    for seed in range(200):
        right = 50 * np.clip(rng.normal(0.7, 0.15, 40), 0, 1)
        low, high = interval(draw(40, seed, 400), right, frames)
        covered += low <= 0.7 <= high
    assert 0.88 <= covered / 200 <= 1


def test_one_block_has_no_width() -> None:
    assert interval(draw(1, 0, 50), np.array([3.0]), np.array([4])) == (0.75, 0.75)


def test_pairs_are_judged_on_the_same_draws() -> None:
    frames = np.full(6, 10)
    hard = np.array([1.0, 9, 2, 8, 1, 9])
    right = {"worse": hard, "better": hard + 1, "equal": hard.copy(), "other": hard[::-1].copy()}
    pairs = {(pair.first, pair.second): pair for pair in compare_pairs(right, frames, draw(6, 0))}
    assert list(pairs) == [
        ("worse", "better"),
        ("worse", "equal"),
        ("worse", "other"),
        ("better", "equal"),
        ("better", "other"),
        ("equal", "other"),
    ]
    # A tenth better everywhere: certain, though either accuracy alone is anything but.
    assert pairs["worse", "better"].holds
    assert pairs["worse", "better"].difference == pytest.approx(-0.1)
    assert (pairs["worse", "better"].low, pairs["worse", "better"].high) == pytest.approx((-0.1, -0.1))
    assert not pairs["worse", "equal"].holds
    assert not pairs["better", "other"].holds
    low, high = interval(draw(6, 0), hard, frames)
    assert high - low > 0.2


def test_nothing_holds_on_fewer_than_six_blocks() -> None:
    """One method better on all blocks: of two equal ones, more than one case of 20 with five, fewer with six."""
    for blocks, holds in ((2, False), (5, False), (6, True)):
        assert (2 * 0.5**blocks < 0.05) == holds
        right = {"worse": np.full(blocks, 5.0), "better": np.full(blocks, 6.0)}
        (pair,) = compare_pairs(right, np.full(blocks, 10), draw(blocks, 0))
        assert pair.high < 0
        assert pair.holds == holds


def test_labels_decide_what_is_right_and_not_beliefs() -> None:
    one = judged("a", "hk", "hk")
    assert count_blocks([replace(one, best=("kitchen", "kitchen")), THREE[0]])[1].tolist() == [1, 3]
