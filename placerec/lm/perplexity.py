"""What the probabilities of a text's words sum up to: sections 10.1 and 10.2 of our SRILM specification."""

import math
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.logs import EPSILON, LN10

TOP_RANKS = (1, 5, 10)
# From here on, exp ends.
_LARGEST = 308.0


class Totals(NamedTuple):
    """Sums over a text. Words without probability are counted (`oovs`: unknown, `zeroprobs`: known), not penalised.

    `log10_p`: of the others; `words`: without the </s> at sentence ends.
    """

    sentences: float = 0
    words: float = 0
    oovs: float = 0
    zeroprobs: float = 0
    log10_p: float = 0

    def plus(self, other: "Totals") -> "Totals":
        """Both texts together."""
        return Totals(*(a + b for a, b in zip(self, other, strict=True)))

    def times(self, weight: float) -> "Totals":
        """The totals of the text when it is counted `weight` times."""
        return Totals(*(weight * value for value in self))

    @property
    def ppl(self) -> float | None:
        """Per word and sentence end; None where nothing was predicted."""
        return _perplexity(self.log10_p, self.words - self.oovs - self.zeroprobs + self.sentences)

    @property
    def ppl1(self) -> float | None:
        """Per word, sentence ends' probabilities included but not counted (SRILM's ppl1)."""
        return _perplexity(self.log10_p, self.words - self.oovs - self.zeroprobs)


def _perplexity(log10_p: float, predicted: float) -> float | None:
    if predicted <= 0:
        return None
    with np.errstate(over="ignore"):
        return float(np.exp(np.float64(log10_p / predicted) * -LN10))


def tally_sentences(log10_p: Singles, unknown: Mask, scored: Mask, lengths: Ints, ended: Mask) -> Floats:
    """The totals of S sentences of T words, float64 (S, 5), columns as the fields of Totals.

    `log10_p` float32 (T,), `unknown` bool (T,) of the words, `scored` bool (T,): which count; `lengths` int64 (S,);
    `ended` bool (S,): the last word is the end.
    """
    some = np.flatnonzero(lengths)
    starts = (np.cumsum(lengths) - lengths)[some]
    counted = log10_p.copy()
    counted[~scored] = 0
    zero = counted == -np.inf
    columns = [(4, counted)]
    if zero.any():
        counted[zero] = 0
        columns += [(2, zero & unknown), (3, zero & ~unknown)]
    totals = np.zeros((len(lengths), 5))
    totals[:, 0] = ended
    for k, column in columns if len(some) else ():
        totals[some, k] = np.add.reduceat(column, starts, dtype=np.float64)
    silent = some[np.searchsorted(starts, np.flatnonzero(~scored), "right") - 1]
    totals[:, 1] = lengths - ended - np.bincount(silent, minlength=len(lengths))
    return totals


class Ranks(NamedTuple):
    """How well words are told from others: `tokens` and, of them, `words` (without sentence ends).

    `leading` and `leading_words` (3,): tokens and words whose rank is below 1, 5 and 10. `square` and `absolute`: the
    sums of (1-p)^2 and 1-p.
    """

    words: float = 0
    tokens: float = 0
    leading_words: tuple[float, ...] = (0, 0, 0)
    leading: tuple[float, ...] = (0, 0, 0)
    square: float = 0
    absolute: float = 0

    def plus(self, other: "Ranks") -> "Ranks":
        """Both texts' tokens together."""
        return Ranks(
            self.words + other.words,
            self.tokens + other.tokens,
            tuple(a + b for a, b in zip(self.leading_words, other.leading_words, strict=True)),
            tuple(a + b for a, b in zip(self.leading, other.leading, strict=True)),
            self.square + other.square,
            self.absolute + other.absolute,
        )


def rank_word(
    log10_p: float, everyone: Singles, *, known: bool, end: bool, marker: bool = False, weight: float = 1
) -> Ranks:
    """The ranks of one token among words of log10 p `everyone`; `known`: not unknown; `end`: a sentence end.

    `marker`: a </s>, perhaps within a sentence, which is counted among the words there, but not for its rank.
    """
    # Not numpy's: all digits of the losses are printed.
    p = math.inf if log10_p > _LARGEST else math.exp(log10_p * LN10)
    place = rank(p, np.exp(everyone.astype(np.float64) * LN10))
    leading = tuple(weight * (place < top) for top in TOP_RANKS)
    # What over-full models give too much of is no loss.
    loss = (1 - p if not p > 1 else 0.0) if p > 0 or known else 0.0
    word = 0 if end else weight
    none = (0.0, 0.0, 0.0)
    return Ranks(word, weight, none if end or marker else leading, leading, weight * loss * loss, weight * loss)


def rank(p: float, all_p: Floats) -> int:
    """How many words are more probable than a word of probability `p`; of those as probable as it, half count."""
    above = int((all_p - p >= EPSILON).sum())
    return above + int((np.abs(all_p - p) < EPSILON).sum()) // 2
