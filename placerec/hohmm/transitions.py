"""How the place changes between two observations: P(x_t | x_{t-1}) of eq. 1, over any number of steps."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError

PER = ("update", "frame", "second")


@dataclass(frozen=True, eq=False)
class Transition:
    """Transitions between C places: `matrix` float64 (C, C) of one step, rows (the place before) sum to 1.

    `per`: what a step is: one `update` of the belief (a selected word), one `frame`, or one `second`. `change`: where
    all places change alike, so that the matrix is (1 - change) I + change / C, that number from 0 to 1; its powers then
    have a closed form (readings A23). Raises ModelError if steps are seconds and there is no such form: a part of a
    step would have no meaning.
    """

    matrix: Floats
    per: str = "update"
    change: float | None = None
    _powers: dict[int, Floats] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.per not in PER:
            raise ModelError(f"transitions per {self.per!r} are unknown; choose {', '.join(PER)}")
        if self.per == "second" and self.change is None:
            raise ModelError(
                "transitions per second need parts of a step, which these have not; give a probability of staying that "
                "is at least 1 / the number of places, or transitions per update or frame"
            )

    def __repr__(self) -> str:
        return f"Transition({len(self.matrix)} places, per {self.per})"

    def over(self, steps: float) -> Floats:
        """The matrix (C, C) of `steps` steps >= 0: the power of `matrix`; whole numbers only without `change`."""
        if steps == 1:
            return self.matrix
        C = len(self.matrix)
        if self.change is not None:
            kept, spread = fade(self.change, np.array([float(steps)]))
            return kept * np.eye(C) + spread / C
        power, square = np.eye(C), 1
        while square <= steps:
            if int(steps) & square:
                power = _product(power, self._power_of_two(square))
            square *= 2
        return power

    def _power_of_two(self, exponent: int) -> Floats:
        if exponent == 1:
            return self.matrix
        if exponent not in self._powers:
            half = self._power_of_two(exponent // 2)
            self._powers[exponent] = _product(half, half)
        return self._powers[exponent]


def fade(change: float, steps: Floats) -> tuple[Floats, Floats]:
    """(1 - change) ** steps, and what is missing to 1, float64 (T,) both, exact for the smallest changes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exponent = np.where(steps == 0, 0.0, steps * np.log1p(-change))
    return np.exp(exponent), -np.expm1(exponent)


def fixed_transition(places: int, stay: float = 0.99, per: str = "update") -> Transition:
    """The paper's transitions: `stay` on the diagonal, the rest shared equally (p_e of section 3; readings A24).

    Raises ModelError if `stay` is no probability, or is below 1 / places and steps are seconds.
    """
    if not 0 <= stay <= 1:
        raise ModelError(f"stay probability {stay:g} is not between 0 and 1")
    if places == 1:
        return Transition(np.ones((1, 1)), per, 1.0)
    matrix = np.full((places, places), (1 - stay) / (places - 1))
    np.fill_diagonal(matrix, stay)
    change = places * (1 - stay) / (places - 1)
    return Transition(matrix, per, change if change <= 1 else None)


def learned_transition(counts: Sequence[Sequence[int]] | Ints) -> Transition:
    """Transitions per frame from `counts` (C, C) of steps from one frame's place to the next one's.

    A Dirichlet prior of 1/C is added to every cell, so that no change is impossible.
    """
    smoothed = np.asarray(counts, np.float64) + 1 / len(counts)
    return Transition(smoothed / smoothed.sum(axis=1, keepdims=True), "frame")


def _product(a: Floats, b: Floats) -> Floats:
    # Not BLAS, whose sums depend on the number of its threads.
    product: Floats = np.einsum("ij,jk->ik", a, b)
    # Squaring doubles what rounding leaves off a sum of 1.
    product /= product.sum(axis=1, keepdims=True)
    return product
