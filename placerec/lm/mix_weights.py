"""Weights of a linear mixture of models, found by expectation maximisation on held-out text."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats


@dataclass(frozen=True)
class MixStep:
    """One step of the search: the weights float64 (M,) it started from, and what these give the text, ln p."""

    weights: Floats
    loglik: float


def best_mix(
    p: Floats, start: Sequence[float], precision: float, *, counts: Floats | None = None
) -> tuple[Floats, list[MixStep]]:
    """The weights float64 (M,), sum 1, that make p^T w largest in the mean log, and the steps that led there.

    `p`, float64 (M, T): what each of M models gives each of T tokens; no token may be 0 in all of them. `counts`
    (T,): how often each token occurs (default: once). The search ends when no weight moves by more than `precision`,
    or at once if there are no tokens. As SRILM's compute-best-mix.
    """
    weights = np.array(start, np.float64)
    steps = []
    for step, moved in _improved(p, weights, np.ones(p.shape[1]) if counts is None else counts):
        steps.append(step)
        if float(np.abs(moved - step.weights).max()) <= precision:
            return moved, steps
    return weights, steps


def _improved(p: Floats, weights: Floats, counts: Floats) -> Iterator[tuple[MixStep, Floats]]:
    """Each step with the weights that it leads to, for as long as it is asked for."""
    total = float(counts.sum())
    # What a token's probabilities have in common does not matter to the weights, and could be too small to divide by.
    common = p.max(axis=0, initial=0.0)
    ratio = p / common
    shift = float(np.log(common) @ counts)
    while total > 0:
        share = weights[:, None] * ratio
        mixed = np.maximum(share.sum(axis=0), np.finfo(np.float64).smallest_subnormal)
        step = MixStep(weights, float(np.log(mixed) @ counts) + shift)
        weights = (share / mixed) @ counts / total
        yield step, weights
