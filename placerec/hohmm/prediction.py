"""Transitions along one sequence: the prediction of eq. 1 at each of its updates, for whole arrays of beliefs."""

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, inf, log
from operator import mul

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.hohmm.transitions import Transition, fade

Predict = Callable[[list[float]], list[float]]
# Where every place can be reached from every place with more than this, a belief that is kept as it is (not as its
# logarithm) never loses what matters later: what underflows is 300 decades below what comes from the other places.
MIXING = 1e-15
# Updates whose matrices are computed together.
CHUNK = 1 << 12


@dataclass(frozen=True)
class TransitionSteps:
    """The prediction at each of T updates; T is `count`.

    `mixing`: how many predictions come before the first one that may leave a place MIXING or less; T if there is none.
    `predict(states, at)`: make of `states` (..., C, m) what they are one prediction later, at m of the updates.
    `matrices(at)`: the matrices (C, C, m) at m of the updates; the first index is the place before.
    """

    count: int
    mixing: int
    predict: Callable[[Floats, slice | Ints], None]
    matrices: Callable[[slice | Ints], Floats]


def _uniform_mixing(change: float, places: int, elapsed: Floats) -> TransitionSteps:
    """All places change alike: every belief goes towards 1/C."""
    even = bool((elapsed[:1] == elapsed).all())
    parts = fade(change, elapsed[:1] if even else elapsed)
    kept, spread = (np.broadcast_to(part, elapsed.shape) for part in parts)

    def predict(states: Floats, at: slice | Ints) -> None:
        # One number for all updates is ten times cheaper than a column of equal ones.
        updates = slice(1) if even else at
        shared = total(states)
        shared *= spread[updates] / places
        states *= kept[updates]
        states += shared[..., None, :]

    def matrices(at: slice | Ints) -> Floats:
        found: Floats = np.eye(places)[:, :, None] * kept[at] + spread[at] / places
        return found

    return TransitionSteps(len(spread), _leading(spread / places > MIXING), predict, matrices)


def _matrix_steps(tables: Floats, which: Ints) -> TransitionSteps:
    """Any transitions: the `tables` float64 (C, C, U) that occur, rows the place before; `which` int64 (T,) is used."""

    def matrices(at: slice | Ints) -> Floats:
        found: Floats = tables[:, :, which[at]]
        return found

    def predict(states: Floats, at: slice | Ints) -> None:
        used = tables if tables.shape[2] == 1 else matrices(at)
        before = states.copy()
        np.multiply(before[..., 0, None, :], used[0], out=states)
        product = np.empty_like(states)
        for i in range(1, len(used)):
            np.multiply(before[..., i, None, :], used[i], out=product)
            states += product

    return TransitionSteps(len(which), _leading((tables.min(axis=(0, 1)) > MIXING)[which]), predict, matrices)


def _leading(found: Mask) -> int:
    """How many of the first values are true."""
    return len(found) if found.all() else int(found.argmin())


def transition_steps(transition: Transition, elapsed: Floats, *, backwards: bool = False) -> TransitionSteps:
    """The predictions at T updates, each `elapsed` float64 (T,) steps after the one before.

    `backwards`: of evidence from later updates to earlier ones, so with the transposed matrices.
    """
    if transition.change is not None:
        return _uniform_mixing(transition.change, len(transition.matrix), elapsed)
    distinct, which = np.unique(elapsed, return_inverse=True)
    C = len(transition.matrix)
    tables = np.empty((C, C, len(distinct)))
    for u, steps in enumerate(distinct.tolist()):
        matrix = transition.over(steps)
        tables[:, :, u] = matrix.T if backwards else matrix
    return _matrix_steps(tables, which.reshape(-1))


def predict_logs(steps: TransitionSteps, logs: Floats, at: slice | Ints) -> Floats:
    """The prediction for logarithms (C, m), right for any transitions."""
    top = logs.max(axis=0)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        if steps.mixing == steps.count:
            states: Floats = np.exp(logs - top)
            steps.predict(states, at)
            return np.log(states) + top
        reached = logs[:, None] + np.log(steps.matrices(at))
        highest = np.where(np.isfinite(reached.max(axis=0)), reached.max(axis=0), 0.0)
        predicted: Floats = np.log(np.exp(reached - highest).sum(axis=0)) + highest
    return predicted


def predicted_beliefs(belief: Floats, transition: Transition, elapsed: Floats) -> Floats:
    """What is believed just before each of T words, float64 (T, C): uniform, then the predictions of `belief` (T, C).

    `elapsed` float64 (T,): steps since the word before; the first is not used.
    """
    states = belief.T.copy()
    states[:, 1:], states[:, :1] = belief[:-1].T, 1 / belief.shape[1]
    steps = transition_steps(transition, elapsed[1:])
    for start in range(0, len(belief) - 1, CHUNK):
        at = slice(start, min(start + CHUNK, len(belief) - 1))
        steps.predict(states[:, 1:][:, at], at)
    return states.T


def total(states: Floats) -> Floats:
    """The sum over places: (..., C, m) to (..., m); always in their order, so that m changes no last digit."""
    sums = states[..., 0, :].copy()
    for i in range(1, states.shape[-2]):
        sums += states[..., i, :]
    return sums


def predictor(transition: Transition, steps: float) -> Predict:
    """The prediction over `steps` steps for one log belief, plain floats in and out: what is fast on-line."""
    if transition.change is not None:
        kept, spread = (float(part[0]) for part in fade(transition.change, np.array([steps], np.float64)))
        share = spread / len(transition.matrix)
        if share > MIXING:
            return lambda log_belief: [log(kept * exp(b) + share) for b in log_belief]
    return matrix_predictor(transition.over(steps))


def matrix_predictor(matrix: Floats) -> Predict:
    """The prediction by a matrix (C, C) for one log belief, plain floats in and out."""
    columns: list[list[float]] = matrix.T.tolist()
    if float(matrix.min()) > MIXING:
        return lambda log_belief: _mixed([exp(b) for b in log_belief], columns)
    logs = [[safe_log(p) for p in column] for column in columns]
    return lambda log_belief: [log_sum([b + p for b, p in zip(log_belief, column, strict=True)]) for column in logs]


def _mixed(belief: list[float], columns: list[list[float]]) -> list[float]:
    return [log(sum(map(mul, belief, column))) for column in columns]


def safe_log(p: float) -> float:
    """The natural logarithm, -inf for 0."""
    return log(p) if p > 0 else -inf


def log_sum(logs: list[float]) -> float:
    """log of the sum of exp(x), -inf if all are."""
    top = max(logs)
    return top + log(sum([exp(x - top) for x in logs])) if top > -inf else top
