"""The Bayesian filter of eq. 1: a belief over places, one word at a time.

With selected words z_1, z_2, ... and places c: bel(x_t = c) is in proportion to P(z_t | z_{t-n:t-1}, c) times the
predicted belief; before the first word it is uniform (readings A2 to A4). If a word has
probability 0 in every place, the prediction is kept. `filter_stream` filters a whole sequence in arrays, `OnlineFilter`
one word at a time in plain floats; they agree to 1e-12.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, inf, log

import numpy as np

from placerec.arrays import Floats, Mask
from placerec.hohmm.prediction import Predict, TransitionSteps, matrix_predictor, predictor, total, transition_steps
from placerec.hohmm.transitions import Transition
from placerec.lm.logs import LN10

# Updates that follow each other while all blocks go on side by side. The blocks' borders must not depend on the length
# of the sequence, or later words would change the last digit of earlier beliefs.
BLOCK = 256
# Steps between two normalisations of a block's operator: each leaves MIXING of it at least, so that none underflows.
UNSCALED = 8
# Numbers in the operators of the blocks that go on side by side: they should stay in cache.
SIDE_BY_SIDE = 1 << 15
# How many distinct times between updates have their transitions kept on-line.
PREDICTORS = 1024


def normalised(logs: Floats) -> Floats:
    """Probabilities (..., C) in proportion to exp(logs), rows sum to 1."""
    p = np.exp(logs - logs.max(axis=-1, keepdims=True))
    probabilities: Floats = p / p.sum(axis=-1, keepdims=True)
    return probabilities


@dataclass(frozen=True)
class Filtered:
    """Beliefs float64 (T, C) after each of T words; `possible` bool (T,): some place gives the word a probability."""

    belief: Floats = field(repr=False)
    possible: Mask = field(repr=False)

    @property
    def zero_likelihood_words(self) -> int:
        """How many words had probability 0 in every place."""
        return int((~self.possible).sum())


def filter_step(predicted: list[float], log10_likelihoods: Sequence[float]) -> tuple[list[float], bool]:
    """The log belief (C) after a word, and whether any place gives the word a probability above 0."""
    weighed = [b + p * LN10 for b, p in zip(predicted, log10_likelihoods, strict=True)]
    top = max(weighed)
    if top == -inf:
        return predicted, False
    whole = top + log(sum([exp(x - top) for x in weighed]))
    return [x - whole for x in weighed], True


def filter_stream(log10_likelihoods: Floats, transition: Transition, elapsed: Floats | None = None) -> Filtered:
    """Filter one sequence: `log10_likelihoods` float64 (T, C) of each word in each place, after the words before it.

    `elapsed` float64 (T,): steps of the transitions since the word before; the first is not used; None: 1 each.
    """
    if not len(log10_likelihoods):
        return Filtered(np.empty(log10_likelihoods.shape), np.empty(0, bool))
    steps = transition_steps(transition, (np.ones(len(log10_likelihoods)) if elapsed is None else elapsed)[1:])
    # Which words are scanned depends on none that come later: these never change the last digit of a belief.
    scanned = _scan(log10_likelihoods[: steps.mixing + 1], steps)
    if steps.mixing == steps.count:
        return scanned
    # Before a prediction that does not mix, what underflows counts: the last word is taken again in logarithms.
    with np.errstate(divide="ignore"):
        logs, possible = _word_by_word(log10_likelihoods, steps, np.log(scanned.belief[:-1]))
    belief = np.exp(logs[1:])
    belief /= belief.sum(axis=1, keepdims=True)
    return Filtered(np.concatenate([scanned.belief, belief]), np.concatenate([scanned.possible, possible[1:]]))


def filter_logs(log10_likelihoods: Floats, steps: TransitionSteps) -> tuple[Floats, Mask]:
    """Log beliefs (T, C) and which words are possible (T,); `steps` (T-1): the predictions between T >= 1 words."""
    if steps.mixing < steps.count:
        return _word_by_word(log10_likelihoods, steps, np.empty((0, log10_likelihoods.shape[1])))
    filtered = _scan(log10_likelihoods, steps)
    with np.errstate(divide="ignore"):
        return np.log(filtered.belief), filtered.possible


def _word_by_word(log10_likelihoods: Floats, steps: TransitionSteps, known: Floats) -> tuple[Floats, Mask]:
    """Log beliefs (n, C) and which words are possible (n,), in logarithms: slow, and right for the smallest beliefs.

    Of the words (T, C) behind the first ones, whose log beliefs are `known` (T - n, C).
    """
    places = log10_likelihoods.shape[1]
    log_belief = known[-1].tolist() if len(known) else [-log(places)] * places
    beliefs, possible = [], []
    for t, row in enumerate(log10_likelihoods[len(known) :].tolist(), start=len(known)):
        predicted = matrix_predictor(steps.matrices(slice(t - 1, t))[:, :, 0])(log_belief) if t else log_belief
        log_belief, explained = filter_step(predicted, row)
        beliefs.append(log_belief)
        possible.append(explained)
    return np.array(beliefs), np.array(possible, bool)


def _scan(log10_likelihoods: Floats, steps: TransitionSteps) -> Filtered:
    """The filter in two passes over blocks of words that go on side by side; `steps` (T-1) must mix.

    The first pass finds what each block does to any belief, its operator; then the beliefs at the borders follow from
    each other; the second pass fills the blocks.
    """
    T, C = log10_likelihoods.shape
    belief, possible = np.empty((T, C)), np.empty(T, bool)
    first, possible[:1] = _likelihoods(log10_likelihoods[:1].T.copy())
    belief[0] = first[:, 0] / first[:, 0].sum()
    together = BLOCK * max(1, SIDE_BY_SIDE // C**2)
    for start in range(1, T, together):
        words = slice(start, min(start + together, T))
        n = words.stop - start
        weight, known = _likelihoods(_side_by_side(log10_likelihoods[words]))
        possible[words] = known.T.reshape(-1)[:n]
        belief[words] = _fill(weight, steps, start - 1, n, belief[start - 1])
    return Filtered(belief, possible)


def _side_by_side(rows: Floats) -> Floats:
    """A copy of rows (n, C) as float64 (BLOCK, C, blocks), the last block filled up."""
    blocks = -(-len(rows) // BLOCK)
    if len(rows) < blocks * BLOCK:
        rows = np.concatenate([rows, np.zeros((blocks * BLOCK - len(rows), rows.shape[1]))])
    return rows.reshape(blocks, BLOCK, -1).transpose(1, 2, 0).copy()


def _likelihoods(logs: Floats) -> tuple[Floats, Mask]:
    """From log10 likelihoods (..., C, m) to likelihoods, the largest of each 1, and where (..., m) any is above 0.

    Where there is none all are 1. The argument is overwritten.
    """
    top = logs.max(axis=-2)
    possible = top > -np.inf
    logs -= np.where(possible, top, 0.0)[..., None, :]
    if not possible.all():
        logs[...] = np.where(possible[..., None, :], logs, 0.0)
    logs *= LN10
    return np.exp(logs, out=logs), possible


def _fill(weight: Floats, steps: TransitionSteps, first: int, n: int, state: Floats) -> Floats:
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
        steps.predict(states, at)
        states *= weight[s, :, : states.shape[1]]
        states /= total(states)
        weight[s, :, : states.shape[1]] = states
    return weight.transpose(2, 0, 1).reshape(-1, C)[:n]


def _operators(weight: Floats, steps: TransitionSteps, first: int) -> Floats:
    """What blocks of words make of a belief that is all in one place: (C before, C after, blocks).

    `weight` (B, C, blocks): likelihoods of the words; `steps` from `first` on: the predictions before them.
    """
    B, C, blocks = weight.shape
    operators = np.repeat(np.eye(C)[:, :, None], blocks, axis=2)
    if not blocks:
        return operators
    for s in range(B):
        steps.predict(operators, slice(first + s, first + blocks * B, B))
        operators *= weight[s]
        if s % UNSCALED == UNSCALED - 1:
            operators /= operators.max(axis=(0, 1))
    return operators


class OnlineFilter:
    """A belief over C states that change by `transition`, from `prior` (C) on; `log_belief`: its natural logarithms."""

    def __init__(self, transition: Transition, prior: Sequence[float]) -> None:
        self._transition = transition
        self._prior = [log(p) for p in prior]
        self._predictors: dict[float, Predict] = {}
        self.reset()

    def reset(self) -> None:
        """Believe the prior again."""
        self.log_belief = self._prior

    def predict(self, steps: float) -> None:
        """Let `steps` steps of the transitions pass."""
        predict = self._predictors.get(steps)
        if predict is None:
            if len(self._predictors) == PREDICTORS:
                self._predictors.clear()
            predict = self._predictors[steps] = predictor(self._transition, steps)
        self.log_belief = predict(self.log_belief)

    def condition_on(self, log10_likelihoods: Sequence[float]) -> bool:
        """Take in a word with log10 p (C) in each state; whether any state gives it a probability above 0."""
        self.log_belief, possible = filter_step(self.log_belief, log10_likelihoods)
        return possible

    def belief(self) -> Floats:
        """The belief, float64 (C,); sums to 1."""
        belief = np.array([exp(b) for b in self.log_belief])
        normal: Floats = belief / belief.sum()
        return normal
