"""SRILM's messages about estimating and changing models: sections 6 and 11 of our SRILM specification."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.logs import LN10
from placerec.lm.mutable import Trace
from placerec.lm.trie import Trie
from placerec.srilm.order.hashing import table_order
from placerec.srilm.text.streams import Streams

NEVER = np.iinfo(np.int64).max
# The place of each of some rows, int64, in the order in which SRILM comes by: (order, rows) -> places.
ContextOrder = Callable[[int, Ints], Ints]


class Messages(Trace):
    """Says on stderr what SRILM says at `debug`; contexts are shown with their most recent word first.

    `visited` gives the order in which estimation visits n-grams, `weighed` that in which weights are computed (for
    the contexts of order n, rows of order n-1); by default that of the rows. `announced`: said at debug 1 before an
    order is estimated.
    """

    def __init__(
        self,
        trie: Trie,
        streams: Streams,
        debug: int,
        *,
        visited: ContextOrder | None = None,
        weighed: ContextOrder | None = None,
        announced: Mapping[int, str] | None = None,
    ) -> None:
        self.trie = trie
        self.streams = streams
        self.debug = debug
        self.visited = visited or (lambda n, rows: rows)
        self.weighed = weighed or (lambda n, contexts: contexts)
        self.announced = announced or {}
        self._waiting: list[tuple[int, Ints, list[str], ContextOrder, int, Ints | None]] = []
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
        self, n: int, contexts: Ints, text: str, order: ContextOrder, *columns: Any, attempt: int = 0, rows: Any = None
    ) -> None:
        """Keep a line about each context (and its n-gram of `rows`) until it is known in which order they come.

        `text` is filled with the context's words and with the values of the columns (c,), such as numbers or `rows`.
        """
        values = zip(*(column.tolist() for column in columns), strict=True) if columns else [()] * len(contexts)
        lines = [
            text.format(self.shown(n - 1, row), *more) for row, more in zip(contexts.tolist(), values, strict=True)
        ]
        if lines:
            self._waiting.append((n, contexts, lines, order, attempt, rows))

    def _flush(self) -> None:
        entries: list[tuple[int, int, int, str]] = []
        for n, contexts, lines, order, attempt, rows in self._waiting:
            # The order is worth finding only where there is more than one line.
            if len(self._waiting) == len(lines) == 1:
                entries.append((0, 0, 0, lines[0]))
                continue
            own = self.visited(n, rows) if rows is not None else np.zeros(len(lines), np.int64)
            places = order(n, contexts)
            entries += [
                (place, attempt, mine, line)
                for place, mine, line in zip(places.tolist(), own.tolist(), lines, strict=True)
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
        text = "CONTEXT {} WORD {} NUMER {:g} DENOM {:g} DISCOUNT {:g} "
        text += "LPROB {:g}" if lower is None else "LOW {:g} LOLPROB {:g} LPROB {:g}"
        columns = self._last_words(n, rows), count, total, factor, *(lower or ()), log10_p
        self._say_of(n, contexts, text, self.estimated, *columns, attempt=2 * attempt, rows=rows)

    def no_mass(self, n: int, attempt: int, contexts: Ints, mass: Floats, *, interpolated: bool) -> None:
        if self.debug < 1:
            return
        remedy = "disabling interpolation" if interpolated else "incrementing denominator"
        text = f'warning: {{1:g}} backoff probability mass left for "{{0}}" -- {remedy}'
        self._say_of(n, contexts, text, self.estimated, mass, attempt=2 * attempt + 1)

    def full_contexts(self, n: int, contexts: Ints) -> None:
        text = 'BOW denominator for context "{}" is zero; scaling probabilities to sum to 1'
        self._say_of(n, contexts, text, self.weighed)

    def overfull_contexts(self, n: int, contexts: Ints, mass: Floats) -> None:
        self._say_of(n, contexts, 'BOW numerator for context "{}" is {:g} < 0', self.weighed, mass)

    def scarce_contexts(self, n: int, contexts: Ints, mass: Floats, minimum: float) -> None:
        text = f'insufficient backoff mass {{1:g}} for context "{{0}}"; scaling probabilities to mass {1 - minimum:g}'
        self._say_of(n, contexts, text, self.weighed, mass)

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        if self.debug >= 4:
            text = "CONTEXT {} numerator {:g} denominator {:g} BOW {:g}"
            self._say_of(n, contexts, text, self.weighed, num, den, weight, attempt=1)
        self._flush()

    def unigram_mass(self, mass: float, words: int, *, everyone: bool) -> None:
        self._flush()
        if self.debug >= 1:
            to = f"over all {words} words" if everyone else f"over {words} zeroton words"
            self.streams.say(f"warning: distributing {mass:g} left-over probability mass {to}")

    def inserted(self, n: int, rows: Ints) -> None:
        if self.debug >= 3:
            for row in rows.tolist():
                self.streams.say(f"faking probability for context {self.shown(n, row)}")
        if self.debug >= 1:
            self.streams.say(f"inserted {len(rows)} redundant {n}-gram probs")

    def trials(
        self, n: int, rows: Ints, context: Singles, old: Singles, new: Singles, entropy: Floats, gone: Mask
    ) -> None:
        if self.debug < 4:
            return
        text = "CONTEXT {} WORD {} CONTEXTPROB {:g} OLDPROB {:g} NEWPROB {:g} DELTA-H {:g} DELTA-LOGP {:g}"
        text += " PPL-CHANGE {:g} PRUNED {:d}"
        columns = self._last_words(n, rows), context, old, new, entropy, new - old, np.exp(entropy * LN10) - 1, gone
        self._say_of(n, self.trie.prefix(n)[rows], text, self.weighed, *columns, attempt=1)

    def pruned(self, n: int, rows: Ints) -> None:
        self._flush()
        if self.debug >= 1 and len(rows):
            self.streams.say(f"pruned {len(rows)} {n}-grams")


@dataclass(frozen=True)
class ContextTimes:
    """When each context was put into the trie: `created` int64 (m_n,) per order beside the rows, NEVER if it was not.

    `numbers` int64 (V,): SRILM's number of each word. `expected`: the size of vocabulary that the model was made for.
    """

    trie: Trie
    created: Sequence[Ints] = field(repr=False)
    numbers: Ints = field(repr=False)
    expected: int = 0


def message_order(trie: Trie, times: ContextTimes) -> ContextOrder:
    """Gives the places of contexts of a model over `trie` in SRILM's walk; `times`: when contexts were read.

    Contexts that were not read come last, in the order of their words.
    """
    ranks: list[Ints] = []

    def places(n: int, contexts: Ints) -> Ints:
        if n == 1:
            return contexts
        if not ranks:
            ranks.extend(context_ranks(times))
        row = _same_rows(trie, times.trie, n - 1, contexts)
        known = ranks[n - 2][row] if n - 1 <= len(ranks) and len(ranks[n - 2]) else np.full(len(row), NEVER)
        known = np.where(row >= 0, known, NEVER)
        late = np.flatnonzero(known == NEVER)
        if len(late):
            *_, last = (rank for _, rank in zip(range(n - 1), trie.context_ranks(), strict=False))
            known[late] = NEVER // 2 + last[contexts[late]]
        return known

    return places


def _same_rows(trie: Trie, other: Trie, n: int, rows: Ints) -> Ints:
    """The rows of `other` that hold the words of `rows` of order n of `trie`, -1 where there are none."""
    numbers = np.empty((len(rows), n), np.int64)
    for k in range(n, 0, -1):
        numbers[:, k - 1] = trie.word(k)[rows]
        rows = trie.prefix(k)[rows] if k > 1 else rows
    own = other.vocabulary.ids(trie.vocabulary.words)[numbers]
    found = own[:, 0]
    for k in range(2, n + 1):
        found = other.find(k, found, own[:, k - 1])
    return found


def context_ranks(times: ContextTimes) -> list[Ints]:
    """Per length of context, the place of each row in SRILM's walk, int64 (m_n,); NEVER for what is no context."""
    trie = times.trie
    ranks: list[Ints] = []
    oldest, above = trie.keys[0], np.zeros(len(trie.vocabulary), np.int64)
    for k, created in enumerate(times.created[: trie.order - 1], start=1):
        if k > 1:
            oldest, above = oldest[trie.prefix(k)], ranks[-1][trie.suffixes[k - 1]]
        rows = np.flatnonzero(created < NEVER)
        rows = rows[np.lexsort((created[rows], above[rows]))]
        table: Ints = np.cumsum(np.diff(above[rows], prepend=above[rows][:1]) > 0)
        keys = times.numbers[oldest[rows]].astype(np.uint64)
        walked = rows[table_order(table, keys, size_hint=times.expected if k == 1 else 0)]
        rank = np.full(len(trie.keys[k - 1]), NEVER)
        rank[walked] = np.arange(len(walked))
        ranks.append(rank)
    return ranks
