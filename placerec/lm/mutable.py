"""A model that changes: backed-off values, backoff weights, left-over mass; section 6 of our SRILM specification.

A Trace hears what an estimation has to tell while it works: the base says nothing, a listener overrides what it wants
to hear. Contexts of order n are given to it as rows of order n-1 (row 0 stands for the empty context where n is 1).

Log probabilities and weights are stored in float32 and computed in float64 from what is stored: the roundings, and
the order of the operations, are what makes the printed digits equal.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.backoff import BackoffModel
from placerec.lm.logs import EPSILON, log10, p_of
from placerec.lm.score import Ngrams, ScoreTables, build_tables
from placerec.lm.trie import Trie, per_context, runs, united_trie
from placerec.lm.vocabulary import Vocabulary


class Trace:
    """A listener that hears nothing.

    `every_attempt`: it wants to hear of each time that a context is done again; `every_step`: of all of it.
    """

    every_attempt = every_step = False

    def discarded_contexts(self, n: int, count: int) -> None:
        """`count` contexts of order n end in </s> or hold a closed <unk>."""

    def discarded_ngrams(self, n: int, non_events: int, discounted: int) -> None:
        """N-grams of order n left out: their last word is not predictable; their count is below the minimum."""

    def probabilities(
        self,
        n: int,
        attempt: int,
        rows: Ints,
        count: Floats,
        total: Floats,
        factor: Floats,
        lower: tuple[Floats, Singles] | None,
        log10_p: Singles,
    ) -> None:
        """All that went into the n-grams `rows` (m,): `lower` is weight and log10 p of the shorter context, if used."""

    def no_mass(
        self, n: int, attempt: int, contexts: Ints, group: Ints, rows: Ints, p: Floats, *, interpolated: bool
    ) -> None:
        """Contexts that leave nothing to unseen words: done again without interpolation, or with a larger total.

        `rows` (m,): n-grams of the contexts `contexts[group]`, with probability p.
        """

    def again(self, n: int, attempt: int, context: int, rows: Ints, p: Floats) -> None:
        """What `no_mass` says of one context, k times from an attempt on, p (k, m) of its n-grams `rows` (m,)."""

    def order_done(self, n: int) -> None:
        """All probabilities of order n are there; the weights of its contexts come next."""

    def full_contexts(self, n: int, contexts: Ints) -> None:
        """Contexts that have seen every word: their probabilities are scaled to sum to 1."""

    def overfull_contexts(self, n: int, contexts: Ints, mass: Floats) -> None:
        """Contexts whose probabilities sum to more than 1."""

    def scarce_contexts(self, n: int, contexts: Ints, mass: Floats, minimum: float) -> None:
        """Contexts that leave less than `minimum`: scaled."""

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        """Backoff weights, and the masses that they are the ratio of."""

    def unigram_mass(self, mass: float, words: int, *, everyone: bool) -> None:
        """Mass that goes to the words without probability, or to everyone."""

    def lacking(self, missing: Sequence[Ints], is_context: Sequence[Mask]) -> None:
        """N-grams, rows per order, that will get a line because a longer context needs them."""

    def inserted(self, n: int, rows: Ints) -> None:
        """N-grams that got a line because a longer context needs them."""

    def trials(
        self, n: int, rows: Ints, context: Singles, old: Singles, new: Singles, entropy: Floats, gone: Mask
    ) -> None:
        """What taking out each of the n-grams `rows` (m,) of order n would do, and whether it is `gone`.

        `context`: log10 of the joint probability of the context; `old`, `new`: log10 p with the n-gram and without;
        `entropy`: how far the model moves (relative entropy, base 10).
        """

    def improbable(self, n: int, rows: Ints, log10_p: Singles, backed_off: Singles) -> None:
        """N-grams of order n that are taken out, as they are less probable than by backing off."""

    def pruned(self, n: int, rows: Ints) -> None:
        """N-grams of order n taken out, perhaps none."""


SILENT = Trace()
_NO_VALUES = np.zeros(0, np.float32)


@dataclass
class MutableModel:
    """A back-off model while it changes; every array lies beside the rows of `trie`, which lists every ending.

    `predictable` (V,): words that get a probability; `alias_counts` (V,): how many names a word has. `stored`: has a
    log probability of its own, `log10_p`. `is_context`: is a context of the model, with the weight `backoff`. `base` +
    `weight`: the log probability by back-off, `base` of the longest stored ending and `weight` the backoff weights paid
    on the way, summed from short contexts to long.
    """

    trie: Trie
    predictable: Mask
    alias_counts: Ints = field(default_factory=lambda: np.ones(0, np.int64))
    stored: list[Mask] = field(default_factory=list)
    log10_p: list[Singles] = field(default_factory=list)
    is_context: list[Mask] = field(default_factory=list)
    backoff: list[Singles] = field(default_factory=list)
    base: list[Singles] = field(default_factory=list)
    weight: list[Singles] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not len(self.alias_counts):
            self.alias_counts = np.ones(len(self.predictable), np.int64)
        for keys in self.trie.keys:
            for mask in (self.stored, self.is_context):
                mask.append(np.zeros(len(keys), bool))
            self.log10_p.append(np.full(len(keys), -np.inf, np.float32))
            self.backoff.append(np.zeros(len(keys), np.float32))
        # There once they are refreshed.
        self.base = [_NO_VALUES] * self.order
        self.weight = [_NO_VALUES] * self.order

    @property
    def order(self) -> int:
        return self.trie.order

    @property
    def names(self) -> int:
        """How many names the words that get a probability have: SRILM takes each for a word where it counts words."""
        return int(self.alias_counts[self.predictable].sum())

    def backed_off(self, n: int, part: slice = slice(None)) -> Singles:
        """log10 p float32 (m_n,) of every row of order n, or of a part of the rows; `refresh` first."""
        return self.base[n - 1][part] + self.weight[n - 1][part]

    def refresh(self, n: int) -> None:
        """Bring the backed-off values of order n up to date with what is stored; shorter orders must be."""
        if n == 1:
            self.base[0], self.weight[0] = self.log10_p[0], np.zeros(len(self.log10_p[0]), np.float32)
            return
        base = self.log10_p[n - 1].copy()
        weight = np.zeros(len(base), np.float32)
        rows = np.flatnonzero(~self.stored[n - 1])
        if len(rows):
            shorter, context = self.trie.suffixes[n - 1][rows], self.trie.prefix(n)[rows]
            paid = np.where(self.is_context[n - 2][context], self.backoff[n - 2][context], np.float32(0))
            base[rows] = self.base[n - 2][shorter]
            weight[rows] = self.weight[n - 2][shorter] + paid
        self.base[n - 1], self.weight[n - 1] = base, weight

    def refresh_shorter(self) -> None:
        """Bring the backed-off values of all orders but the highest up to date."""
        for n in range(1, self.order):
            self.refresh(n)

    def refresh_all(self) -> None:
        """Bring all backed-off values up to date."""
        for n in range(1, self.order + 1):
            self.refresh(n)

    def context_places(self, n: int) -> Ints:
        """How many contexts of length n stand before each row of order n, int64 (m_n,)."""
        is_context = self.is_context[n - 1]
        places: Ints = np.cumsum(is_context) - is_context
        return places

    def add_contexts(self, n: int, rows: Ints) -> None:
        """Make rows of order n contexts; a context's ending is one too."""
        for k in range(n, 0, -1):
            self.is_context[k - 1][rows] = True
            if k > 1:
                shorter = np.zeros(len(self.is_context[k - 2]), bool)
                shorter[self.trie.suffixes[k - 1][rows]] = True
                rows = np.flatnonzero(shorter)

    def tables(self, numbers: Ints, size: int) -> ScoreTables:
        """The tables that give words a probability; there the word numbers are `numbers` int64 (V,), below `size`."""
        orders = [
            [Ngrams(numbers[self.trie.matrix(n)], log10_p, backoff, is_context, stored)]
            for n, (log10_p, backoff, is_context, stored) in enumerate(
                zip(self.log10_p, self.backoff, self.is_context, self.stored, strict=True), start=1
            )
        ]
        return build_tables(size, orders)

    def model(self) -> BackoffModel:
        """The model without the rows that hold nothing; the prefixes of what is stored must be stored."""
        backoffs = [
            np.where(is_context, backoff, np.float32(np.nan)).astype(np.float32)[stored]
            for is_context, backoff, stored in zip(self.is_context, self.backoff, self.stored, strict=True)
        ]
        return BackoffModel(
            self.trie.keep(self.stored),
            tuple(log10_p[stored] for log10_p, stored in zip(self.log10_p, self.stored, strict=True)),
            tuple(backoffs),
        )


