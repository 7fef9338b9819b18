"""The paper's claims O1 to O11 (readings 2.1), each judged by numbers and intervals.

A claim is made of statements, each a difference of accuracies in points (percent of the frames) and a threshold. It
holds if the whole 95 % interval is on the claimed side, it does not hold if the whole interval is on the other side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats
from placerec.evaluation.bootstrap import LEAST, middle
from placerec.experiments.grid.results import MissingCellsError, Results, Scores, mean, scores

HOLDS, FAILS, CANNOT_TELL, NOT_TRIED = "holds", "does not hold", "cannot tell", "not in the grid"
# Points: what counts as several percent, as no more than a little, and as among the best.
SEVERAL, LITTLE, AMONG = 2.0, 2.0, 1.0
HIGH = 80.0
NONE, THREE, FIVE, COMPRESS, UNIQUE = "none", "subsample:3", "subsample:5", "compress:3", "unique"
# Of the smoothings in a grid, the first of these stands for the paper's (readings A11, A12).
WITTEN_BELL = ("witten-bell", "witten-bell-backoff")
LIDSTONE = ("lidstone-backoff", "lidstone")


@dataclass(frozen=True)
class Statement:
    """`text` says what `values` (1 + DRAWS,) are, in points; they should be `above` the threshold, `below` or `within`.

    `values` is None where the grid lacks cells, and holds the number alone where there is nothing to draw. A `reason`
    says why there is no verdict.
    """

    text: str
    values: Floats | None
    side: str = "above"
    threshold: float = 0.0
    reason: str = ""

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval."""
        if self.values is None or len(self.values) == 1:
            return None
        return middle(self.values[1:], float(self.values[0]))

    @property
    def verdict(self) -> str:
        """HOLDS, FAILS, CANNOT_TELL or NOT_TRIED."""
        if self.values is None:
            return NOT_TRIED
        if self.reason or self.interval is None:
            return CANNOT_TELL
        (low, high), t = self.interval, self.threshold
        if self.side == "within":
            return HOLDS if -t < low and high < t else FAILS if low >= t or high <= -t else CANNOT_TELL
        if self.side == "below":
            low, high, t = -high, -low, -t
        return HOLDS if low > t else FAILS if high <= t else CANNOT_TELL

    @property
    def wanted(self) -> str:
        """The threshold in words."""
        return f"{self.side} {'±' if self.side == 'within' else ''}{self.threshold:g}"


@dataclass(frozen=True)
class Claim:
    """One of the paper's claims, judged."""

    name: str
    text: str
    statements: Sequence[Statement]

    @property
    def verdict(self) -> str:
        """HOLDS if all statements hold, FAILS if one does not, NOT_TRIED if the grid has the cells of none."""
        verdicts = {statement.verdict for statement in self.statements}
        if len(verdicts) == 1:
            return verdicts.pop()
        return FAILS if FAILS in verdicts else CANNOT_TELL


def judge(results: Results, transition: str) -> list[Claim]:
    """All claims, by the cells with these transitions and the paper's smoothings (all, if the grid has none)."""
    rows = [row for row in results.rows if row.transition == transition]
    paper = {name for family in (WITTEN_BELL, LIDSTONE) for name in family[:1] if name in {r.smoothing for r in rows}}
    found = scores([row for row in rows if row.smoothing in paper or not paper])
    reason = ""
    if len(found.sequences) < LEAST:
        number = len(found.sequences)
        reason = f"{number} test sequence{'s' * (number != 1)}; a verdict needs {LEAST} or more"
    stated = [(term.claim, _stated(term, found, reason)) for term in TERMS]
    return [Claim(name, text, [one for of, one in stated if of == name]) for name, text in CLAIMS.items()]


@dataclass(frozen=True)
class ClaimTerm:
    """A statement of a claim, before it is asked of a grid; `text` may name the {small} and the {large} map."""

    claim: str
    text: str
    values: Callable[[Scores], Floats]
    side: str = "above"
    threshold: float = 0.0


