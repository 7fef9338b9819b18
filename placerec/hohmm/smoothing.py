"""What the whole sequence says of each moment: forward-backward, fixed lag, and the most probable path (Viterbi).

The words depend on the words before them and on the place of the moment, so that eq. 1 is the forward pass of an
ordinary hidden Markov model over C places, and these are its other two algorithms. A word that left the filter without
an explanation is no evidence here either.
"""

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm.filter import LN10, filter_logs
from placerec.hohmm.motion import CHUNK, Motion, motion, predict_logs
from placerec.hohmm.transitions import Transition


def smooth(log10_p: Floats, transition: Transition, elapsed: Floats) -> Floats:
    """P(place at t | all T words) float64 (T, C): the forward-backward algorithm; arguments as of `filter_stream`."""
    T = len(log10_p)
    if not T:
        return np.empty(log10_p.shape)
    forward, explained = filter_logs(log10_p, motion(transition, elapsed[1:]))
    evidence = np.where(explained[:, None], log10_p, 0.0)
    # Backwards it is a filter again: from the last word to the first, with the transposed matrices.
    later, _ = filter_logs(evidence[::-1], motion(transition, elapsed[:0:-1], backwards=True))
    later = later[::-1].T
    steps = motion(transition, elapsed[1:], backwards=True)
    backward = np.zeros_like(later)
    for start in range(0, T - 1, CHUNK):
        at = slice(start, min(start + CHUNK, T - 1))
        backward[:, at] = predict_logs(steps, later[:, 1:][:, at], at)
    return normalised(forward + backward.T)


def smooth_lagged(log10_p: Floats, transition: Transition, elapsed: Floats, now: Ints, known: Ints) -> Floats:
    """P(place at update now[k] | words up to update known[k] >= now[k]) float64 (n, C), for n questions.

    `now` and `known` int64 (n,) in 0..T-1; the work grows with the largest distance between them.
    """
    forward, explained = filter_logs(log10_p, motion(transition, elapsed[1:]))
    evidence = np.where(explained[:, None], log10_p, 0.0).T * LN10
    steps = motion(transition, elapsed[1:], backwards=True)
    logs = forward[now]
    for start in range(0, len(now), CHUNK):
        part = slice(start, start + CHUNK)
        logs[part] += _evidence_between(evidence, steps, now[part], known[part]).T
    return normalised(logs)


def _evidence_between(evidence: Floats, steps: Motion, now: Ints, known: Ints) -> Floats:
    """How probable the words after `now` (m,), up to `known` (m,), are in each place at `now`: logs (C, m), scaled."""
    logs = np.zeros((len(evidence), len(now)))
    for distance in range(int((known - now).max(initial=0)), 0, -1):
        asked = np.flatnonzero(known - now >= distance)
        update = now[asked] + distance
        logs[:, asked] = predict_logs(steps, evidence[:, update] + logs[:, asked], update - 1)
        logs -= logs.max(axis=0)
    return logs


def viterbi(log10_p: Floats, transition: Transition, elapsed: Floats) -> Ints:
    """The most probable path, a place's number at each of T words, int64 (T,); of equal ones the first place's."""
    T, C = log10_p.shape
    path = np.zeros(T, np.int64)
    if not T:
        return path
    steps = motion(transition, elapsed[1:])
    _, explained = filter_logs(log10_p, steps)
    evidence = np.where(explained[:, None], log10_p, 0.0) * LN10
    came_from = np.empty((T, C), np.int64)
    score = evidence[0]
    for start in range(0, T - 1, CHUNK):
        with np.errstate(divide="ignore"):
            matrices = np.log(np.moveaxis(steps.matrices(slice(start, min(start + CHUNK, T - 1))), 2, 0))
        for t, matrix in enumerate(matrices, start=start + 1):
            reached = score[:, None] + matrix
            came_from[t] = reached.argmax(axis=0)
            score = reached.max(axis=0) + evidence[t]
            score = score - score.max()
    path[-1] = score.argmax()
    for t in range(T - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path


def normalised(logs: Floats) -> Floats:
    """Probabilities (n, C) in proportion to exp(logs), rows sum to 1."""
    p = np.exp(logs - logs.max(axis=1, keepdims=True))
    probabilities: Floats = p / p.sum(axis=1, keepdims=True)
    return probabilities