def unite(
    models: Sequence[MutableModel], vocabulary: Vocabulary, predictable: Mask, alias_counts: Ints | None = None
) -> list[MutableModel]:
    """Models over one trie: that of the rows of all of them, and of `vocabulary`, which must list all their words.

    `predictable` bool (V,), `alias_counts` int64 (V,): fields of MutableModel.
    """
    trie, rows = united_trie(vocabulary, [model.trie for model in models])
    united = []
    for model, row_of in zip(models, rows, strict=True):
        wider = MutableModel(trie, predictable, np.zeros(0, np.int64) if alias_counts is None else alias_counts)
        for n, row in enumerate(row_of[: model.order]):
            wider.stored[n][row] = model.stored[n]
            wider.log10_p[n][row] = model.log10_p[n]
            wider.is_context[n][row] = model.is_context[n]
            wider.backoff[n][row] = model.backoff[n]
        wider.refresh_all()
        united.append(wider)
    return united


def weigh_contexts(model: MutableModel, n: int, trace: Trace, *, minimum: float | None = None) -> None:
    """Section 6.5: the backoff weights of all contexts of length n-1, from the stored n-grams of order n.

    `minimum`: the least mass that backing off must leave (`-minbackoff`, section 11.1).
    """
    rows = np.flatnonzero(model.stored[n - 1])
    if n == 1:
        left = float(1 - p_of(model.log10_p[0][rows]).sum())
        if minimum is not None and 0 - left > EPSILON:
            trace.scarce_contexts(1, np.zeros(1, np.int64), np.array([left]), 0.0)
            model.log10_p[0][rows] += np.float32(-np.log10(1 - left))
            left = 0.0
        left = 0.0 if abs(left) < EPSILON else left
        if left < 0:
            trace.overfull_contexts(1, np.zeros(1, np.int64), np.array([left]))
        else:
            spread_unigram_mass(model, left, trace)
        trace.weights(1, np.zeros(1, np.int64), np.array([left]), np.ones(1), log10(np.array([left])))
        return
    contexts = np.flatnonzero(model.is_context[n - 2])
    group = model.context_places(n - 1)[model.trie.prefix(n)[rows]]
    num, den, overfull = settle_masses(model, n, rows, group, contexts, minimum, trace)
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where((num < EPSILON) & (den < EPSILON), 0, np.log10(num) - np.log10(den)).astype(np.float32)
    weight[overfull] = -np.inf
    model.backoff[n - 2][contexts] = weight
    trace.weights(n, contexts, num, den, weight)


