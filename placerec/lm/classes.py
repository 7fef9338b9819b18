"""Word classes by greedy merging: the pair whose merger costs the bigrams least likelihood, again and again.

P. F. Brown and others, Class-based n-gram models of natural language (1992), section 3, as SRILM's ngram-class does it
(section T2 of our specification of SRILM's tools).
"""

import math
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import LanguageModelError

# Counts below it have their logarithms in a table.
_TABLE = 1 << 20
# Numbers that are worked on at once, and the most that two tables of bigrams may hold.
_BLOCK, _MOST = 1 << 20, 10**8
# Sums in another order differ by less, in parts of the largest term; so many pairs are compared to the last bit.
_ROUNDING, _COMPARED = 1e-11, 64


@dataclass(frozen=True)
class ClassBigrams:
    """How often classes 0..K-1 occur, int64 (K,), and which follow which, `left`, `right`, `count` int64 (m,)."""

    unigrams: Ints
    left: Ints
    right: Ints
    count: Ints

    def merged(self, target: Ints, size: int) -> "ClassBigrams":
        """The counts with class i taken for class `target[i]`, int64 (K,), of `size` classes."""
        unigrams = np.zeros(size, np.int64)
        np.add.at(unigrams, target, self.unigrams)
        keys, which = np.unique(target[self.left] * size + target[self.right], return_inverse=True)
        count = np.zeros(len(keys), np.int64)
        np.add.at(count, which, self.count)
        return ClassBigrams(unigrams, keys // max(1, size), keys % max(1, size), count)


def class_log_likelihood(words: Ints, classes: ClassBigrams) -> float:
    """log10 of the probability of all bigrams by classes; `words` (V,): how often each word occurs."""
    return float(xlogx(classes.count).sum() - 2 * xlogx(classes.unigrams).sum() + xlogx(words).sum())


def xlogx(counts: Ints) -> Floats:
    """x log10 x, 0 for 0."""
    x = counts.astype(np.float64)
    return x * np.log10(np.where(counts > 0, x, 1.0))


class Merger:
    """Merges classes, of which `active` ones, at most `most` at a time, are candidates.

    A class is named by the lowest number among those merged into it. `cost` float64 (A, A): what merging the classes
    of two slots does to the log-likelihood (log10), -inf where there is no pair. LanguageModelError if the tables of
    so many candidates would not fit.
    """

    def __init__(self, bigrams: ClassBigrams, most: int) -> None:
        size = len(bigrams.unigrams)
        if most * size > _MOST:
            raise LanguageModelError(
                f"{most} candidates among {size} classes need tables of {most * size * 2:.3g} counts; "
                "ask for fewer classes, or put rare words aside first"
            )
        self.bigrams = bigrams
        total = int(bigrams.count.sum()) + int(bigrams.unigrams.sum())
        dtype = np.int32 if total < 2**31 else np.int64
        self.table = xlogx(np.arange(min(total, _TABLE) + 1))
        self.tabled = total <= _TABLE
        self.rounding = _ROUNDING * max(1.0, float(xlogx(np.array([total]))[0]))
        self.unigrams = bigrams.unigrams.copy()
        self.target = np.arange(size)
        self.members = {i: [i] for i in range(size)}
        self.slots = np.full(most, -1)
        # Of the class in each slot: how often each class follows it, and precedes it.
        self.after, self.before = np.zeros((most, size), dtype), np.zeros((most, size), dtype)
        self.cost = np.full((most, most), -np.inf)
        self.by_left, self.by_right = np.argsort(bigrams.left, kind="stable"), np.argsort(bigrams.right, kind="stable")
        self.left_ends = np.searchsorted(bigrams.left[self.by_left], np.arange(size + 1))
        self.right_ends = np.searchsorted(bigrams.right[self.by_right], np.arange(size + 1))

    @property
    def active(self) -> Ints:
        """The classes that are candidates."""
        return self.slots[self.slots >= 0]

    def add(self, number: int) -> None:
        """Make a class that was not merged a candidate."""
        slot = int(np.flatnonzero(self.slots < 0)[0])
        followers = self.by_left[self.left_ends[number] : self.left_ends[number + 1]]
        leaders = self.by_right[self.right_ends[number] : self.right_ends[number + 1]]
        np.add.at(self.after[slot], self.target[self.bigrams.right[followers]], self.bigrams.count[followers])
        np.add.at(self.before[slot], self.target[self.bigrams.left[leaders]], self.bigrams.count[leaders])
        self.slots[slot] = number
        self._weigh(slot)

    def remove(self, number: int) -> None:
        """A class is no longer a candidate."""
        self._clear(self._slot(number))

    def best(self) -> tuple[int, int]:
        """The pair of candidates that cost least, the lower number first; of equal pairs the first.

        Sums that differ by no more than rounding are formed again, each rounded once only, to tell equal ones.
        """
        near = np.argwhere(self.cost >= self.cost.max() - self.rounding)
        pairs = np.sort(self.slots[near], axis=1)
        ordered = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        found = [(int(a), int(b)) for a, b in ordered[::2].tolist()]
        if 1 < len(found) <= _COMPARED:
            return max(found, key=lambda pair: self.exact_cost(*pair))
        return found[0]

    def neighbours(self, number: int) -> tuple[Ints, Ints]:
        """How often each class follows a candidate, and precedes it, int64 (K,) each."""
        slot = self._slot(number)
        return self.after[slot].astype(np.int64), self.before[slot].astype(np.int64)

    def exact_cost(self, a: int, b: int) -> float:
        """What merging two candidates does to the log-likelihood, log10, rounded once."""
        (a_after, a_before), (b_after, b_before) = self.neighbours(a), self.neighbours(b)
        corner = np.concatenate([a_after[[a, b]], b_after[[a, b]]])
        terms = [*self._xlogx(corner.sum(keepdims=True)), *(-self._xlogx(corner))]
        own = self.unigrams[[a, b]]
        terms += [*(-2 * self._xlogx(own.sum(keepdims=True))), *(2 * self._xlogx(own))]
        for x, y in ((a_after, b_after), (a_before, b_before)):
            x[[a, b]] = 0
            both = np.flatnonzero((x > 0) & (y > 0))
            terms += [*self._xlogx(x[both] + y[both]), *(-self._xlogx(x[both])), *(-self._xlogx(y[both]))]
        return math.fsum(map(float, terms))

    def merge(self, a: int, b: int) -> None:
        """Merge candidate b into candidate a, a lower number."""
        s, t = self._slot(a), self._slot(b)
        for side in (self.after, self.before):
            self._rejoin(side[:, a].astype(np.int64), side[:, b].astype(np.int64), s, t)
            side[s] += side[t]
            side[:, a] += side[:, b]
            side[:, b] = 0
        self.unigrams[a] += self.unigrams[b]
        self.unigrams[b] = 0
        moved = self.members.pop(b)
        self.target[moved] = a
        self.members[a] += moved
        self._clear(t)
        self._weigh(s)

    def _slot(self, number: int) -> int:
        return int(np.flatnonzero(self.slots == number)[0])

    def _clear(self, slot: int) -> None:
        self.slots[slot] = -1
        self.after[slot] = self.before[slot] = 0
        self.cost[slot] = self.cost[:, slot] = -np.inf

    def _rejoin(self, x: Ints, y: Ints, s: int, t: int) -> None:
        """Bring the costs of the other pairs up to date where columns x and y (A,) become one."""
        x[[s, t]] = y[[s, t]] = 0
        few, many = (x, y) if np.count_nonzero(x) < np.count_nonzero(y) else (y, x)
        rows, columns = np.flatnonzero(few), np.flatnonzero(few + many)
        for part in np.array_split(rows, len(rows) * len(columns) // _BLOCK + 1) if len(rows) else []:
            change = self._joint((few + many)[part], (few + many)[columns])
            change -= self._joint(few[part], few[columns]) + self._joint(many[part], many[columns])
            self.cost[np.ix_(part, columns)] += change
            # Pairs of two of the fewer come twice as they are; the others also the other way round.
            others = few[columns] == 0
            self.cost[np.ix_(columns[others], part)] += change[:, others].T

    def _joint(self, x: Ints, y: Ints) -> Floats:
        """What two counts gain by being one: for all of x (r,) with all of y (c,)."""
        together = self._xlogx(x[:, None] + y[None, :])
        together -= self._xlogx(x)[:, None] + self._xlogx(y)[None, :]
        return together

    def _xlogx(self, counts: Ints) -> Floats:
        return self.table[counts] if self.tabled else xlogx(counts)

    def _weigh(self, slot: int) -> None:
        """The costs of all pairs with the class in a slot."""
        others = np.flatnonzero(self.slots >= 0)
        others = others[others != slot]
        a, classes = int(self.slots[slot]), self.slots[others]
        cost = np.zeros(len(others))
        for side in (self.after, self.before):
            near = np.flatnonzero(side[slot])
            own = side[slot, near].astype(np.int64)
            begin = 0
            for part in np.array_split(others, len(others) * len(near) // _BLOCK + 1):
                theirs = side[np.ix_(part, near)].astype(np.int64)
                gain = self._xlogx(theirs + own).sum(axis=1) - self._xlogx(theirs).sum(axis=1)
                cost[begin : begin + len(part)] += gain - self._xlogx(own).sum()
                begin += len(part)
        aa, ab = self.after[slot, a].astype(np.int64), self.after[slot, classes].astype(np.int64)
        ba, bb = self.after[others, a].astype(np.int64), self.after[others, classes].astype(np.int64)
        # Among themselves the two are no neighbours like others: four counts become one.
        cost += self._xlogx(aa + ab + ba + bb) + self._xlogx(aa) + self._xlogx(ab) + self._xlogx(ba) + self._xlogx(bb)
        cost -= self._xlogx(aa + ba) + self._xlogx(ab + bb) + self._xlogx(aa + ab) + self._xlogx(ba + bb)
        own_unigrams, theirs = self.unigrams[a], self.unigrams[classes]
        cost -= 2 * (self._xlogx(own_unigrams + theirs) - self._xlogx(own_unigrams) - self._xlogx(theirs))
        self.cost[slot, others] = self.cost[others, slot] = cost
