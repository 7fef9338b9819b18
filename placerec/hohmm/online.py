"""The filter one word at a time, in plain floats and constant memory; its numbers are those of `filter_stream`."""

from collections.abc import Sequence
from math import exp, log

import numpy as np

from placerec.arrays import Floats
from placerec.hohmm.filter import filter_step
from placerec.hohmm.motion import Predict, predictor
from placerec.hohmm.transitions import Transition

# How many distinct times between updates have their transitions kept.
PREDICTORS = 1024


class OnlineFilter:
    """A belief over C states that change by `transition`, from `prior` (C) on; `log_belief`: its natural logarithms."""

    def __init__(self, transition: Transition, prior: Sequence[float]) -> None:
        self._transition = transition
        self._prior = [log(p) for p in prior]
        self._predictors: dict[float, Predict] = {}
        self.reset()

    def reset(self) -> None:
        """Believe the prior again."""
        self.log_belief = self._prior

    def predict(self, steps: float) -> None:
        """Let `steps` steps of the transitions pass."""
        predict = self._predictors.get(steps)
        if predict is None:
            if len(self._predictors) == PREDICTORS:
                self._predictors.clear()
            predict = self._predictors[steps] = predictor(self._transition, steps)
        self.log_belief = predict(self.log_belief)

    def weigh(self, log10_p: Sequence[float]) -> bool:
        """Take in a word with log10 p (C) in each state; whether any state explains it."""
        self.log_belief, explained = filter_step(self.log_belief, log10_p)
        return explained

    def belief(self) -> Floats:
        """The belief, float64 (C,); sums to 1."""
        belief = np.array([exp(b) for b in self.log_belief])
        normal: Floats = belief / belief.sum()
        return normal
