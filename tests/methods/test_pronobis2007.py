"""The cascade of two cues: by hand, and its threshold by brute force."""

from functools import partial

import numpy as np
import pytest

from placerec.arrays import Ints
from placerec.methods.pronobis2007 import MARGINS, best_margin, cascade, fit

# Two places, three words a dictionary. The first tells little: w0 3:1, w1 1:1, w2 1:3. The second tells more.
FIRST = np.array([0, 0, 0, 1, 2, 0, 1, 2, 2, 2])
SECOND = np.array([0, 0, 0, 0, 1, 2, 2, 2, 2, 1])
TRUTH = np.repeat([0, 1], 5)


def never() -> int:
    raise AssertionError("the second cue was asked")


def test_a_sure_first_cue_answers_alone() -> None:
    """Add-one: p(w0) is 4/8 in place 0 and 2/8 in place 1, so the beliefs are 2/3 and 1/3, the lead 1/3."""
    answer = cascade([FIRST, SECOND], TRUTH, [3, 3], 2, 0.33)(0, never)
    np.testing.assert_allclose(answer.belief, [2 / 3, 1 / 3])
    assert not answer.consulted


def test_an_unsure_one_asks_the_second_and_adds_what_it_says() -> None:
    """The second: p(w0) is 5/8 in place 0 and 1/8 in place 1; times 4/8 and 2/8 that is 10 to 1."""
    step = cascade([FIRST, SECOND], TRUTH, [3, 3], 2, 0.34)
    answer = step(0, lambda: 0)
    np.testing.assert_allclose(answer.belief, [10 / 11, 1 / 11])
    assert answer.consulted
    # A word that decides nothing leaves the answer to the second cue: 1/8 to 5/8.
    np.testing.assert_allclose(step(1, lambda: 2).belief, [1 / 6, 5 / 6])


@pytest.mark.parametrize(("margin", "asked"), [(MARGINS[0], 0), (MARGINS[-1], 3)])
def test_the_ends_of_the_margins_ask_never_and_always(margin: float, asked: int) -> None:
    step = cascade([FIRST, SECOND], TRUTH, [3, 3], 2, margin)
    assert sum(step(unit, lambda: 0).consulted for unit in range(3)) == asked


def noisy(seed: int, reliable: float) -> tuple[list[Ints], Ints, Ints]:
    """Units in either dictionary (of three words), truth and sequences; the second is right with `reliable`."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, 90)
    units = [np.where(rng.random(90) < p, truth, rng.integers(0, 3, 90)) for p in (0.6, reliable)]
    return units, truth, np.repeat(np.arange(3), 30)


@pytest.mark.parametrize("seed", range(5))
def test_the_margin_is_the_first_of_the_best_by_brute_force(seed: int) -> None:
    units, truth, sequences = noisy(seed, 0.6)
    right = []
    for margin in MARGINS:
        count = 0
        for held in np.unique(sequences):
            rest = sequences != held
            step = cascade([its[rest] for its in units], truth[rest], [3, 3], 3, margin)
            for frame in np.flatnonzero(~rest).tolist():
                count += int(step(int(units[0][frame]), partial(int, units[1][frame])).belief.argmax() == truth[frame])
        right.append(count)
    assert best_margin(units, truth, sequences, [3, 3], 3) == MARGINS[right.index(max(right))]


def test_a_useless_second_cue_is_not_asked_and_a_good_one_is() -> None:
    def asked(reliable: float) -> bool:
        units, truth, sequences = noisy(0, reliable)
        step = fit(units, truth, sequences, [3, 3], 3)
        return any(step(unit, lambda: 0).consulted for unit in range(3))

    assert not asked(0.0)
    assert asked(1.0)