def settle_masses(
    model: MutableModel, n: int, rows: Ints, group: Ints, contexts: Ints, minimum: float | None, trace: Trace
) -> tuple[Floats, Floats, Mask]:
    """Steps 1 to 4 of section 6.5: what `rows`, n-grams of the contexts `contexts[group]`, leave to backing off.

    Per context 1 - sum p, and 1 - sum p by the shorter context, float64 (C,), and which sums are above 1, bool (C,).
    Contexts that have seen every word, and those that leave less than `minimum`, are scaled.
    """
    shorter = model.backed_off(n - 1)[model.trie.suffixes[n - 1][rows]]
    num = 1 - per_context(group, len(contexts), p_of(model.log10_p[n - 1][rows]))
    den = 1 - per_context(group, len(contexts), p_of(shorter))
    if minimum is not None and (scarce := minimum - num > EPSILON).any():
        trace.scarce_contexts(n, contexts[scarce], num[scarce], minimum)
        scale = np.where(scarce, np.log10(1 - minimum) - np.log10(1 - np.where(scarce, num, 0)), 0).astype(np.float32)
        model.log10_p[n - 1][rows] += scale[group]
        num[scarce] = minimum
    num[np.abs(num) < EPSILON] = 0
    den[np.abs(den) < EPSILON] = 0
    stuck = (den < EPSILON) & (num > EPSILON)
    if stuck.any():
        trace.full_contexts(n, contexts[stuck])
        scale = np.where(stuck, -np.log10(1 - np.where(stuck, num, 0)), 0).astype(np.float32)
        model.log10_p[n - 1][rows] += scale[group]
    num[stuck] = den[stuck] = 0
    overfull = num < 0
    if overfull.any():
        trace.overfull_contexts(n, contexts[overfull], num[overfull])
    nothing = ~overfull & (den <= 0)
    num[nothing] = den[nothing] = 0
    return num, den, overfull