def _stated(term: ClaimTerm, s: Scores, reason: str) -> Statement:
    text, values = term.text.format(small=s.size[0], large=s.size[-1]), None
    try:
        values = term.values(s) if len(s.sequences) > 1 else term.values(s)[:1]
    except MissingCellsError as error:
        reason = str(error)
    return Statement(text, values, term.side, term.threshold, reason)


def _at_20(s: Scores, family: Sequence[str], select: str) -> Floats:
    """The cells of S = 20, a family of smoothings and a selection."""
    return s.take(size=[20], smoothing=[_one_of(s, family)], select=[select])


def _one_of(s: Scores, family: Sequence[str]) -> str:
    """The grid's smoothing of a family; MissingCellsError if there is none."""
    for name in family:
        if name in s.smoothing:
            return name
    raise MissingCellsError(f"the grid has no smoothing {' or '.join(family)}")


def _gain(s: Scores, select: Sequence[str], *, over: str = NONE, order: Sequence[int] | None = None) -> Floats:
    """What selections gain over another, cell by cell."""
    return s.take(select=select, order=order) - s.take(select=[over], order=order)


def _slope(s: Scores, cells: Floats) -> Floats:
    """Points per step of n, by least squares over the mean at each order: (a, b, c, d, draws) to (draws,)."""
    if len(s.order) < 2:
        raise MissingCellsError("the grid has one order only")
    n = np.array(s.order, np.float64) - np.mean(s.order)
    slope: Floats = np.einsum("d,dn->n", n / (n @ n), cells.mean(axis=(0, 1, 2)))
    return slope


def _highest(cells: Floats) -> Floats:
    """The cell that is best on all sequences, (draws,): chosen once, not anew in every draw."""
    flat = cells.reshape(-1, cells.shape[-1])
    best: Floats = flat[int(flat[:, 0].argmax())]
    return best


def _others(s: Scores, without: str) -> list[str]:
    return [name for name in s.select if name != without]


def _spread(s: Scores, select: str) -> Floats:
    """How far the accuracies of n >= 2 lie apart, mean over sizes and smoothings."""
    orders = [n for n in s.order if n > 1]
    if len(orders) < 2:
        raise MissingCellsError("the grid has no two orders above 1")
    apart: Floats = np.ptp(s.take(select=[select], order=orders), axis=3).mean(axis=(0, 1, 2))
    return apart


def _of_large_map(s: Scores) -> Floats:
    if len(s.size) < 2:
        raise MissingCellsError("the grid has one size only")
    return mean(s.take(size=[s.size[-1]]) - s.take(size=[s.size[0]]))


def _of_selection(s: Scores) -> Floats:
    return mean(_gain(s, _others(s, NONE)))


def _best_with_five(s: Scores) -> Floats:
    own, others = _highest(_at_20(s, WITTEN_BELL, FIVE)), s.accuracy.copy()
    others[s.size.index(20), s.smoothing.index(_one_of(s, WITTEN_BELL)), s.select.index(FIVE)] = 0
    return own - _highest(others)


def _of_compress(s: Scores) -> Floats:
    gain = _gain(s, [COMPRESS])
    kept = np.array([[not (size == 20 and name in WITTEN_BELL) for name in s.smoothing] for size in s.size], bool)
    if not kept.any():
        raise MissingCellsError("the grid has nothing but S = 20 with Witten-Bell")
    average: Floats = gain[kept].mean(axis=(0, 1, 2))
    return average


def _behind_with_unique(s: Scores) -> Floats:
    best = s.take(select=_others(s, UNIQUE)).max(axis=2, keepdims=True)
    return -_highest(best - s.take(select=[UNIQUE]))


def _spread_with_unique(s: Scores) -> Floats:
    own, others = _spread(s, UNIQUE), [_spread(s, name) for name in _others(s, UNIQUE)]
    if not others:
        raise MissingCellsError("the grid has no other selection")
    least: Floats = np.min(others, axis=0)
    return own - least


def _of_witten_bell(s: Scores) -> Floats:
    return s.take(smoothing=[_one_of(s, WITTEN_BELL)]) - s.take(smoothing=[_one_of(s, LIDSTONE)])


