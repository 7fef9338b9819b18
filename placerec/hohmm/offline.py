"""What is believed of every frame of a sequence that is known to its end."""

from dataclasses import replace

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm import smoothing, unknown
from placerec.hohmm.evidence import Evidence
from placerec.hohmm.filter import filter_stream
from placerec.hohmm.motion import predict_beliefs
from placerec.hohmm.transitions import Transition
from placerec.hohmm.unknown import UnknownModel


def believe(
    evidence: Evidence, transition: Transition, *, smooth: bool = False, lag: int | None = None
) -> tuple[Floats, int]:
    """The belief float64 (n, C) at every frame, and how many words no place explained.

    By default that of the filter: from the words up to the frame. `smooth`: from all words. `lag`: from the words up
    to that many frames later. A frame without a selected word is believed to be where the last frame with one was;
    before the first one all places are equally probable.
    """
    log10_p, elapsed, frames = evidence.log10_p, evidence.elapsed, len(evidence.selected)
    filtered = filter_stream(log10_p, transition, elapsed)
    if lag is not None and lag < frames:
        updates = evidence.updates
        known = updates[np.minimum(np.arange(frames) + lag, frames - 1)]
        started = updates > 0
        belief = np.full((frames, log10_p.shape[1]), 1 / log10_p.shape[1])
        if started.any():
            belief[started] = smoothing.smooth_lagged(
                log10_p, transition, elapsed, updates[started] - 1, known[started] - 1
            )
        return belief, filtered.unexplained
    if smooth or lag is not None:
        return hold(smoothing.smooth(log10_p, transition, elapsed), evidence), filtered.unexplained
    return hold(filtered.belief, evidence), filtered.unexplained


def believe_unknown(
    evidence: Evidence,
    transition: Transition,
    model: UnknownModel,
    distances: Floats,
    *,
    smooth: bool = False,
    lag: int | None = None,
) -> Floats:
    """The probability at every frame that the place is none of the known ones, float64 (n,).

    `distances` (U,): of the selected words, nan where unknown. What counts, and what is held, is as in `believe`.
    """
    places = evidence.log10_p.shape[1]
    ratios = unknown_ratios(evidence, transition, model, distances)
    chain = replace(evidence, log10_p=unknown.chain_evidence(ratios, places))
    belief, _ = believe(chain, unknown.CHAIN, smooth=smooth, lag=lag)
    before, _ = unknown.prior(places)
    return np.where(evidence.updates > 0, belief[:, 0], before)


def unknown_ratios(evidence: Evidence, transition: Transition, model: UnknownModel, distances: Floats) -> Floats:
    """What each selected word says of a new place, float64 (U,): `unknown.evidence` beside the filter of the places."""
    log10_p, elapsed = evidence.log10_p, evidence.elapsed
    predicted = predict_beliefs(filter_stream(log10_p, transition, elapsed).belief, transition, elapsed)
    return unknown.evidence(model, log10_p, predicted, distances)


def most_probable_path(evidence: Evidence, transition: Transition) -> Ints:
    """The number of each frame's place on the most probable path, int64 (n,); 0 before the first selected word."""
    path = np.concatenate([[0], smoothing.viterbi(evidence.log10_p, transition, evidence.elapsed)])
    places: Ints = path[evidence.updates]
    return places


def hold(belief: Floats, evidence: Evidence) -> Floats:
    """Beliefs (U, C) of the selected words, held over the frames between them (readings A16): (n, C)."""
    before = np.full((1, belief.shape[1]), 1 / belief.shape[1])
    return np.concatenate([before, belief])[evidence.updates]
