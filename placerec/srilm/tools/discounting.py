"""Which discount each order gets, from options, counts and parameter files: section 5 of our SRILM specification."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import LanguageModelError
from placerec.lm.counts import NgramCounts
from placerec.lm.discounts import (
    Context,
    Discount,
    Rule,
    absolute,
    additive,
    counts_of_counts,
    good_turing,
    good_turing_factors,
    kneser_ney_discount,
    left_neighbour_counts,
    modified_kneser_ney,
    modified_kneser_ney_discounts,
    natural,
    witten_bell,
)
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import SrilmError, Streams, tokens
from placerec.srilm.tools.options import Parsed

# In the order in which an order without a method of its own inherits the general one.
METHODS = ("ndiscount", "wbdiscount", "cdiscount", "addsmooth", "ukndiscount", "kndiscount")
NAMES = {
    "ndiscount": "NaturalDiscount",
    "wbdiscount": "WittenBell",
    "cdiscount": "ConstDiscount",
    "addsmooth": "AddSmooth",
    "ukndiscount": "KneserNey",
    "kndiscount": "ModKneserNey",
    "gt": "GoodTuring",
}
MOST_NUMBERED = 9
_PARAMETERS = ("discount1", "discount2", "discount3+")
MODIFYING = "modifying {}-gram counts for Kneser-Ney smoothing"


@dataclass(frozen=True)
class Choice:
    """The method of an order, the number that goes with it, its parameter file, counts' bounds, interpolation."""

    method: str
    value: float
    file: str | None
    minimum: float
    maximum: int
    interpolate: bool


def given_method(options: Parsed, suffix: str) -> tuple[str | None, int]:
    """The method that the options with this suffix ("" or an order) ask for, and how many different ones they name."""
    # -1, the default of -cdiscount and -addsmooth, is not given.
    named = [name for name in METHODS[:-1] if name + suffix in options.given and options[name + suffix] != -1]
    if options["kndiscount" + suffix] or options["kn" + suffix]:
        named.append("kndiscount")
    if options["gt" + suffix]:
        named.append("gt")
    return (named[0] if named else None), len(named)


def choose(options: Parsed, n: int, *, model_wanted: bool) -> Choice | None:
    """The choice for order n; None for no discounting. SrilmError (status 2) for conflicting options."""
    suffix = str(n) if n <= MOST_NUMBERED else ""
    method, many = given_method(options, suffix) if suffix else (None, 0)
    if many > 1:
        raise SrilmError(f"conflicting discounting options for order {n}", 2)
    source = suffix if method else ""
    method = method or given_method(options, "")[0] or ("gt" if model_wanted else None)
    if method is None:
        return None
    value = options[method + source] if method in ("cdiscount", "addsmooth") else 0.0
    minimum, file = options[f"gt{suffix}min"], None
    if method in ("gt", "ukndiscount", "kndiscount"):
        minimum = truncated(minimum)
        file = options[("gt" if method == "gt" else "kn") + source]
    interpolate = options["interpolate"] or options["interpolate" + suffix]
    return Choice(method, value, file, minimum, options[f"gt{suffix}max"], interpolate)


def truncated(value: float) -> float:
    """A real number as C makes an unsigned integer of it: cut at the point, modulo 2^32."""
    return float(math.trunc(value) % 2**32) if abs(value) < 2**63 else 0.0


