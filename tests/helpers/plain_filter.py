"""The definitions, word by word and path by path: what the fast code is compared with."""

import itertools
import math

import numpy as np

from placerec import reference
from placerec.arrays import Floats
from placerec.hohmm import Transition


def power(matrix: Floats, steps: int) -> Floats:
    """By multiplying again and again."""
    result = np.eye(len(matrix))
    for _ in range(steps):
        result = result @ matrix
    return result


def filtered(log10_p: Floats, transition: Transition, elapsed: list[int]) -> tuple[Floats, list[bool]]:
    """Eq. 1 in logarithms, and which words are possible."""
    matrices = [power(transition.matrix, steps).tolist() for steps in elapsed]
    beliefs, possible = reference.filtered((log10_p * math.log(10)).tolist(), matrices)
    return np.array(beliefs).reshape(log10_p.shape), possible


def paths(log10_p: Floats, transition: Transition, elapsed: list[int]) -> dict[tuple[int, ...], float]:
    """The log of the joint probability of every path and the words that have an explanation."""
    T, C = log10_p.shape
    _, possible = filtered(log10_p, transition, elapsed)
    logs = np.where(np.array(possible)[:, None], log10_p, 0.0) * math.log(10)
    matrices = [power(transition.matrix, steps) for steps in elapsed]
    return {
        path: sum(logs[t, path[t]] for t in range(T))
        + sum(reference._log(matrices[t][path[t - 1], path[t]]) for t in range(1, T))
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
