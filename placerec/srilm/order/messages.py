"""SRILM's messages about estimating and changing models: sections 6 and 11 of our SRILM specification."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.logs import LN10, shown
from placerec.lm.mutable import Trace
from placerec.lm.trie import Trie, per_context
from placerec.srilm.order.contexts import ContextOrder, noted_order
from placerec.srilm.text.streams import Streams


class Messages(Trace):
    """Says on stderr what SRILM says at `debug`; contexts are shown with their most recent word first.

    `numbers` int64 (V,): SRILM's number of each word. `visited` gives the order in which estimation visits n-grams,
    `weighed` that in which weights are computed (for the contexts of order n, rows of order n-1); by default that of
    the rows. `announced`: said at debug 1 before an
    order is estimated.
    """

    # What stands in the empty context of a model that was read.
    empty_weight = -np.inf

    def __init__(
        self,
        trie: Trie,
        streams: Streams,
        debug: int,
        *,
        numbers: Ints,
        visited: ContextOrder | None = None,
        weighed: ContextOrder | None = None,
        announced: Mapping[int, str] | None = None,
    ) -> None:
        self.trie = trie
        self.streams = streams
        self.debug = debug
        self.numbers = numbers
        self.every_attempt, self.every_step = debug >= 1, debug >= 4
        self.visited = visited or (lambda n, rows: rows)
        self.weighed = weighed or (lambda n, contexts: contexts)
        self.announced = announced or {}
        self._waiting: list[tuple[int, Ints, list[str], ContextOrder, Any, Ints | None]] = []
        self._noted: list[Ints] = []
        self._closing: list[str] = []
        self._lost = np.zeros(2, np.int64)

    def shown(self, n: int, row: int) -> str:
        """The words of a row of order n, most recent first."""
        words = self.trie.vocabulary.words
        found = []
        for k in range(n, 0, -1):
            found.append(words[int(self.trie.word(k)[row])])
            row = int(self.trie.prefix(k)[row]) if k > 1 else row
        return " ".join(found)

    def _last_words(self, n: int, rows: Ints) -> NDArray[np.object_]:
        return np.array(self.trie.vocabulary.words, object)[self.trie.word(n)[rows]]

    def estimated(self, n: int, contexts: Ints) -> Ints:
        """The places int64 (c,) of the contexts of n-grams of order n in the order in which estimation visits them."""
        return self.visited(n - 1, contexts) if n > 1 else contexts

    def _say_of(
        self, n: int, contexts: Ints, text: str, order: ContextOrder, *columns: Any, attempt: Any = 0, rows: Any = None
    ) -> None:
        """Keep a line about each context (and its n-gram of `rows`) until it is known in which order they come.

        `text` is filled with the context's words and with the values of the columns (c,), such as numbers or `rows`.
        """
        values = zip(*(column.tolist() for column in columns), strict=True) if columns else [()] * len(contexts)
        lines = [
            text.format(self.shown(n - 1, row), *(shown(one) if isinstance(one, float) else one for one in more))
            for row, more in zip(contexts.tolist(), values, strict=True)
        ]
        if lines:
            self._waiting.append((n, contexts, lines, order, attempt, rows))

    def _flush(self) -> None:
        entries: list[tuple[int, int, int, str]] = []
        for n, contexts, lines, order, attempts, rows in self._waiting:
            # The order is worth finding only where there is more than one line.
            if len(self._waiting) == len(lines) == 1:
                entries.append((0, 0, 0, lines[0]))
                continue
            own = self.visited(n, rows) if rows is not None else np.zeros(len(lines), np.int64)
            places = order(n, contexts)
            entries += [
                (place, attempt, mine, line)
                for place, attempt, mine, line in zip(
                    places.tolist(), np.broadcast_to(attempts, len(lines)).tolist(), own.tolist(), lines, strict=True
                )
            ]
        self._waiting.clear()
        for *_, line in sorted(entries, key=lambda entry: entry[:3]):
            self.streams.say(line)

    def discarded_contexts(self, n: int, count: int) -> None:
        if self.debug >= 1 and n in self.announced:
            self.streams.say(self.announced[n])
        self._closing = []
        self._lost[:] = 0
        if count:
            self._closing.append(f"discarded {count} {n}-gram contexts containing pseudo-events")

    def discarded_ngrams(self, n: int, non_events: int, discounted: int) -> None:
        self._lost += non_events, discounted

    def order_done(self, n: int) -> None:
        self._flush()
        if self.debug >= 1:
            reasons = ("predicting pseudo-events", "discounted to zero")
            closing = [
                f"discarded {lost} {n}-gram probs {why}" for lost, why in zip(self._lost, reasons, strict=True) if lost
            ]
            for line in self._closing + closing:
                self.streams.say(line)

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
        if self.debug < 4:
            return
        contexts = self.trie.prefix(n)[rows] if n > 1 else np.zeros(len(rows), np.int64)
        text = "CONTEXT {} WORD {} NUMER {} DENOM {} DISCOUNT {} "
        text += "LPROB {}" if lower is None else "LOW {} LOLPROB {} LPROB {}"
        columns = self._last_words(n, rows), count, total, factor, *(lower or ()), log10_p
        self._say_of(n, contexts, text, self.estimated, *columns, attempt=2 * attempt, rows=rows)

    def no_mass(
        self, n: int, attempt: int, contexts: Ints, group: Ints, rows: Ints, p: Floats, *, interpolated: bool
    ) -> None:
        if self.debug < 1 or not len(contexts):
            return
        # What is left is next to nothing: it depends on the order in which SRILM sums.
        order = np.argsort(self.visited(n, rows), kind="stable")
        mass = 1 - per_context(group[order], len(contexts), p[order])
        remedy = "disabling interpolation" if interpolated else "incrementing denominator"
        text = f'warning: {{1}} backoff probability mass left for "{{0}}" -- {remedy}'
        self._say_of(n, contexts, text, self.estimated, mass, attempt=2 * attempt + 1)

    def again(self, n: int, attempt: int, context: int, rows: Ints, p: Floats) -> None:
        order = np.argsort(self.visited(n, rows), kind="stable")
        mass = 1 - np.add.accumulate(p[:, order], axis=1)[:, -1]
        text = 'warning: {1} backoff probability mass left for "{0}" -- incrementing denominator'
        attempts = 2 * (attempt + np.arange(len(p))) + 1
        self._say_of(n, np.full(len(p), context), text, self.estimated, mass, attempt=attempts)

    def full_contexts(self, n: int, contexts: Ints) -> None:
        text = 'BOW denominator for context "{}" is zero; scaling probabilities to sum to 1'
        self._say_of(n, contexts, text, self.weighed)

    def overfull_contexts(self, n: int, contexts: Ints, mass: Floats) -> None:
        self._say_of(n, contexts, 'BOW numerator for context "{}" is {} < 0', self.weighed, mass)

    def scarce_contexts(self, n: int, contexts: Ints, mass: Floats, minimum: float) -> None:
        text = f'insufficient backoff mass {{1}} for context "{{0}}"; scaling probabilities to mass {1 - minimum:g}'
        self._say_of(n, contexts, text, self.weighed, mass)

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        if n == 1:
            # SRILM computes no weight for the empty context: the message tells what stands there.
            weight = np.full(1, self.empty_weight, np.float32)
        if self.debug >= 4:
            text = "CONTEXT {} numerator {} denominator {} BOW {}"
            self._say_of(n, contexts, text, self.weighed, num, den, weight, attempt=1)
        self._flush()

    def unigram_mass(self, mass: float, words: int, *, everyone: bool) -> None:
        if self.debug >= 1:
            to = f"over all {words} words" if everyone else f"over {words} zeroton words"
            self.streams.say(f"warning: distributing {shown(mass)} left-over probability mass {to}")

    def lacking(self, missing: Sequence[Ints], is_context: Sequence[Mask]) -> None:
        if self.debug >= 3:
            self._noted = noted_order(self.trie, missing, is_context, self.weighed, self.numbers)

    def inserted(self, n: int, rows: Ints) -> None:
        if self.debug >= 3:
            for row in self._noted[n - 1].tolist():
                self.streams.say(f"faking probability for context {self.shown(n, row)}")
        if self.debug >= 1:
            self.streams.say(f"inserted {len(rows)} redundant {n}-gram probs")

    def trials(
        self, n: int, rows: Ints, context: Singles, old: Singles, new: Singles, entropy: Floats, gone: Mask
    ) -> None:
        if self.debug < 4:
            return
        text = "CONTEXT {} WORD {} CONTEXTPROB {} OLDPROB {} NEWPROB {} DELTA-H {} DELTA-LOGP {}"
        text += " PPL-CHANGE {} PRUNED {:d}"
        columns = self._last_words(n, rows), context, old, new, entropy, new - old, np.exp(entropy * LN10) - 1, gone
        self._say_of(n, self.trie.prefix(n)[rows], text, self.weighed, *columns, attempt=1)

    def improbable(self, n: int, rows: Ints, log10_p: Singles, backed_off: Singles) -> None:
        if self.debug >= 4:
            text = "CONTEXT {} WORD {} LPROB {} BACKOFF-LPROB {} PRUNED"
            columns = self._last_words(n, rows), log10_p, backed_off
            self._say_of(n, self.trie.prefix(n)[rows], text, self.weighed, *columns)

    def pruned(self, n: int, rows: Ints) -> None:
        self._flush()
        if self.debug >= 1 and len(rows):
            self.streams.say(f"pruned {len(rows)} {n}-grams")
