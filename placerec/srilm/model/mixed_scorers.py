"""What `ngram` puts around a model, or several: mixtures, a cache, and exceptions for unknown words and zeros."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.lm.logs import p_of
from placerec.lm.mix import Cache, loglinear, mixed, posteriors, with_cache
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import Model, Scored, Scorer, event_numbers
from placerec.srilm.text.vocabulary import WordList


class Mixture:
    """The mean of several models (-bayes), weighted by how well they predicted the last `length` words.

    `detailed`: print the probabilities of the components.
    """

    def __init__(
        self,
        models: Sequence[Model],
        weights: Sequence[float],
        length: int,
        scale: float,
        detailed: bool,
        sequence: TokenSequence,
    ) -> None:
        self.views = [model(sequence) for model in models]
        self.length, self.detailed = length, detailed
        if length > 0:
            self.posteriors = posteriors(weights, np.stack([view.joint(length) for view in self.views]), scale)
        else:
            plain = np.array(weights, np.float64)
            self.posteriors = np.repeat(plain[:, None] / plain.sum(), len(sequence.ids), axis=1)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        parts = [view.score(words) for view in self.views]
        log10_probs = np.stack([part.log10_p for part in parts])

        def tag(t: int) -> str:
            found = "".join(part.tag(t) for part in parts)
            if self.length > 0:
                found += "[post=" + ",".join(f"{weight:.7g}" for weight in self.posteriors[:, t]) + "]"
            if self.detailed:
                found += "[probs=" + ",".join(f"{p:.7g}" for p in p_of(log10_probs[:, t])) + "]"
            return found

        return Scored(mixed(log10_probs, self.posteriors), tag)

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        return mixed(np.stack([view.distribution(t) for view in self.views]), self.posteriors[:, t])


class LogLinear:
    """The normalised product of powers of several models (-loglinear-mix); normalisers are kept per context."""

    def __init__(
        self, models: Sequence[Model], weights: Sequence[float], words: WordList, sequence: TokenSequence
    ) -> None:
        self.weights, self.sequence = weights, sequence
        self.views = [model(sequence) for model in models]
        self.events = event_numbers(words)
        self.used = np.max([view.contexts.lengths for view in self.views], axis=0)
        self.sums: dict[tuple[int, ...], float] = {}

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        parts = [view.score(words) for view in self.views]
        log10_p = loglinear(np.stack([part.log10_p for part in parts]), self.weights)
        tags: dict[int, str] = {}
        for t in np.flatnonzero(self.sequence.scored).tolist():
            known = self.context(t) in self.sums
            total = self.total(t)
            log_total = np.float32(np.log10(total)) if total > 0 else np.float32(-np.inf)
            log10_p[t] -= log_total
            tags[t] = f"[cached={float(p_of(np.array([log_total]))[0]):.7g}]" if known else f"[denom={total:.7g}]"

        def tag(t: int) -> str:
            # Once the product is 0 SRILM does not ask the models that are left.
            zero = [bool(np.isneginf(part.log10_p[t])) for part in parts]
            asked = zero.index(True) + 1 if any(zero) else len(parts)
            return "".join(part.tag(t) for part in parts[:asked]) + tags[t]

        return Scored(log10_p, tag)

    def context(self, t: int) -> tuple[int, ...]:
        """The words before word t that any of the models uses."""
        return tuple(self.sequence.ids[t - int(self.used[t]) : t].tolist())

    def total(self, t: int) -> float:
        """The sum over all words that the products at word t are divided by."""
        context = self.context(t)
        if context not in self.sums:
            self.sums[context] = float(p_of(self._products(t)[self.events]).sum())
        return self.sums[context]

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        with np.errstate(divide="ignore"):
            return self._products(t) - np.float32(np.log10(self.total(t)))

    def _products(self, t: int) -> Singles:
        return loglinear(np.stack([view.distribution(t) for view in self.views]), self.weights)


class Cached:
    """A scorer mixed with the shares of words among the last `size` that were predicted (-cache)."""

    def __init__(self, base: Scorer, words: WordList, size: int, weight: float, sequence: TokenSequence) -> None:
        self.base, self.weight, self.ids = base(sequence), weight, sequence.ids
        self.unknown = words.index[words.unknown]
        self.cache = Cache(sequence.ids, sequence.scored & (sequence.ids != self.unknown), size)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        below = self.base.score(words)
        ids = self.ids if words is None else words
        shares = self.cache.shares(ids)
        log10_p = with_cache(below.log10_p, shares, self.weight)
        return Scored(log10_p, lambda t: below.tag(t) + (f"[cache={shares[t]:.7g}]" if ids[t] != self.unknown else ""))

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        below = self.base.distribution(t)
        return with_cache(below, self.cache.distribution(t, len(below)), self.weight)


class Lenient:
    """A scorer with exceptions: for the unknown word (-unk-prob), and for probabilities of 0 (-zeroprob-word).

    `unknown_p`: log10 p of the unknown word. `stand_in`: the word whose probability replaces one of 0.
    """

    def __init__(
        self, base: Scorer, unknown: int, unknown_p: float | None, stand_in: int | None, sequence: TokenSequence
    ) -> None:
        self.base, self.ids = base(sequence), sequence.ids
        self.unknown, self.unknown_p, self.stand_in = unknown, unknown_p, stand_in

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        below = self.base.score(words)
        ids = self.ids if words is None else words
        log10_p = self._with_unknown(below.log10_p, ids)
        if self.stand_in is None:
            return Scored(log10_p, below.tag)
        instead = np.isneginf(log10_p) & (ids != self.stand_in)
        other = self.base.score(np.full(len(ids), self.stand_in, np.int64))
        return Scored(
            np.where(instead, other.log10_p, log10_p),
            lambda t: below.tag(t) + (other.tag(t) if instead[t] else ""),
        )

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        below = self.base.distribution(t)
        log10_p = self._with_unknown(below, np.arange(len(below)))
        return log10_p if self.stand_in is None else np.where(np.isneginf(log10_p), below[self.stand_in], log10_p)

    def _with_unknown(self, log10_p: Singles, ids: Ints) -> Singles:
        if self.unknown_p is None:
            return log10_p
        return np.where(ids == self.unknown, np.float32(self.unknown_p), log10_p)