@dataclass
class Fitter:
    """Fits the discounts of all orders in turn; the Kneser-Ney methods change the lower orders of `counts`.

    `predictable` bool (V,): words that are predicted; `meta` int64 (V,): k where a word stands for k occurrences.
    `late`: the orders whose parameters were read, and whose counts SRILM changes when estimation comes to them.
    """

    counts: NgramCounts
    predictable: Mask
    meta: Ints
    options: Parsed
    streams: Streams
    debug: int
    fractional: bool
    modified: set[int] = field(default_factory=set)
    late: list[int] = field(default_factory=list)

    def rule(self, n: int, choice: Choice, *, read: bool) -> Rule:
        """The rule of order n; with `read`, parameters come from the file. SrilmError if it cannot be fitted."""
        if self.debug:
            self.streams.say(f"using {NAMES[choice.method]} for {n}-grams")
        try:
            return self._rule(n, choice, read)
        except LanguageModelError as error:
            if str(error):
                self.streams.say(str(error))
            raise SrilmError(f"error in discount estimator for order {n}") from error

    def _rule(self, n: int, choice: Choice, read: bool) -> Rule:
        bounded = choice.minimum <= 1
        match choice.method:
            case "wbdiscount":
                return Rule(witten_bell, choice.interpolate, choice.minimum)
            case "cdiscount":
                discount = min(1.0, max(0.0, choice.value))
                return _perhaps_none(absolute(discount), choice, none=bounded and discount == 0)
            case "addsmooth":
                delta = max(0.0, choice.value)
                return _perhaps_none(_refusing(additive(delta)), choice, none=bounded and delta == 0)
            case "ndiscount":
                if self.fractional:
                    raise LanguageModelError("")
                return Rule(_refusing(natural), choice.interpolate, choice.minimum)
        if choice.file and read:
            if choice.method != "gt":
                self.late.append(n)
            return self._read(choice)
        if self.fractional:
            raise LanguageModelError("discounting method does not support float counts")
        if choice.method == "gt":
            return self._good_turing(n, choice)
        return self._kneser_ney(n, choice)

    def _good_turing(self, n: int, choice: Choice) -> Rule:
        top = max(0, choice.maximum)
        tally = counts_of_counts(self.counts, n, top + 1, self.predictable, self.meta)
        if self.debug:
            self.streams.say(f"Good-Turing discounting {n}-grams")
            for k, number in enumerate(tally.tolist()):
                self.streams.say(f"GT-count [{k}] = {number}")
        factors, warnings = good_turing_factors(tally, top)
        for warning in warnings:
            self.streams.say(warning)
        if choice.file:
            self.streams.write(choice.file, format_good_turing(int(choice.minimum), factors))
        return _good_turing_rule(factors, choice.minimum, choice.interpolate)

    def _kneser_ney(self, n: int, choice: Choice) -> Rule:
        late = self.options["kn-modify-counts-at-end"]
        if not late:
            self.prepare(n)
        modified = choice.method == "kndiscount"
        numbers = counts_of_counts(self.counts, n, 4, self.predictable, self.meta, once=True)[1:].tolist()
        if self.debug:
            self.streams.say(f"Kneser-Ney smoothing {n}-grams")
            for k, number in enumerate(numbers[: 4 if modified else 2], start=1):
                self.streams.say(f"n{k} = {number}")
        discounts: Sequence[float]
        discounts = modified_kneser_ney_discounts(*numbers) if modified else [kneser_ney_discount(*numbers[:2])]
        if self.debug:
            names = ("D1", "D2", "D3+") if modified else ("D",)
            for name, discount in zip(names, discounts, strict=True):
                self.streams.say(f"{name} = {discount:.6g}")
        if min(discounts) < 0:
            raise LanguageModelError("one of modified KneserNey discounts is negative")
        if choice.file:
            self.streams.write(choice.file, format_kneser_ney(int(choice.minimum), discounts))
        if late:
            self.prepare(n)
        return _kneser_ney_rule(discounts, choice.minimum, choice.interpolate)

    def prepare(self, n: int, *, silent: bool = False) -> bool:
        """Count left neighbours in place of occurrences (step A of section 5.3), once per order below the highest.

        Returns whether there was something to do.
        """
        if n >= self.counts.order or n in self.modified or self.options["kn-counts-modified"]:
            return False
        if self.debug and not silent:
            self.streams.say(MODIFYING.format(n))
        self.counts = left_neighbour_counts(self.counts, n, self.predictable)
        self.modified.add(n)
        return True

    def _read(self, choice: Choice) -> Rule:
        """The rule that a parameter file gives; its mincount overrides the option."""
        lines, numbers = self.streams.lines(choice.file or ""), {"mincount": choice.minimum, "maxcount": 7.0}
        for line in lines:
            key, *values = tokens(line)
            known = ("mincount", "maxcount", "discount") if choice.method == "gt" else ("mincount", *_PARAMETERS)
            found = [value for value in map(leading_float, values[: 1 + (key == "discount")]) if value is not None]
            if key not in known or len(found) != 1 + (key == "discount"):
                self.streams.say(f"{lines.position}unrecognized parameter")
                raise SrilmError(f"error in reading discount parameter file {choice.file}")
            numbers[" ".join([key, *(f"{k:.0f}" for k in found[:-1])])] = found[-1]
        if choice.method != "gt":
            discounts = [numbers.get(name, 0.0) for name in _PARAMETERS]
            return _kneser_ney_rule(discounts, numbers["mincount"], choice.interpolate)
        factors = [1.0, *(numbers.get(f"discount {k}", 0.0) for k in range(1, int(numbers["maxcount"]) + 1))]
        for k, factor in enumerate(factors):
            if factor == 0:
                self.streams.say(f"{lines.position}warning: discount coefficient {k} = 0.0")
        return _good_turing_rule(factors if len(factors) > 1 else None, numbers["mincount"], choice.interpolate)


def _perhaps_none(discount: Discount, choice: Choice, *, none: bool) -> Rule:
    """A rule whose discount is `none` where it takes off nothing: all counts are kept, however small."""
    return Rule(discount, choice.interpolate, 0 if none else choice.minimum, exhaustible=not none)


def _refusing(discount: Discount) -> Discount:
    """A discount that ends in LanguageModelError where it leaves less than nothing, of which SRILM makes nan."""

    def refusing(count: Floats, context: Context, V: int) -> tuple[Floats, Floats]:
        factor, lower = discount(count, context, V)
        finite = (count > 0) & np.isfinite(count) & np.isfinite(context.total)
        wrong = np.flatnonzero(finite & ~(factor >= 0))
        if len(wrong):
            raise LanguageModelError(
                f"a count of {count[wrong[0]]:g} in a context counted {context.total[wrong[0]]:g} times before"
                f" {context.types[wrong[0]]:g} words gets no probability by this method; choose another one"
            )
        return factor, lower

    return refusing


def _good_turing_rule(factors: Sequence[float] | None, minimum: float, interpolate: bool) -> Rule:
    exhaustible = factors is not None or minimum > 1
    return Rule(good_turing([1.0] if factors is None else factors), interpolate, minimum, exhaustible)


def _kneser_ney_rule(discounts: Sequence[float], minimum: float, interpolate: bool) -> Rule:
    rule: Discount = absolute(discounts[0]) if len(discounts) == 1 else modified_kneser_ney(*discounts)
    return Rule(rule, interpolate, minimum)


def format_good_turing(minimum: int, factors: Sequence[float] | None) -> str:
    """A Good-Turing parameter file; `factors` for counts 0, 1, ... (None: none)."""
    lines = [f"mincount {minimum}", f"maxcount {len(factors) - 1 if factors else 0}"]
    lines += [f"discount {k} {factor:.16g}" for k, factor in enumerate(factors or [1.0]) if k]
    return "".join(f"{line}\n" for line in lines)


def format_kneser_ney(minimum: int, discounts: Sequence[float]) -> str:
    number = ".16g" if len(discounts) == 1 else ".16f"
    lines = [f"{name} {value:{number}}\n" for name, value in zip(_PARAMETERS, discounts, strict=False)]
    return f"mincount {minimum}\n" + "".join(lines)
