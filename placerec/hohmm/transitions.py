"""How the place changes from one observation to the next: P(x_t | x_{t-1}) of eq. 1."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from placerec.errors import ModelError


@dataclass(frozen=True)
class Transition:
    """A transition matrix between C places: `matrix` float64 (C, C), rows (the place before) sum to 1."""

    matrix: NDArray[np.float64]

    def __post_init__(self) -> None:
        with np.errstate(divide="ignore"):
            object.__setattr__(self, "_log_matrix", np.log(self.matrix))

    def predict(self, log_belief: NDArray[np.float64]) -> NDArray[np.float64]:
        """log belief (C,) one step later, before the next observation: the sum of eq. 1 in the log domain."""
        reached: NDArray[np.float64] = self._log_matrix + log_belief[:, None]  # type: ignore[attr-defined]
        return logsumexp(reached)


def fixed_transition(places: int, stay: float = 0.99) -> Transition:
    """The paper's transitions: `stay` on the diagonal, the rest shared equally (p_e of section 3; readings A24).

    Raises ModelError if `stay` is no probability.
    """
    if not 0 <= stay <= 1:
        raise ModelError(f"stay probability {stay:g} is not between 0 and 1")
    if places == 1:
        return Transition(np.ones((1, 1)))
    matrix = np.full((places, places), (1 - stay) / (places - 1))
    np.fill_diagonal(matrix, stay)
    return Transition(matrix)


def logsumexp(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """log of the sum over the first axis of exp(values), -inf where all are -inf."""
    top = values.max(axis=0)
    finite = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        total: NDArray[np.float64] = np.log(np.exp(values - finite).sum(axis=0))
    return total + finite