def spread_unigram_mass(model: MutableModel, mass: float, trace: Trace) -> None:
    """Section 6.6: what the seen unigrams leave goes to the words without one, or to all if there are none."""
    model.stored[0] |= model.predictable
    zero = model.predictable & np.isneginf(model.log10_p[0])
    if zero.any():
        # SRILM shares by names: a word with an alias takes one share and leaves the other.
        shares = int(model.alias_counts[zero].sum())
        trace.unigram_mass(mass, shares, everyone=False)
        model.log10_p[0][zero] = log10(np.array([mass / shares]))
        return
    if mass > 0:
        trace.unigram_mass(mass, model.names, everyone=True)
    # To a word with several names its share is added as often.
    for times in range(int(model.alias_counts.max(initial=0))):
        named = model.predictable & (model.alias_counts > times)
        model.log10_p[0][named] = log10(p_of(model.log10_p[0][named]) + mass / max(1, model.names))


def insert_prefixes(model: MutableModel, trace: Trace) -> None:
    """Section 6.7: a context needs a line for the weight; those without one get one, with log10 p by back-off."""
    trie = model.trie
    missing: list[Ints] = [np.zeros(0, np.int64)] * trie.order
    needed = np.zeros(0, np.int64)
    for n in range(trie.order - 1, 0, -1):
        lacking = model.is_context[n - 1] & ~model.stored[n - 1]
        lacking[needed[~model.stored[n - 1][needed]]] = True
        missing[n - 1] = np.flatnonzero(lacking)
        needed = runs(trie.prefix(n)[missing[n - 1]])[0] if n > 1 else needed
    trace.lacking(missing, model.is_context)
    for n, rows in enumerate(missing, start=1):
        model.refresh(n)
        model.log10_p[n - 1][rows] = model.backed_off(n)[rows]
        model.stored[n - 1][rows] = True
        if n > 1:
            model.add_contexts(n - 1, runs(trie.prefix(n)[rows])[0])
        model.refresh(n)
        if len(rows):
            trace.inserted(n, rows)


def reweigh(model: MutableModel, trace: Trace, *, minimum: float | None = None) -> None:
    """Recompute all backoff weights, and spread what the unigrams leave (`-renorm`, section 11.1).

    The backed-off values of the highest order, which no weight depends on, are not refreshed.
    """
    for n in range(1, model.order + 1):
        weigh_contexts(model, n, trace, minimum=minimum)
        if n < model.order:
            model.refresh(n)
