"""Sequences of hidden words: the best, the n best, and how probable each word is in its place.

A trellis has, position by position, states, and transitions between those of neighbouring positions, each at a cost:
log10, float32. Sums over paths are stored in float32 at every state and formed in float64, state by state in the order
in which states were found, as SRILM's tools form them: the last printed digits show it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.logs import LN10


@dataclass(frozen=True)
class Step:
    """The transitions into the states of a position: from the states of the one before, `costs` (A, S) float32.

    `targets` int64 (A, S): the state that each leads to. `labels` int64 (n,): what each state says, by a number.
    """

    costs: Singles
    targets: Ints
    labels: Ints

    @cached_property
    def turns(self) -> Ints:
        """Which transitions lead to each state, one after the other: places in the flat arrays, (turns, n).

        Behind the last place is what fills the columns of states that fewer transitions lead to.
        """
        targets = self.targets.ravel()
        turn = _turns(targets)
        places = np.full((int(turn.max(initial=-1)) + 1, len(self.labels)), len(targets))
        places[turn, targets] = np.arange(len(targets))
        return places


class Path(NamedTuple):
    """The labels of a path, position by position, and the sum of the costs on the way."""

    labels: list[int]
    log10_p: float


def numbered_states(keys: Ints) -> tuple[Ints, Ints]:
    """States by number in the order in which they are first named: `targets` of the shape of `keys`, and the keys (n,).

    `keys` int64 (A, S).
    """
    distinct, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    found = np.argsort(first)
    number = np.empty(len(distinct), np.int64)
    number[found] = np.arange(len(distinct))
    return number[inverse].reshape(keys.shape), distinct[found]


def forward(steps: Sequence[Step], *, summed: bool) -> list[Singles]:
    """Per position (the start is one) the log10 p of each state: of the best way there, or of all ways together."""
    scores = [np.zeros(1, np.float32)]
    for step in steps:
        totals = np.append((scores[-1] + step.costs).ravel(), np.float32(-np.inf))[step.turns]
        scores.append(_gathered(totals, summed=summed))
    return scores


def backward(steps: Sequence[Step], *, summed: bool) -> list[Singles]:
    """Per position (the start is one) the log10 p of what follows each state: of the best way on, or of all ways."""
    scores = [np.zeros(len(steps[-1].labels) if steps else 1, np.float32)]
    for step in reversed(steps):
        scores.append(_gathered(scores[-1][step.targets] + step.costs, summed=summed))
    return scores[::-1]


def _gathered(totals: Singles, *, summed: bool) -> Singles:
    """The largest of each column of logarithms (k, n), or the logarithm of the sum, from the first row to the last."""
    if not summed or not len(totals):
        best: Singles = totals.max(axis=0, initial=-np.inf)
        return best
    impossible = np.isneginf(totals).any()
    rows = totals.astype(np.float64)
    gathered = rows[0]
    for row in rows[1:]:
        more, less = np.maximum(gathered, row), np.minimum(gathered, row)
        # In place: the arrays are small, and making them takes as long as what is done to them.
        less -= more
        less *= LN10
        np.exp(less, out=less)
        less += 1
        np.log10(less, out=less)
        less += more
        if impossible:
            less[np.isneginf(more)] = -np.inf
        gathered = less.astype(np.float32).astype(np.float64)
    sums: Singles = gathered.astype(np.float32)
    return sums


def _turns(targets: Ints) -> Ints:
    """For each entry, how many before it have the same value, int64 (m,)."""
    order = np.argsort(targets, kind="stable")
    sizes = np.bincount(targets) if len(targets) else np.zeros(0, np.int64)
    turns = np.empty(len(targets), np.int64)
    turns[order] = np.arange(len(targets)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return turns


def total_log10_p(scores: NDArray[Any]) -> float:
    """log10 of the sum over states of what their scores (n,) are the logarithms of; from the last, as SRILM."""
    return reduce(_plus, scores.tolist()[::-1], -math.inf)


def _plus(a: float, b: float) -> float:
    """log10 of the sum of what two numbers are the logarithms of, by the C library's functions."""
    more, less = max(a, b), min(a, b)
    return more if less == -math.inf else more + math.log10(1 + math.exp((less - more) * LN10))


def joint_log10_p(before: Singles, behind: Singles, *, summed: bool) -> Floats:
    """log10 p (n,) of the ways through each state, given those to it and those on from there, (n,).

    The best ways, or `summed`: all of them, whose product SRILM stores in float32.
    """
    return (before + behind).astype(np.float64) if summed else before.astype(np.float64) + behind.astype(np.float64)


def label_shares(joint: Floats, labels: Ints) -> dict[int, float]:
    """log10 of the share of each label at a position, in the order of the states (n,); the shares sum to 1."""
    total = total_log10_p(joint)
    shares: dict[int, float] = {}
    for label, value in zip(labels.tolist(), joint.tolist(), strict=True):
        shares[label] = _plus(shares.get(label, -math.inf), value)
    return {label: share - total for label, share in shares.items()}


def best_path(steps: Sequence[Step], scores: Sequence[Singles]) -> Path:
    """The best path, given the best score of each state, one of which must not be log 0; of equal ways the first."""
    # Of equal ends the last.
    state = len(scores[-1]) - 1 - int(np.argmax(scores[-1][::-1]))
    labels = []
    total = float(scores[-1][state])
    for step, before, reached in zip(reversed(steps), scores[-2::-1], scores[:0:-1], strict=True):
        labels.append(int(step.labels[state]))
        costs = before + step.costs
        best = (step.targets == state) & (costs == reached[state])
        state = int(np.argmax(best.ravel())) % len(before)
    return Path(labels[::-1], total)


class _Ranked(NamedTuple):
    """The best ways to the states of a position: scores (m,), the states (m,), and the ways (m,) that they go on."""

    scores: Singles
    states: Ints
    ways: Ints


def best_paths(steps: Sequence[Step], size: int) -> list[Path]:
    """The `size` best paths, best first; behind them there may be paths of p 0, as SRILM prints them.

    SRILM keeps as many ways to each state. One to the start, of p 0, is there from the beginning, and takes the places
    that are left over.
    """
    ranked = [_Ranked(np.array([0, -np.inf], np.float32)[:size], np.zeros(2, np.int64)[:size], np.zeros(2, np.int64))]
    for step in steps:
        last = ranked[-1]
        # By state: which ways lead there.
        ways = np.arange(len(last.scores))
        rows = np.arange(len(step.costs))[:, None]
        totals = (last.scores + step.costs[rows, last.states]).ravel()
        targets = step.targets[rows, last.states].ravel()
        ranked.append(_leading(totals, targets, np.tile(ways, len(step.costs)), size))
    ends = ranked[-1]
    final = _leading(ends.scores, np.zeros(len(ends.scores), np.int64), np.arange(len(ends.scores)), size)
    return [_traced(steps, ranked, way, float(score)) for way, score in zip(final.ways, final.scores, strict=True)]


def _leading(totals: Singles, targets: Ints, ways: Ints, size: int) -> _Ranked:
    """Of the ways to each target the `size` best, the one that came last first among equals."""
    order = np.lexsort((-np.arange(len(totals)), -totals, targets))
    order = order[_turns(targets[order]) < size]
    return _Ranked(totals[order], targets[order], ways[order])


def _traced(steps: Sequence[Step], ranked: Sequence[_Ranked], way: int, log10_p: float) -> Path:
    labels = []
    for step, its in zip(reversed(steps), ranked[:0:-1], strict=True):
        labels.append(int(step.labels[its.states[way]]))
        way = int(its.ways[way])
    return Path(labels[::-1], log10_p)
