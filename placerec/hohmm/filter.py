"""The Bayesian filter of eq. 1: a belief over places, one word at a time.

With selected words z_1, z_2, ... and places c: bel(x_t = c) is in proportion to P(z_t | z_{t-n:t-1}, c) times the
predicted belief; before the first word it is uniform (readings A2 to A4). If no place explains a word, the prediction
is kept. `filter_step` does one word in plain floats, `filter_stream` a whole sequence in arrays; they agree to 1e-12.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray

from placerec.hohmm.motion import Motion, matrix_predictor, motion, total
from placerec.hohmm.transitions import Transition

LN10 = log(10.0)
# Updates that follow each other while all blocks go on side by side. The blocks' borders must not depend on the length
# of the sequence, or later words would change the last digit of earlier beliefs.
BLOCK = 256
# Steps between two normalisations of a block's operator: by a factor of at most MIXING each, they cannot underflow.
UNSCALED = 8
# Numbers in the operators of the blocks that go on side by side: they should stay in cache.
SIDE_BY_SIDE = 1 << 15
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Filtered:
    """Beliefs float64 (T, C) after each of T words; `explained` bool (T,): some place gives the word a probability."""

    belief: Floats = field(repr=False)
    explained: Mask = field(repr=False)

    @property
    def unexplained(self) -> int:
        """How many words no place could explain."""
        return int((~self.explained).sum())


def filter_step(predicted: list[float], log10_p: Sequence[float]) -> tuple[list[float], bool]:
    """The log belief (C) after a word with log10_p (C) in each place, and whether any place explains it."""
    weighed = [b + p * LN10 for b, p in zip(predicted, log10_p, strict=True)]
    top = max(weighed)
    if top == -inf:
        return predicted, False
    whole = top + log(sum([exp(x - top) for x in weighed]))
    return [x - whole for x in weighed], True


def filter_stream(log10_p: Floats, transition: Transition, elapsed: Floats | None = None) -> Filtered:
    """Filter one sequence: `log10_p` float64 (T, C) of each word in each place, after the words before it.

    `elapsed` float64 (T,): steps of the transitions since the word before; the first is not used; None: 1 each.
    """
    if not len(log10_p):
        return Filtered(np.empty(log10_p.shape), np.empty(0, bool))
    steps = motion(transition, (np.ones(len(log10_p)) if elapsed is None else elapsed)[1:])
    if steps.mixes:
        return _scan(log10_p, steps)
    logs, explained = _word_by_word(log10_p, steps)
    belief = np.exp(logs)
    return Filtered(belief / belief.sum(axis=1, keepdims=True), explained)


def filter_logs(log10_p: Floats, steps: Motion) -> tuple[Floats, Mask]:
    """Log beliefs (T, C) and what is explained (T,); `steps` (T-1): the predictions between T >= 1 words."""
    if not steps.mixes:
        return _word_by_word(log10_p, steps)
    filtered = _scan(log10_p, steps)
    with np.errstate(divide="ignore"):
        return np.log(filtered.belief), filtered.explained


def _word_by_word(log10_p: Floats, steps: Motion) -> tuple[Floats, Mask]:
    """The same for transitions that do not mix: slow, and right for the smallest beliefs."""
    places = log10_p.shape[1]
    log_belief = [-log(places)] * places
    beliefs, explained = [], []
    for t, row in enumerate(log10_p.tolist()):
        predicted = matrix_predictor(steps.matrices(slice(t - 1, t))[:, :, 0])(log_belief) if t else log_belief
        log_belief, known = filter_step(predicted, row)
        beliefs.append(log_belief)
        explained.append(known)
    return np.array(beliefs), np.array(explained, bool)


def _scan(log10_p: Floats, steps: Motion) -> Filtered:
    """The filter in two passes over blocks of words that go on side by side; `steps` (T-1) must mix.

    The first pass finds what each block does to any belief, its operator; then the beliefs at the borders follow from
    each other; the second pass fills the blocks.
    """
    T, C = log10_p.shape
    top = log10_p.max(axis=1)
    explained = top > -np.inf
    belief = np.empty((C, T))
    together = BLOCK * max(1, SIDE_BY_SIDE // C**2)
    state = np.empty(C)
    for start in range(0, T, together):
        stop = min(start + together, T)
        known = explained[start:stop, None]
        with np.errstate(invalid="ignore"):
            weight = np.where(known, np.exp((log10_p[start:stop] - top[start:stop, None]) * LN10), 1.0)
        weight = np.ascontiguousarray(weight.T)
        if start == 0:
            state = weight[:, 0] / weight[:, 0].sum()
            belief[:, 0] = state
            start, weight = 1, weight[:, 1:]
        state = _scan_blocks(weight, steps, start - 1, state, belief[:, start:stop])
    return Filtered(np.ascontiguousarray(belief.T), explained)


def _scan_blocks(weight: Floats, steps: Motion, first: int, state: Floats, belief: Floats) -> Floats:
    """Fill `belief` (C, n) of n words with `weight` (C, n), whose predictions are `first`... of `steps`.

    `state` (C,): the belief before them; what is returned is the one after them.
    """
    C, n = weight.shape
    if not n:
        return state
    starts = np.empty((C, -(-n // BLOCK)))
    starts[:, 0] = state
    operators = _operators(weight[:, : n // BLOCK * BLOCK], steps, first)
    for block in range(1, starts.shape[1]):
        after = total(starts[:, block - 1, None] * operators[:, :, block - 1])
        starts[:, block] = after / after.sum()
    states = starts
    for s in range(min(BLOCK, n)):
        here = weight[:, s::BLOCK]
        # The last block may be shorter than the others.
        states = steps.predict(states[:, : here.shape[1]], slice(first + s, first + n, BLOCK)) * here
        states /= total(states)
        belief[:, s::BLOCK] = states
    return belief[:, -1]


def _operators(weight: Floats, steps: Motion, first: int) -> Floats:
    """What each block of words makes of a belief that is all in one place: float64 (C before, C after, blocks)."""
    C, n = weight.shape
    operators = np.repeat(np.eye(C)[:, :, None], n // BLOCK, axis=2)
    for s in range(min(BLOCK, n)):
        operators = steps.predict(operators, slice(first + s, first + n, BLOCK)) * weight[:, s::BLOCK]
        if s % UNSCALED == UNSCALED - 1:
            operators /= operators.max(axis=(0, 1))
    return operators
