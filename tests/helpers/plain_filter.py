"""The definitions, word by word and path by path: what the fast code is compared with."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from placerec.hohmm import Transition

Floats = NDArray[np.float64]


def power(matrix: Floats, steps: int) -> Floats:
    """By multiplying again and again."""
    result = np.eye(len(matrix))
    for _ in range(steps):
        result = result @ matrix
    return result


def filtered(log10_p: Floats, transition: Transition, elapsed: list[int]) -> tuple[Floats, list[bool]]:
    """Eq. 1 in logarithms, and which words have an explanation."""
    places = log10_p.shape[1]
    belief = [-math.log(places)] * places
    beliefs, explained = [], []
    for t, row in enumerate(log10_p.tolist()):
        if t:
            matrix = power(transition.matrix, elapsed[t])
            belief = [_log_sum([b + _log(matrix[i, j]) for i, b in enumerate(belief)]) for j in range(places)]
        weighed = [b + p * math.log(10) for b, p in zip(belief, row, strict=True)]
        total = _log_sum(weighed)
        explained.append(total > -math.inf)
        if explained[-1]:
            belief = [value - total for value in weighed]
        beliefs.append([math.exp(value) for value in belief])
    return np.array(beliefs).reshape(log10_p.shape), explained


def paths(log10_p: Floats, transition: Transition, elapsed: list[int]) -> dict[tuple[int, ...], float]:
    """The log of the joint probability of every path and the words that have an explanation."""
    T, C = log10_p.shape
    _, explained = filtered(log10_p, transition, elapsed)
    logs = np.where(np.array(explained)[:, None], log10_p, 0.0) * math.log(10)
    matrices = [power(transition.matrix, steps) for steps in elapsed]
    return {
        path: sum(logs[t, path[t]] for t in range(T))
        + sum(_log(matrices[t][path[t - 1], path[t]]) for t in range(1, T))
        for path in itertools.product(range(C), repeat=T)
    }


def posterior(log10_p: Floats, transition: Transition, elapsed: list[int]) -> Floats:
    """P(place at t | all words), by enumeration."""
    every = paths(log10_p, transition, elapsed)
    best = max(every.values())
    sums = np.zeros(log10_p.shape)
    for path, loglik in every.items():
        sums[np.arange(len(path)), path] += math.exp(loglik - best)
    sums /= sums.sum(axis=1, keepdims=True)
    return sums


def _log(x: float) -> float:
    return math.log(x) if x > 0 else -math.inf


def _log_sum(logs: list[float]) -> float:
    top = max(logs)
    return top + math.log(sum(math.exp(x - top) for x in logs)) if top > -math.inf else top
