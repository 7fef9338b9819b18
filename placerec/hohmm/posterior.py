"""Beliefs about every frame of a sequence that is known to its end: forward-backward, fixed lag, Viterbi's path.

The words depend on the words before them and on the place of the moment, so that eq. 1 is the forward pass of an
ordinary hidden Markov model over C places, which has these further algorithms. A word that no place gives a probability
above 0 is no evidence here, as it is none for the filter.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm import unknown
from placerec.hohmm.evidence import Evidence
from placerec.hohmm.filter import filter_logs, filter_stream, normalised
from placerec.hohmm.prediction import CHUNK, TransitionSteps, predict_logs, predicted_beliefs, transition_steps
from placerec.hohmm.transitions import Transition
from placerec.hohmm.unknown import UnknownModel
from placerec.lm.logs import LN10


def forward_backward(log10_likelihoods: Floats, transition: Transition, elapsed: Floats) -> Floats:
    """P(place at t | all T words) float64 (T, C): the forward-backward algorithm.

    `log10_likelihoods` float64 (T, C): of each word in each place. `elapsed` float64 (T,): steps since the word before.
    """
    T = len(log10_likelihoods)
    if not T:
        return np.empty(log10_likelihoods.shape)
    forward, possible = filter_logs(log10_likelihoods, transition_steps(transition, elapsed[1:]))
    evidence = np.where(possible[:, None], log10_likelihoods, 0.0)
    # Backwards it is a filter again: from the last word to the first, with the transposed matrices.
    later, _ = filter_logs(evidence[::-1], transition_steps(transition, elapsed[:0:-1], backwards=True))
    later = later[::-1].T
    steps = transition_steps(transition, elapsed[1:], backwards=True)
    backward = np.zeros_like(later)
    for start in range(0, T - 1, CHUNK):
        at = slice(start, min(start + CHUNK, T - 1))
        backward[:, at] = predict_logs(steps, later[:, 1:][:, at], at)
    return normalised(forward + backward.T)


def fixed_lag(log10_likelihoods: Floats, transition: Transition, elapsed: Floats, now: Ints, known: Ints) -> Floats:
    """P(place at update now[k] | words up to update known[k] >= now[k]) float64 (n, C), for n questions.

    `now` and `known` int64 (n,) in 0..T-1; the work grows with the largest distance between them.
    """
    forward, possible = filter_logs(log10_likelihoods, transition_steps(transition, elapsed[1:]))
    evidence = np.where(possible[:, None], log10_likelihoods, 0.0).T * LN10
    steps = transition_steps(transition, elapsed[1:], backwards=True)
    logs = forward[now]
    for start in range(0, len(now), CHUNK):
        part = slice(start, start + CHUNK)
        logs[part] += _evidence_between(evidence, steps, now[part], known[part]).T
    return normalised(logs)


def _evidence_between(evidence: Floats, steps: TransitionSteps, now: Ints, known: Ints) -> Floats:
    """How probable the words after `now` (m,), up to `known` (m,), are in each place at `now`: logs (C, m), scaled."""
    logs = np.zeros((len(evidence), len(now)))
    for distance in range(int((known - now).max(initial=0)), 0, -1):
        asked = np.flatnonzero(known - now >= distance)
        update = now[asked] + distance
        logs[:, asked] = predict_logs(steps, evidence[:, update] + logs[:, asked], update - 1)
        logs -= logs.max(axis=0)
    return logs


def viterbi(log10_likelihoods: Floats, transition: Transition, elapsed: Floats) -> Ints:
    """The most probable path, a place's number at each of T words, int64 (T,); of equal ones the first place's."""
    T, C = log10_likelihoods.shape
    path = np.zeros(T, np.int64)
    if not T:
        return path
    steps = transition_steps(transition, elapsed[1:])
    _, possible = filter_logs(log10_likelihoods, steps)
    evidence = np.where(possible[:, None], log10_likelihoods, 0.0) * LN10
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


def posterior(
    evidence: Evidence, transition: Transition, *, smooth: bool = False, lag: int | None = None
) -> tuple[Floats, int]:
    """The belief float64 (n, C) at every frame, and how many words had probability 0 in every place.

    By default that of the filter: from the words up to the frame. `smooth`: from all words. `lag`: from the words up
    to that many frames later. A frame without a selected word is believed to be where the last frame with one was;
    before the first one all places are equally probable.
    """
    words, updates, frames = (evidence.log10_likelihoods, transition, evidence.elapsed), evidence.updates, len(evidence)
    filtered = filter_stream(*words)
    if lag is not None and lag < frames:
        known = updates[np.minimum(np.arange(frames) + lag, frames - 1)]
        started = updates > 0
        belief = np.full((frames, filtered.belief.shape[1]), 1 / filtered.belief.shape[1])
        if started.any():
            belief[started] = fixed_lag(*words, updates[started] - 1, known[started] - 1)
    elif smooth or lag is not None:
        belief = forward_fill(forward_backward(*words), updates)
    else:
        belief = forward_fill(filtered.belief, updates)
    return belief, filtered.zero_likelihood_words


def unknown_posterior(
    evidence: Evidence,
    transition: Transition,
    models: Sequence[UnknownModel],
    distances: Floats,
    *,
    smooth: bool = False,
    lag: int | None = None,
) -> Floats:
    """The probability at every frame that the place is none of the known ones, float64 (n,).

    `models`: of each of D dictionaries. `distances` (D, U): of the selected words, nan where unknown. `smooth`, `lag`:
    see `posterior`.
    """
    places = evidence.own.shape[2]
    ratios = unknown_ratios(evidence, transition, models, distances)
    chain = replace(evidence, own=unknown.chain_evidence(ratios, places)[None], alpha=1.0)
    belief, _ = posterior(chain, unknown.CHAIN, smooth=smooth, lag=lag)
    before, _ = unknown.prior(places)
    return np.where(evidence.updates > 0, belief[:, 0], before)


def unknown_ratios(
    evidence: Evidence, transition: Transition, models: Sequence[UnknownModel], distances: Floats
) -> Floats:
    """What each selected frame says of a new place, float64 (U,): `unknown.evidence_of_all` beside the filter.

    `models`, `distances`: see `unknown_posterior`.
    """
    predicted, _ = beliefs_around(evidence.log10_likelihoods, transition, evidence.elapsed)
    return unknown.evidence_of_all(models, evidence.own, predicted, distances)


def beliefs_around(log10_likelihoods: Floats, transition: Transition, elapsed: Floats) -> tuple[Floats, Floats]:
    """The filter's beliefs just before and after each of T words, float64 (T, C) both."""
    after = filter_stream(log10_likelihoods, transition, elapsed).belief
    return predicted_beliefs(after, transition, elapsed), after


def most_probable_path(evidence: Evidence, transition: Transition) -> Ints:
    """The number of each frame's place on the most probable path, int64 (n,); 0 before the first selected word."""
    path = np.concatenate([[0], viterbi(evidence.log10_likelihoods, transition, evidence.elapsed)])
    places: Ints = path[evidence.updates]
    return places


def forward_fill(belief: Floats, updates: Ints) -> Floats:
    """Beliefs (U, C) of the selected words, held over the frames between them (readings A16): (n, C).

    `updates` int64 (n,): how many selected words came up to each frame.
    """
    before = np.full((1, belief.shape[1]), 1 / belief.shape[1])
    return np.concatenate([before, belief])[updates]
