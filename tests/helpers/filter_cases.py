"""Cases for property tests: probabilities of words, transitions of every kind, and steps between the words."""

import math
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from placerec.hohmm import Transition, fixed_transition, learned_transition


class Case(NamedTuple):
    """log10 p float64 (T, C), and how many steps before each word."""

    log10_p: NDArray[np.float64]
    transition: Transition
    elapsed: list[int]

    @property
    def steps(self) -> NDArray[np.float64]:
        return np.array(self.elapsed, np.float64)


def transitions(places: int) -> st.SearchStrategy[Transition]:
    """Fixed, learned, and permutations: ones that mix places and ones that do not."""
    row = st.lists(st.integers(0, 50), min_size=places, max_size=places)
    return st.one_of(
        st.sampled_from([0.0, 0.3, 0.9, 0.99, 1 - 1e-12, 1.0]).map(lambda stay: fixed_transition(places, stay)),
        st.lists(row, min_size=places, max_size=places).map(learned_transition),
        st.permutations(range(places)).map(lambda order: Transition(np.eye(places)[order])),
    )


@st.composite
def cases(draw: st.DrawFn, longest: int = 30, most: int = 4) -> Case:
    """A short sequence; words may be impossible in some places or in all."""
    places, length = draw(st.integers(1, most)), draw(st.integers(1, longest))
    value = st.one_of(st.sampled_from([-math.inf, -400.0]), st.floats(-6, 0))
    rows = draw(
        st.lists(st.lists(value, min_size=places, max_size=places), min_size=length, max_size=length),
    )
    elapsed = draw(st.lists(st.integers(0, 5), min_size=length, max_size=length))
    return Case(np.array(rows), draw(transitions(places)), elapsed)
