"""The Bayesian filter of eq. 1: a belief over places, one word at a time.

With selected words z_1, z_2, ... and places c: bel(x_t = c) is in proportion to P(z_t | z_{t-n:t-1}, c) times the
predicted belief; before the first word it is uniform (readings A2 to A4). If no place explains a word, the prediction
is kept. `filter_step` does one word in plain floats, `filter_stream` a whole sequence in arrays; they agree to 1e-12.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, inf, log

import numpy as np

from placerec.arrays import Floats, Mask
from placerec.hohmm.motion import Motion, matrix_predictor, motion, total
from placerec.hohmm.transitions import Transition

LN10 = log(10.0)
# Updates that follow each other while all blocks go on side by side. The blocks' borders must not depend on the length
# of the sequence, or later words would change the last digit of earlier beliefs.
BLOCK = 256
# Steps between two normalisations of a block's operator: each leaves MIXING of it at least, so that none underflows.
UNSCALED = 8
# Numbers in the operators of the blocks that go on side by side: they should stay in cache.
SIDE_BY_SIDE = 1 << 15


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
    belief, explained = np.empty((T, C)), np.empty(T, bool)
    first, explained[:1] = _weigh(log10_p[:1].T.copy())
    belief[0] = first[:, 0] / first[:, 0].sum()
    together = BLOCK * max(1, SIDE_BY_SIDE // C**2)
    for start in range(1, T, together):
        words = slice(start, min(start + together, T))
        n = words.stop - start
        weight, known = _weigh(_side_by_side(log10_p[words]))
        explained[words] = known.T.reshape(-1)[:n]
        belief[words] = _fill(weight, steps, start - 1, n, belief[start - 1])
    return Filtered(belief, explained)


def _side_by_side(rows: Floats) -> Floats:
    """A copy of rows (n, C) as float64 (BLOCK, C, blocks), the last block filled up."""
    blocks = -(-len(rows) // BLOCK)
    if len(rows) < blocks * BLOCK:
        rows = np.concatenate([rows, np.zeros((blocks * BLOCK - len(rows), rows.shape[1]))])
    return rows.reshape(blocks, BLOCK, -1).transpose(1, 2, 0).copy()


def _weigh(logs: Floats) -> tuple[Floats, Mask]:
    """Of log10 p (..., C, m): probabilities in proportion, the largest 1, and where (..., m) there is any above 0.

    Where there is none all are 1. The argument is overwritten.
    """
    top = logs.max(axis=-2)
    explained = top > -np.inf
    logs -= np.where(explained, top, 0.0)[..., None, :]
    if not explained.all():
        logs[...] = np.where(explained[..., None, :], logs, 0.0)
    logs *= LN10
    return np.exp(logs, out=logs), explained


def _fill(weight: Floats, steps: Motion, first: int, n: int, state: Floats) -> Floats:
    """Beliefs (n, C) after n words with `weight` (BLOCK, C, blocks), whose predictions are `first`... of `steps`.

    `state` (C,): the belief before them.
    """
    B, C, blocks = weight.shape
    states = np.empty((C, blocks))
    states[:, 0] = state
    operators = _operators(weight[:, :, : blocks - 1], steps, first)
    for block, operator in enumerate(np.ascontiguousarray(operators.transpose(2, 0, 1)), start=1):
        # Not BLAS, whose sums depend on the number of its threads.
        state = np.einsum("i,ij->j", state, operator)
        states[:, block] = state = state / state.sum()
    for s in range(min(B, n)):
        at = slice(first + s, first + n, B)
        # The last block may be shorter than the others.
        states = states[:, : -(-(n - s) // B)]
        steps.advance(states, at)
        states *= weight[s, :, : states.shape[1]]
        states /= total(states)
        weight[s, :, : states.shape[1]] = states
    return weight.transpose(2, 0, 1).reshape(-1, C)[:n]


def _operators(weight: Floats, steps: Motion, first: int) -> Floats:
    """What blocks of words make of a belief that is all in one place: (C before, C after, blocks).

    `weight` (B, C, blocks); arguments as of `_fill`.
    """
    B, C, blocks = weight.shape
    operators = np.repeat(np.eye(C)[:, :, None], blocks, axis=2)
    if not blocks:
        return operators
    for s in range(B):
        steps.advance(operators, slice(first + s, first + blocks * B, B))
        operators *= weight[s]
        if s % UNSCALED == UNSCALED - 1:
            operators /= operators.max(axis=(0, 1))
    return operators
