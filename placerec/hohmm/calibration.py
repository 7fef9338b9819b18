"""Beliefs that can be taken at their word: a temperature, fitted on labelled sequences that trained nothing.

Neighbouring frames see nearly the same, and the filter counts them as independent: it is too sure. A belief raised to
1 / temperature, place by place, and brought back to a sum of 1 is less so, and its order of places stays as it is: no
decision changes. Isotonic regression, which is about as good, changes decisions and asks for more labelled frames;
word probabilities raised to a power inside the filter make it slow to notice a change (docs/recognizer.md has numbers).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import ModelError
from placerec.hohmm.filter import normalised

# A place that the filter rules out: no temperature could bring back a belief of 0.
_SMALLEST_BELIEF = 1e-15
_LEAST, _MOST = 0.01, 100.0
# How well the exponent is known to be 1 beforehand: a few frames, all of them right, must not make it infinite.
_PRIOR = 1.0


@dataclass(frozen=True)
class Calibration:
    """A temperature (above 1: less sure), and what it was fitted on: frames, nats per frame before and after."""

    temperature: float
    frames: int
    log_loss_before: float
    log_loss_after: float

    def apply(self, belief: Floats) -> Floats:
        """The calibrated belief (..., C) of each row of `belief` (..., C); rows sum to 1."""
        return normalised(1 / self.temperature * np.log(np.maximum(belief, _SMALLEST_BELIEF)))

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> "Calibration":
        """The calibration with these values, further keys aside; ModelError if they make none."""
        try:
            numbers = [float(values[name]) for name in ("temperature", "log_loss_before", "log_loss_after")]
            frames = int(values["frames"])
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"the calibration lacks or garbles {error}; run `placerec calibrate` again") from error
        if not (math.isfinite(numbers[0]) and numbers[0] > 0):
            raise ModelError(
                f"the calibration's temperature {numbers[0]:g} is not above 0; run `placerec calibrate` again"
            )
        return cls(numbers[0], frames, numbers[1], numbers[2])


def fit_calibration(belief: Floats, truth: Ints) -> Calibration:
    """The temperature with the least log loss on beliefs (n, C) with true places (n,), as column indices.

    The frames must come from sequences that trained neither the words nor the models. Raises ModelError for no frame.
    """
    if not len(truth):
        raise ModelError("no labelled frame of a known place to calibrate on")
    log_belief = np.log(np.maximum(belief, _SMALLEST_BELIEF))
    rows = np.arange(len(truth))
    evidence = log_belief[rows, truth].sum()

    def slope(exponent: float) -> float:
        """The loss is convex in the exponent, so that its slope has one zero."""
        expected = (normalised(exponent * log_belief) * log_belief).sum()
        return float(expected - evidence) + _PRIOR * (exponent - 1)

    low, high = 1 / _MOST, 1 / _LEAST
    while high - low > 1e-9 * high:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if slope(middle) > 0 else (middle, high)
    # Six digits: a file to read, and the last bits of a sum differ from machine to machine.
    temperature = float(f"{1 / math.sqrt(low * high):.6g}")
    losses = [float(-np.log(normalised(x * log_belief)[rows, truth]).mean()) for x in (1.0, 1 / temperature)]
    return Calibration(temperature, len(truth), *(max(0.0, float(f"{loss:.6g}")) for loss in losses))
