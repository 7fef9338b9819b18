"""What `ngram` puts around a model, or several: mixtures, a cache, and exceptions for unknown words and zeros."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.logs import log10, p_of, shown
from placerec.lm.mix import Cache, loglinear, mixed, posteriors, with_cache
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import Model, Scored, Scorer, Sighted, event_numbers
from placerec.srilm.text.vocabulary import WordList


def _longest(views: Sequence[Sighted]) -> Ints:
    longest: Ints = np.stack([view.used for view in views]).max(axis=0)
    return longest


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

    @property
    def used(self) -> Ints:
        """How many words before each word any of the models can use, int64 (T,)."""
        return _longest(self.views)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        parts = [view.score(words) for view in self.views]
        log10_probs = np.stack([part.log10_p for part in parts])

        def tag(t: int) -> str:
            found = "".join(part.tag(t) for part in parts)
            if self.length > 0:
                found += _listed("post", self.posteriors[:, t])
            if self.detailed:
                found += _listed("probs", p_of(log10_probs[:, t]))
            return found

        return Scored(mixed(log10_probs, self.posteriors), tag)

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        return mixed(np.stack([view.distribution(t) for view in self.views]), self.posteriors[:, t])


class LogLinear:
    """The normalised product of powers of several models (-loglinear-mix).

    `sums`: what the products are divided by in each context that was met; SRILM says of these that they are cached.
    """

    def __init__(
        self,
        models: Sequence[Model],
        weights: Sequence[float],
        words: WordList,
        debug: int,
        sums: dict[tuple[int, ...], float],
        sequence: TokenSequence,
    ) -> None:
        self.weights, self.sequence, self.debug, self.sums = weights, sequence, debug, sums
        self.views = [model(sequence) for model in models]
        self.events = event_numbers(words)
        self.used = _longest(self.views)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        parts = [view.score(words) for view in self.views]
        log10_probs = np.stack([part.log10_p for part in parts])
        log10_p = loglinear(log10_probs, self.weights)
        tags: dict[int, str] = {}
        for t in np.flatnonzero(self.sequence.scored).tolist():
            # With -debug 3 the sum over all words comes first, and leaves the total.
            known = self.debug == 3 or self.context(t) in self.sums
            total = self.total(t)
            log_total = log10(np.array([total]))[0]
            log10_p[t] -= log_total
            tags[t] = f"[cached={shown(float(p_of(np.array([log_total]))[0]), 7)}]" if known else f"[denom={total:.7g}]"

        def tag(t: int) -> str:
            # Once the product is 0 SRILM does not ask the models that are left.
            zero = [bool(np.isneginf(part.log10_p[t])) for part in parts]
            asked = zero.index(True) + 1 if any(zero) else len(parts)
            probs = _listed("probs", p_of(log10_probs[:asked, t])) if self.debug >= 4 else ""
            return "".join(part.tag(t) for part in parts[:asked]) + probs + tags[t]

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
    """A scorer mixed with the shares of words among the last `size` that were predicted (-cache).

    `recent`: the words that were predicted last, in the sequences before; what is predicted here is added to them.
    """

    def __init__(
        self,
        base: Scorer,
        words: WordList,
        size: int,
        weight: float,
        debug: int,
        recent: list[int],
        sequence: TokenSequence,
    ) -> None:
        self.base, self.sequence, self.recent = base(sequence), sequence, recent
        self.weight, self.debug, self.size = weight, debug, size
        # The number of the unknown word, if it is not to be cached.
        self.unknown = words.index[words.unknown] if words.unknown in words.non_events else -1
        self.before = len(recent)
        self.ids = sequence.ids
        self.counted = sequence.scored & (sequence.ids != self.unknown)
        older = np.array(recent, np.int64)
        counted = np.concatenate([np.ones(self.before, bool), self.counted])
        self.cache = Cache(np.concatenate([older, self.ids]), counted, size)

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of others in their places."""
        below = self.base.score(words)
        ids = self.ids if words is None else words
        if words is None:
            self.recent[:] = [*self.recent, *ids[self.counted].tolist()][-self.size :]
        older = np.full(self.before, -1)
        return self._mixed(below, self.cache.shares(np.concatenate([older, ids]))[self.before :], ids)

    def score_or(self, stand_in: int, zero: Callable[[int, Singles], bool]) -> tuple[Scored, Scored]:
        """The probabilities of the sequence's words, and those of one word in their places.

        That word is asked for, and so cached, where the log10 p (1,) of the sequence's word t is `zero`.
        """
        others = np.full(len(self.ids), stand_in, np.int64)
        below, instead = self.base.score(), self.base.score(others)
        shares = np.zeros((2, len(self.ids)))
        for t in np.flatnonzero(self.sequence.scored).tolist():
            shares[0, t] = self._predict(int(self.ids[t]))
            if zero(t, with_cache(below.log10_p[t : t + 1], shares[0, t : t + 1], self.weight)):
                shares[1, t] = self._predict(stand_in)
        return self._mixed(below, shares[0], self.ids), self._mixed(instead, shares[1], others)

    def _predict(self, word: int) -> float:
        """The share of a word in the cache, to which the word is added."""
        share = self.recent.count(word) / max(1, len(self.recent))
        if word != self.unknown:
            self.recent[:] = [*self.recent, word][-self.size :]
        return share

    def _mixed(self, below: Scored, shares: Floats, ids: Ints) -> Scored:
        def tag(t: int) -> str:
            found = below.tag(t) + (f"[cache={shares[t]:.7g}]" if ids[t] != self.unknown else "")
            if self.debug < 3:
                return found
            return found + _listed("probs", p_of(np.append(below.log10_p[t], log10(shares[t : t + 1]))))

        return Scored(with_cache(below.log10_p, shares, self.weight), tag)

    def distribution(self, t: int) -> Singles:
        """log10 p of every word; with -debug 4, as it is once the word is in the cache."""
        below = self.base.distribution(t)
        shares = self.cache.distribution(self.before + t, len(below), after=self.debug >= 4)
        return with_cache(below, shares, self.weight)


def _listed(name: str, values: Iterable[float]) -> str:
    return f"[{name}=" + ",".join(shown(value, 7) for value in values) + "]"


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
        ids = self.ids if words is None else words
        if self.stand_in is None:
            below = self.base.score(words)
            return Scored(self._with_unknown(below.log10_p, ids), below.tag)
        if words is None and isinstance(self.base, Cached):
            below, other = self.base.score_or(self.stand_in, self._is_zero)
        else:
            below = self.base.score(words)
            other = self.base.score(np.full(len(ids), self.stand_in, np.int64))
        log10_p = self._with_unknown(below.log10_p, ids)
        instead = np.isneginf(log10_p) & (ids != self.stand_in)
        return Scored(
            np.where(instead, other.log10_p, log10_p),
            lambda t: below.tag(t) + (other.tag(t) if instead[t] else ""),
        )

    def distribution(self, t: int) -> Singles:
        """log10 p of every word."""
        below = self.base.distribution(t)
        log10_p = self._with_unknown(below, np.arange(len(below)))
        return log10_p if self.stand_in is None else np.where(np.isneginf(log10_p), below[self.stand_in], log10_p)

    def _is_zero(self, t: int, log10_p: Singles) -> bool:
        word = self.ids[t : t + 1]
        return bool(np.isneginf(self._with_unknown(log10_p, word))[0] and word[0] != self.stand_in)

    def _with_unknown(self, log10_p: Singles, ids: Ints) -> Singles:
        if self.unknown_p is None:
            return log10_p
        return np.where(ids == self.unknown, np.float32(self.unknown_p), log10_p)