def _of_long_contexts(s: Scores, select: Sequence[str] | None = None) -> Floats:
    above = [n for n in s.order if n > 2]
    return mean(s.take(order=above, select=select) - s.take(order=[2], select=select))


CLAIMS = {
    "O1": "A larger map gives better results.",
    "O2": "Word selection generally increases the results by several percent.",
    "O3": "Subsample with s = 3 is efficient, sometimes by 6 %.",
    "O4": "s = 5 gains less; with S = 20 it loses with Lidstone and is best of all with Witten-Bell.",
    "O5": "Compress is usually efficient, except with S = 20 and Witten-Bell.",
    "O6": "Unique is always among the best, and least sensitive to n.",
    "O7": "The effect of selection grows with n.",
    "O8": "Witten-Bell is slightly better than Lidstone, mainly for large n.",
    "O9": "n = 2 is a clear improvement over n = 1.",
    "O10": "n > 2 has little effect; without selection results drop.",
    "O11": "Recognition rates are already quite high.",
}
_SELECTION = "selection minus none, mean over selections and all cells"
# fmt: off
TERMS = (
    ClaimTerm("O1", "S = {large} minus S = {small}, mean over all cells", _of_large_map),
    ClaimTerm("O2", _SELECTION, _of_selection),
    ClaimTerm("O2", f"{_SELECTION}: several percent", _of_selection, "above", SEVERAL),
    ClaimTerm("O3", "s = 3 minus none, mean over all cells", lambda s: mean(_gain(s, [THREE]))),
    ClaimTerm("O3", "s = 3 minus none, in the cell where it gains most",
              lambda s: _highest(_gain(s, [THREE])), "above", 6.0),
    ClaimTerm("O4", "s = 5 minus s = 3, mean over all cells", lambda s: mean(_gain(s, [FIVE], over=THREE)), "below"),
    ClaimTerm("O4", "S = 20, Lidstone: s = 5 minus none, mean over n",
              lambda s: mean(_at_20(s, LIDSTONE, FIVE) - _at_20(s, LIDSTONE, NONE)), "below"),
    ClaimTerm("O4", "S = 20, Witten-Bell: the best n with s = 5 minus the best of all other cells", _best_with_five),
    ClaimTerm("O5", "compress minus none, mean over all cells but S = 20 with Witten-Bell", _of_compress),
    ClaimTerm("O5", "S = 20, Witten-Bell: compress minus none, mean over n",
              lambda s: mean(_at_20(s, WITTEN_BELL, COMPRESS) - _at_20(s, WITTEN_BELL, NONE)), "below", AMONG),
    ClaimTerm("O6", "unique minus the best other strategy, in the cell where it is worst",
              _behind_with_unique, "above", -AMONG),
    ClaimTerm("O6", "spread over n >= 2 with unique minus the smallest of the other strategies",
              _spread_with_unique, "below"),
    ClaimTerm("O7", "what selection gains over none, more for each step of n",
              lambda s: _slope(s, _gain(s, _others(s, NONE)))),
    ClaimTerm("O8", "Witten-Bell minus Lidstone, mean over all cells", lambda s: mean(_of_witten_bell(s))),
    ClaimTerm("O8", "Witten-Bell minus Lidstone, more for each step of n", lambda s: _slope(s, _of_witten_bell(s))),
    ClaimTerm("O9", "n = 2 minus n = 1, mean over all cells", lambda s: mean(s.take(order=[2]) - s.take(order=[1]))),
    ClaimTerm("O10", "n > 2 minus n = 2, mean over all cells", _of_long_contexts, "within", LITTLE),
    ClaimTerm("O10", "without selection: n > 2 minus n = 2, mean over sizes and smoothings",
              lambda s: _of_long_contexts(s, [NONE]), "below"),
    ClaimTerm("O11", "frames right in the best cell, percent", lambda s: _highest(s.accuracy), "above", HIGH),
    ClaimTerm("O11", "the best cell minus always the most frequent place", lambda s: _highest(s.accuracy) - s.majority),
)
# fmt: on
