"""SRILM's messages about estimating and changing models: sections 6 and 11 of our SRILM specification."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

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

    def estimated(self, n: int, contexts: Ints) -> Ints:
        """The places int64 (c,) of the contexts of n-grams of order n in the order in which estimation visits them."""
        return self.visited(n - 1, contexts) if n > 1 else contexts

    def _say_of(
        self,
        n: int,
        contexts: Ints,
        lines: list[str],
        order: ContextOrder,
        attempt: int = 0,
        rows: Ints | None = None,
    ) -> None:
        """Keep lines about contexts (and their n-grams `rows`) until it is known in which order they come."""
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
        words = self.trie.vocabulary.words
        lines = []
        for i, row in enumerate(rows.tolist()):
            shown = self.shown(n - 1, int(contexts[i])) if n > 1 else ""
            low = f" LOW {lower[0][i]:g} LOLPROB {lower[1][i]:g}" if lower is not None else ""
            lines.append(
                f"CONTEXT {shown} WORD {words[int(self.trie.word(n)[row])]} NUMER {count[i]:g} DENOM {total[i]:g}"
                f" DISCOUNT {factor[i]:g}{low} LPROB {log10_p[i]:g}"
            )
        self._say_of(n, contexts, lines, self.estimated, 2 * attempt, rows)

    def no_mass(self, n: int, attempt: int, contexts: Ints, mass: Floats, *, interpolated: bool) -> None:
        if self.debug < 1:
            return
        remedy = "disabling interpolation" if interpolated else "incrementing denominator"
        lines = [
            f"warning: {left:g} backoff probability mass left for"
            f' "{self.shown(n - 1, row) if n > 1 else ""}" -- {remedy}'
            for row, left in zip(contexts.tolist(), mass.tolist(), strict=True)
        ]
        self._say_of(n, contexts, lines, self.estimated, 2 * attempt + 1)

    def full_contexts(self, n: int, contexts: Ints) -> None:
        lines = [
            f'BOW denominator for context "{self.shown(n - 1, row)}" is zero; scaling probabilities to sum to 1'
            for row in contexts.tolist()
        ]
        self._say_of(n, contexts, lines, self.weighed)

    def overfull_contexts(self, n: int, contexts: Ints, mass: Floats) -> None:
        lines = [
            f'BOW numerator for context "{self.shown(n - 1, row) if n > 1 else ""}" is {left:g} < 0'
            for row, left in zip(contexts.tolist(), mass.tolist(), strict=True)
        ]
        self._say_of(n, contexts, lines, self.weighed)

    def scarce_contexts(self, n: int, contexts: Ints, mass: Floats, minimum: float) -> None:
        lines = [
            f'insufficient backoff mass {left:g} for context "{self.shown(n - 1, row) if n > 1 else ""}";'
            f" scaling probabilities to mass {1 - minimum:g}"
            for row, left in zip(contexts.tolist(), mass.tolist(), strict=True)
        ]
        self._say_of(n, contexts, lines, self.weighed)

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        if self.debug >= 4:
            lines = [
                f"CONTEXT {self.shown(n - 1, row) if n > 1 else ''} numerator {a:g} denominator {b:g} BOW {bow:g}"
                for row, a, b, bow in zip(contexts.tolist(), num.tolist(), den.tolist(), weight.tolist(), strict=True)
            ]
            self._say_of(n, contexts, lines, self.weighed, 1)
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
        contexts, words = self.trie.prefix(n)[rows], self.trie.vocabulary.words
        change, perplexity = new - old, np.exp(entropy * LN10) - 1
        lines = [
            f"CONTEXT {self.shown(n - 1, int(contexts[i]))} WORD {words[int(self.trie.word(n)[row])]}"
            f" CONTEXTPROB {context[i]:g} OLDPROB {old[i]:g} NEWPROB {new[i]:g} DELTA-H {entropy[i]:g}"
            f" DELTA-LOGP {change[i]:g} PPL-CHANGE {perplexity[i]:g} PRUNED {int(gone[i])}"
            for i, row in enumerate(rows.tolist())
        ]
        self._say_of(n, contexts, lines, self.weighed, 1)

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
            ranks.extend(_iteration(times))
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


def _iteration(times: ContextTimes) -> list[Ints]:
    """Per length of context, the place of each row in SRILM's walk, int64 (m_n,); NEVER for what is no context."""
    trie = times.trie
    ranks: list[Ints] = []
    oldest, above = trie.keys[0], np.zeros(len(trie.vocabulary), np.int64)
    for k in range(1, trie.order):
        if k > 1:
            oldest, above = oldest[trie.prefix(k)], ranks[-1][trie.suffixes[k - 1]]
        rows = np.flatnonzero(times.created[k - 1] < NEVER)
        rows = rows[np.lexsort((times.created[k - 1][rows], above[rows]))]
        table: Ints = np.cumsum(np.diff(above[rows], prepend=above[rows][:1]) > 0)
        keys = times.numbers[oldest[rows]].astype(np.uint64)
        walked = rows[table_order(table, keys, size_hint=times.expected if k == 1 else 0)]
        rank = np.full(len(trie.keys[k - 1]), NEVER)
        rank[walked] = np.arange(len(walked))
        ranks.append(rank)
    return ranks
