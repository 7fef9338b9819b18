"""Smoothings by name: a discount, fitted to the counts where it has to be, for interpolation or for back-off.

Names without `-backoff` are interpolated. Their SRILM options stand in `SRILM_OPTIONS`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from placerec.arrays import Mask
from placerec.errors import LanguageModelError
from placerec.lm.counts import NgramCounts
from placerec.lm.discounts import (
    Discount,
    absolute,
    additive,
    counts_of_counts,
    jelinek_mercer,
    kneser_ney_discount,
    left_neighbour_counts,
    lidstone,
    modified_kneser_ney,
    modified_kneser_ney_discounts,
    witten_bell,
)

T = TypeVar("T")

# The one that looks at sentences, too.
JELINEK_MERCER = "jelinek-mercer"

# What an order's counts and discount become: (counts, order, words that are predicted) -> (counts, discount).
Fit = Callable[[NgramCounts, int, Mask], tuple[NgramCounts, Discount]]


@dataclass(frozen=True)
class Smoothing:
    """How discounts are found, and whether they are used for interpolation or for back-off.

    `delta`: that of the lidstone and absolute ones, None for the others.
    """

    name: str
    fit: Fit
    interpolate: bool
    delta: float | None = None

    def __repr__(self) -> str:
        delta = "" if self.delta is None else f", delta={self.delta:g}"
        return f"Smoothing({self.name!r}{delta})"


def smoothing(name: str, delta: float | None = None, sentences: Sequence[Sequence[str]] = ()) -> Smoothing:
    """The smoothing of that name (SMOOTHINGS lists them).

    `delta`: what the lidstone ones add to every count (default 1, above 0), or what the absolute ones take off
    (default 0.5, above 0 and at most 1). `sentences`: those that are counted, which jelinek-mercer holds out in turn to
    find its weights; without any they are 1/2. Raises LanguageModelError for an unknown name, or a delta that leaves
    unseen words without probability.
    """
    if name not in SMOOTHINGS:
        raise LanguageModelError(f"smoothing {name!r} is unknown; choose one of {', '.join(SMOOTHINGS)}")
    base = name.removesuffix("-backoff")
    delta = default_delta(name) if delta is None else delta
    if not 0 < delta < float("inf") or (base == "absolute" and delta > 1):
        bounds = "above 0 and at most 1" if base == "absolute" else "above 0"
        raise LanguageModelError(f"delta {delta:g} must be a number {bounds}: it is what unseen words live on")
    if name == JELINEK_MERCER:
        return Smoothing(name, _jelinek_mercer(sentences), True)
    return Smoothing(
        name, _FITS.get(name, _FITS[base])(delta), name == base, delta if base in ("lidstone", "absolute") else None
    )


def default_delta(name: str) -> float:
    """The delta of a smoothing if none is given."""
    return 0.5 if name.startswith("absolute") else 1.0


def _fixed(discount: Discount) -> Fit:
    return lambda counts, n, predictable: (counts, discount)


def _jelinek_mercer(sentences: Sequence[Sequence[str]]) -> Fit:
    # Not needed by the others.
    from placerec.lm.held_out import bins_of, held_out_weights

    return lambda counts, n, predictable: (
        counts,
        jelinek_mercer(held_out_weights(counts, n, predictable, sentences), bins_of),
    )


def _kneser_ney(counts: NgramCounts, n: int, predictable: Mask) -> tuple[NgramCounts, Discount]:
    """Kneser & Ney 1995: one discount an order, lower orders by numbers of left neighbours."""
    counts, tally = _neighbours(counts, n, predictable)
    return counts, absolute(_explained(n, tally, lambda: kneser_ney_discount(*tally[:2])))


def _modified_kneser_ney(counts: NgramCounts, n: int, predictable: Mask) -> tuple[NgramCounts, Discount]:
    """Chen & Goodman 1998: three discounts an order."""
    counts, tally = _neighbours(counts, n, predictable)
    discounts = _explained(n, tally, lambda: modified_kneser_ney_discounts(*tally))
    if min(discounts) < 0:
        shown = ", ".join(f"{discount:.3g}" for discount in discounts)
        raise LanguageModelError(
            f"modified Kneser-Ney fails at order {n}: its discounts come out as {shown}; {_REMEDY}"
        )
    return counts, modified_kneser_ney(*discounts)


_REMEDY = "closed vocabularies of few words are like that; use witten-bell"


def _neighbours(counts: NgramCounts, n: int, predictable: Mask) -> tuple[NgramCounts, list[int]]:
    if n < counts.order:
        counts = left_neighbour_counts(counts, n, predictable)
    return counts, counts_of_counts(counts, n, 4, predictable, np.zeros(len(predictable), np.int64))[1:].tolist()


def _explained(n: int, tally: list[int], compute: Callable[[], T]) -> T:
    try:
        return compute()
    except LanguageModelError as error:
        seen = ", ".join(f"n{k} = {number}" for k, number in enumerate(tally, start=1))
        raise LanguageModelError(
            f"Kneser-Ney fails at order {n}: it needs n-grams seen once, twice and more; there are {seen}; {_REMEDY}"
        ) from error


# Those that are fitted alike for interpolation and for back-off stand under the former's name.
_FITS: dict[str, Callable[[float], Fit]] = {
    "witten-bell": lambda delta: _fixed(witten_bell),
    "lidstone": lambda delta: _fixed(lidstone(delta)),
    "lidstone-backoff": lambda delta: _fixed(additive(delta)),
    "absolute": lambda delta: _fixed(absolute(delta)),
    "kneser-ney": lambda delta: _kneser_ney,
    "modified-kneser-ney": lambda delta: _modified_kneser_ney,
}

# The options of ngram-count for each smoothing; None: it has none.
SRILM_OPTIONS: dict[str, str | None] = {
    "witten-bell": "-wbdiscount -interpolate",
    "witten-bell-backoff": "-wbdiscount",
    "lidstone": None,
    "lidstone-backoff": "-addsmooth {delta:g}",
    "absolute": "-cdiscount {delta:g} -interpolate",
    "absolute-backoff": "-cdiscount {delta:g}",
    "kneser-ney": "-ukndiscount -interpolate",
    "kneser-ney-backoff": "-ukndiscount",
    "modified-kneser-ney": "-kndiscount -interpolate",
    "modified-kneser-ney-backoff": "-kndiscount",
    JELINEK_MERCER: None,
}
SMOOTHINGS = tuple(SRILM_OPTIONS)
