"""`second-order`: the place depends on the last two places (Lee & Lee 2006), learned from the training sequences.

Who entered the doorway from the kitchen goes on elsewhere than who entered it from the bedroom. A state is a place with
the place before it; a step keeps it, or leads from (p, c) to (c, d). The probability of staying in c is that of the
learned transitions, A(c, c). The next place has P(d | p, c) = (n(p, c, d) + A(c, d) / (1 - A(c, c))) / (n(p, c) + 1):
n(p, c, d) counts visits of c between p and d, and the transitions of first order weigh as much as one such visit. The
emissions are those of the models, so that only the order of places differs from `hohmm` with learned transitions.

Simplified: "the last two" are visits, not frames: of two neighbouring frames the first says nothing new. How long one
stays does not depend on where one came from. At the beginning of a sequence all states are equally probable. Memory
grows with the square, and time with the cube of the number of places.
"""

from math import inf

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError
from placerec.hohmm import learned_transition
from placerec.lm.backoff import unite_models
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet


def fit(training: TrainingSet) -> MakeStepper:
    """Belief over places, from a filter over pairs of places."""
    stay, change = pair_transitions(training)
    emissions = unite_models(list(training.models.values()))
    C = len(stay)

    def make_stepper() -> StepFunction:
        score = emissions.follow()
        # Rows: the place before.
        state = np.ones((C, C)) if C == 1 else (1 - np.eye(C)) / (C * (C - 1))

        def step(word: int, elapsed: int) -> Floats:
            nonlocal state
            log10_p = np.array(score(training.vocabulary[word]))
            for _ in range(elapsed):
                state = state * stay + np.einsum("qp,qpc->pc", state, change)
            top = log10_p.max()
            if top > -inf:
                state = state * 10.0 ** (log10_p - top)
                state /= state.sum()
            belief: Floats = state.sum(axis=0)
            belief /= belief.sum()
            return belief

        return step

    return make_stepper


def pair_transitions(training: TrainingSet) -> tuple[Floats, Floats]:
    """The probability of staying in each place (C,), and of going from (p, c) to (c, d), (C, C, C).

    Raises ModelError for a training set of sentences, which do not tell what follows what.
    """
    if training.steps is None or training.triples is None:
        raise ModelError(
            "second-order learns how places follow each other, which a model of sentences does not tell; "
            "train it on token streams"
        )
    first = learned_transition(training.steps).matrix
    stay = np.diag(first).copy()
    if len(stay) == 1:
        return stay, np.zeros((1, 1, 1))
    elsewhere = first * (1 - np.eye(len(stay)))
    elsewhere /= elsewhere.sum(axis=1, keepdims=True)
    onward = (training.triples + elsewhere) / (training.triples.sum(axis=2, keepdims=True) + 1)
    return stay, (1 - stay)[:, None] * onward
