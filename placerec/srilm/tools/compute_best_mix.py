"""compute-best-mix: the weights of a mixture from several models' `ngram -debug 2 -ppl` outputs (section 13)."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats
from placerec.lm.logs import LEAST_LOG10, LN10
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.assignments import HELP

TOOL = "compute-best-mix"
USAGE = 'usage: {tool} [lambda="L1 L2 ..."] [precision=P] PPL1 PPL2 ...  (outputs of ngram -debug 2 -ppl)'
# Beyond this, exp ends.
_MOST = 709.0
# The line of a token: the word, what stands before its log10 p, this, and how often it counts.
TOKEN_LINE = re.compile(r"\tp\( (\S+) \| (.*) \[ (\S+)(?: \*(\S+))? \](?: / \S+)?\s*$")


@exit_status
def compute_best_mix(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Find the weights, tell each step on stderr and the result on stdout; returns the exit status."""
    settings = dict(argument.split("=", 1) for argument in arguments if re.match(r"(lambda|precision)=", argument))
    names = [argument for argument in arguments if not re.match(r"(lambda|precision)=", argument)]
    if not names or names[0] in HELP:
        raise SrilmError(USAGE.format(tool=tool), 0 if names else 2)
    precision = leading_float(settings.get("precision", "0.001"))
    if precision is None or not precision > 0:
        raise SrilmError(f"{tool}: precision={settings['precision']}: a number above 0 is needed", 2)
    start = starting_weights(settings.get("lambda", "0.5"), len(names), tool)
    log10_p, counts = _tokens(names, streams, tool)
    known = (log10_p > LEAST_LOG10).any(axis=0)
    log10_p, counts = log10_p[:, known], counts[known]
    weights, steps = best_mix(np.exp(log10_p * LN10), start, precision, counts=counts)
    total = float(counts.sum())
    for number, step in enumerate(steps, start=1):
        ppl = math.exp(min(-step.loglik / total, _MOST))
        streams.say(f"iteration {number}, lambda = ({_shown(step.weights)}), ppl = {ppl:g}")
    cumulative = np.cumsum(weights)
    pairwise = np.divide(weights, cumulative, out=np.zeros_like(weights), where=cumulative > 0)
    pairwise[0] = 1
    streams.print(f"{total:g} non-oov words, best lambda ({_shown(weights)})\n")
    streams.print(f"pairwise cumulative lambda ({_shown(pairwise)})\n")
    return 0


def starting_weights(text: str, models: int, tool: str = TOOL) -> list[float]:
    """The weights that `lambda=` names, which need not sum to 1; what is left to 1 is shared by the other models."""
    given = [leading_float(word) for word in text.split()][:models]
    weights = [weight for weight in given if weight is not None and 0 <= weight <= 1]
    left = 1 - sum(weights)
    others = models - len(weights)
    if len(weights) < len(given) or (others and left < -1e-6):
        raise SrilmError(f"{tool}: lambda={text}: numbers between 0 and 1 are needed that do not exceed 1 in sum", 2)
    if not others:
        if not any(weights):
            raise SrilmError(f"{tool}: lambda={text}: not all weights may be 0", 2)
        return weights
    return weights + [max(0.0, left) / others] * others


def _tokens(names: Sequence[str], streams: Streams, tool: str) -> tuple[Floats, Floats]:
    """What each model gives each token, log10, float64 (M, T), and how often each occurs, (T,)."""
    columns = []
    for name in names:
        found = [match.group(3, 4) for match in map(TOKEN_LINE.match, streams.lines(name)) if match]
        log10_p = [_log10(text) for text, _ in found]
        columns.append((np.array(log10_p), np.array([_count(times) if times else 1.0 for _, times in found])))
        if len(found) != len(columns[0][0]):
            raise SrilmError(f"mismatch in number of samples ({len(columns[0][0])} != {len(found)})")
    return np.array([log10_p for log10_p, _ in columns]).reshape(len(names), -1), columns[0][1]


def _log10(text: str) -> float:
    value = leading_float(text)
    if value is None or math.isnan(value):
        return LEAST_LOG10
    return min(max(LEAST_LOG10, value), -LEAST_LOG10 / 2)


def _count(text: str) -> float:
    value = leading_float(text)
    return value if value is not None and 0 <= value < math.inf else 1.0


def _shown(weights: Floats) -> str:
    return " ".join(f"{weight:g}" for weight in weights.tolist())


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
    counts = np.ones(p.shape[1]) if counts is None else counts
    weights, total = np.array(start, np.float64), float(counts.sum())
    # What a token's probabilities have in common does not matter to the weights, and could be too small to divide by.
    common = p.max(axis=0, initial=0.0)
    ratio, shift = p / common, float(np.log(common) @ counts)
    steps: list[MixStep] = []
    while total > 0:
        share = weights[:, None] * ratio
        mixed = np.maximum(share.sum(axis=0), np.finfo(np.float64).smallest_subnormal)
        steps.append(MixStep(weights, float(np.log(mixed) @ counts) + shift))
        weights = (share / mixed) @ counts / total
        if float(np.abs(weights - steps[-1].weights).max()) <= precision:
            break
    return weights, steps
