"""How the place changes between two observations: P(x_t | x_{t-1}) of eq. 1, over any number of steps.

As text: a header of places, then one row of probabilities per place (UTF-8, tabs; blank lines mean nothing)::

    file = place { TAB place } NL { row }
    row  = probability { TAB probability } NL

Row i: from the i-th place of the header to each place of the header. A row sums to 1; what rounding leaves off is
mended. The places are those of the model, in any order.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError, at, counted
from placerec.files import all_lines, number_in

Per = Literal["update", "frame", "second"]
PER: tuple[str, ...] = get_args(Per)
# Numbers written with three digits may miss 1 by as much; more is a mistake.
_SUM_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class Transition:
    """Transitions between C places: `matrix` float64 (C, C) of one step, rows (the place before) sum to 1.

    `per`: what a step is: one `update` of the belief (a selected word), one `frame`, or one `second`. `change`: where
    all places change alike, so that the matrix is (1 - change) I + change / C, that number from 0 to 1; its powers then
    have a closed form (readings A23). Raises ModelError if steps are seconds and there is no such form: a part of a
    step would have no meaning.
    """

    matrix: Floats
    per: Per = "update"
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
        return f"Transition({counted(len(self.matrix), 'place')}, per {self.per})"

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


def fixed_transition(places: int, stay: float = 0.99, per: Per = "update") -> Transition:
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


def learned_transition(
    counts: Sequence[Sequence[int]] | Ints, memory: float = 0.0, shares: Floats | None = None
) -> Transition:
    """Transitions per frame from `counts` (C, C) of steps from one frame's place to the next one's.

    A Dirichlet prior of 1/C is added to every cell, so that no change is impossible. `memory`, `shares`: see
    `forgetting`.
    """
    smoothed = np.asarray(counts, np.float64) + 1 / len(counts)
    learned = Transition(smoothed / smoothed.sum(axis=1, keepdims=True), "frame")
    return learned if shares is None else forgetting(learned, memory, shares)


def forgetting(transition: Transition, memory: float, shares: Floats) -> Transition:
    """Transitions that at each step replace the share `memory` of any belief by the places' `shares` (C,).

    At 0 nothing is forgotten, at 1 each frame stands alone. Raises ModelError for another number.
    """
    if not 0 <= memory <= 1:
        raise ModelError(f"memory {memory:g} is not between 0 and 1")
    if memory == 0:
        return transition
    mixed = (1 - memory) * transition.matrix + memory * shares
    return Transition(mixed / mixed.sum(axis=1, keepdims=True), transition.per)


def _product(a: Floats, b: Floats) -> Floats:
    # Not BLAS, whose sums depend on the number of its threads.
    product: Floats = np.einsum("ij,jk->ik", a, b)
    # Squaring doubles what rounding leaves off a sum of 1.
    product /= product.sum(axis=1, keepdims=True)
    return product


def read_transitions(path: Path | str, places: Sequence[str]) -> Floats:
    """The matrix float64 (C, C) of a file, rows and columns in the order of `places`, rows sum to 1.

    Raises ModelError with the line, the value and the remedy for what is not by the grammar.
    """
    path = Path(path)
    lines = [(number, line) for number, line in enumerate(all_lines(path, ModelError), start=1) if line.strip()]
    if not lines:
        raise ModelError(f"{path}: is empty; a header of places and one row per place are expected")
    (first, head), *rows = lines
    header = head.split("\t")
    if sorted(header) != sorted(places):
        expected, found = " ".join(places), " ".join(header)
        raise ModelError(at(path, first, f"the header is {found!r}; the model's places, {expected!r}, are expected"))
    if len(rows) != len(header):
        raise ModelError(f"{path}: {len(rows)} rows of probabilities for {len(header)} places; one per place is needed")
    matrix = np.array([_row(path, number, line, header) for number, line in rows])
    order = [header.index(place) for place in places]
    return matrix[np.ix_(order, order)]


def _row(path: Path, number: int, line: str, header: Sequence[str]) -> list[float]:
    cells = line.split("\t")
    if len(cells) != len(header):
        raise ModelError(at(path, number, f"{len(cells)} fields found, {len(header)} expected as in the header"))
    values = []
    for cell, place in zip(cells, header, strict=True):
        value = number_in(cell)
        if not 0 <= value <= 1:
            raise ModelError(at(path, number, f"{cell!r} under {place!r} is no probability from 0 to 1"))
        values.append(value)
    if abs(math.fsum(values) - 1) > _SUM_TOLERANCE:
        raise ModelError(at(path, number, f"the probabilities sum to {math.fsum(values):.6g}, not to 1"))
    return [value / math.fsum(values) for value in values]
