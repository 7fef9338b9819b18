"""Count models: relative frequencies of all orders, mixed by weights that depend on how often contexts were seen.

Jelinek and Mercer (1980): p_k(w | h) = l c(hw) / c(h) + (1 - l) p_{k-1}(w | h'), h' being h without the oldest word,
p_0 = 1 / V, and l the weight of order k in the row of the weights that c(h) leads to.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.counts import NgramCounts, format_counts
from placerec.lm.logs import log10
from placerec.lm.score import Contexts, Ngrams, ScoreTables, TokenSequence, build_tables
from placerec.srilm.model.scorers import Scored, event_mask
from placerec.srilm.text.counts_file import counted
from placerec.srilm.text.counts_table import Table, read_counts, tabled
from placerec.srilm.text.numbers import leading_float, leading_int
from placerec.srilm.text.streams import SrilmError, Streams, tokens
from placerec.srilm.text.vocabulary import WordList

_MOST_ROWS = 1 << 20


@dataclass(frozen=True)
class CountModel:
    """Weights (M+1, N) of N orders for contexts seen 0, ..., M times, in units of `modulus`; counts, and their total.

    `size`: the V of 1 / V. `file`: the name of the counts file.
    """

    words: WordList
    weights: Floats
    modulus: int
    size: int
    total: int
    file: str
    counts: NgramCounts = field(repr=False)

    @property
    def order(self) -> int:
        return int(self.weights.shape[1])

    @cached_property
    def tables(self) -> ScoreTables:
        """The counts by n-gram, in the place of log probabilities."""
        trie = self.counts.trie
        numbers = np.array([self.words.index[word] for word in trie.vocabulary.words], np.int64)
        orders = []
        for n in range(1, self.order + 1):
            rows = np.flatnonzero(self.counts.seen[n - 1])
            count = self.counts.counts[n - 1][rows].astype(np.float64)
            ngrams = numbers[trie.matrix(n)[rows]]
            orders.append([Ngrams(ngrams, count, np.zeros(len(rows)), np.ones(len(rows), bool))])
        return build_tables(len(self.words.words), orders)

    def row(self, count: Floats) -> Ints:
        """The rows of weights (m,) for contexts of these counts (m,)."""
        return np.minimum(count // self.modulus, len(self.weights) - 1).astype(np.int64)

    def mixed(self, levels: Sequence["Level"]) -> Floats:
        """The probability float64 (m,) of words in their places, given the counts of all orders."""
        p = np.full(len(levels[0].count), np.float64(1) / np.float64(self.size))
        for k, level in enumerate(levels):
            weight = self.weights[self.row(level.context), k]
            p = np.where(level.there, weight * level.ratio + (1 - weight) * p, p)
        return p

    def __call__(self, sequence: TokenSequence) -> "CountView":
        return CountView(self, sequence)


@dataclass(frozen=True)
class Level:
    """Counts float64 (m,) of n-grams of one order and of contexts; `there` bool (m,): so many words stand before."""

    count: Floats
    context: Floats
    there: Mask

    @property
    def ratio(self) -> Floats:
        """The relative frequency (m,); 0 in a context that was never seen."""
        ratio: Floats = np.where(self.context > 0, self.count / np.where(self.context > 0, self.context, 1), 0.0)
        return ratio


class CountView:
    """A token sequence, read by a CountModel."""

    def __init__(self, model: CountModel, sequence: TokenSequence) -> None:
        self.model, self.sequence = model, sequence
        tables = model.tables
        self.digits = tables.digits(sequence.ids)
        self.contexts = Contexts(tables, self.digits, np.flatnonzero(sequence.first))
        self.place = sequence.place
        self.seen = [np.full(len(self.digits), float(model.total))]
        for k in range(1, model.order):
            self.seen.append(self._counts(k, self.contexts.codes[k]))

    def _counts(self, n: int, codes: Ints) -> Floats:
        """The counts (m,) of the n-grams of order n that codes (m,) stand for, 0 for what is not listed."""
        table = self.model.tables.tables[n - 1]
        row = table.rows.find(codes)
        return np.where(row >= 0, self.model.tables.log10_p[table.start + row], 0.0)

    def levels(self, digits: Ints) -> list[Level]:
        """The counts of all orders for words (T,) in their places."""
        base = self.model.tables.V + 1
        return [
            Level(self._counts(k + 1, self.contexts.stems[k] * base + digits), self.seen[k], self.place >= k)
            for k in range(self.model.order)
        ]

    def score(self, words: Ints | None = None) -> Scored:
        """The probabilities of the sequence's words, or of `words` (T,) in their places."""
        ids = self.sequence.ids if words is None else words
        levels = self.levels(self.model.tables.digits(ids))
        silent = ~event_mask(self.model.words)[ids]
        p = self.model.mixed(levels)
        p[silent] = 0

        def tag(t: int) -> str:
            if silent[t]:
                return ""
            shown = [f"{self.model.total:.7g}"]
            for k, level in enumerate(levels):
                if level.there[t]:
                    weight = self.model.weights[self.model.row(level.context[t : t + 1])[0], k]
                    shown += [f"{weight:.7g}", f"{level.count[t]:.7g}"]
            return f"[{','.join(shown)}]"

        return Scored(log10(p), tag)

    def distribution(self, t: int) -> Singles:
        """log10 p float32 of every word, by SRILM's number, in the place of word `t`."""
        tables, events = self.model.tables, event_mask(self.model.words)
        digits = tables.digits(np.arange(len(events)))
        levels = [
            Level(
                self._counts(k + 1, int(self.contexts.stems[k][t]) * (tables.V + 1) + digits),
                np.full(len(digits), self.seen[k][t]),
                np.full(len(digits), self.place[t] >= k),
            )
            for k in range(self.model.order)
        ]
        p = self.model.mixed(levels)
        p[~events] = 0
        return log10(p)


def read_count_model(
    name: str, words: WordList, streams: Streams, order: int, failure: str, *, limited: bool = False
) -> CountModel:
    """Read a count model up to `order`, adding the words of its counts; SrilmError, saying `failure`, if it is none."""
    lines = streams.lines(name)
    rest = iter(lines)
    numbers = {"vocabsize": 0, "totalcount": 0, "countmodulus": 1, "order": order}
    weights = np.zeros((1, order))
    file, table = "", Table()

    def refuse(why: str) -> SrilmError:
        streams.say(f"{lines.position}{why}")
        return SrilmError(failure)

    for line in rest:
        key, *values = tokens(line)
        if key == "google-counts":
            raise SrilmError(
                f"{lines.position}{key}: counts in Google's folders are not supported; merge them to a file", 2
            )
        if key == "counts" and values:
            file = values[0]
            if file == "-":
                table = tabled(counted(lines, rest, False), order, words, limited=limited)
                break
            table = read_counts(file, order, words, streams, fractional=False, limited=limited)
        elif key == "mixweights" or key in numbers:
            number = leading_int(values[0]) if values else None
            if number is None or number < (key == "countmodulus") or (key == "mixweights" and number > _MOST_ROWS):
                raise refuse(f"{key} needs a whole number{' above 0' if key == 'countmodulus' else ''}")
            if key == "mixweights":
                weights = _weights(rest, number + 1, order, refuse)
            else:
                numbers[key] = number
        else:
            raise refuse("unknown keyword")
    sizes = numbers["countmodulus"], numbers["vocabsize"], numbers["totalcount"]
    return CountModel(words, weights, *sizes, file, table.count(order, words, fractional=False))


def _weights(lines: Iterator[str], rows: int, order: int, refuse: Callable[[str], SrilmError]) -> Floats:
    """The rows of weights that follow in a file, cut to `order`."""
    weights = []
    for line in lines:
        row = [leading_float(text) for text in tokens(line)[:order]]
        if len(row) < order or None in row:
            raise refuse("incomplete mixture weight vector")
        if not all(0 <= weight <= 1 for weight in row if weight is not None):
            raise refuse("mixture weights are numbers between 0 and 1")
        weights.append(row)
        if len(weights) == rows:
            return np.array(weights, np.float64)
    raise refuse("incomplete mixture weight vector")


def format_count_model(model: CountModel, *, whole: bool) -> Iterator[str]:
    """The file of a count model, with the counts (`whole`) or with the name of the counts file."""
    yield f"order {model.order}\nmixweights {len(model.weights) - 1}\n"
    for row in model.weights.tolist():
        yield "".join(f" {weight:.16g}" for weight in row) + "\n"
    yield f"countmodulus {model.modulus}\nvocabsize {model.size}\ntotalcount {model.total}\n"
    inside = whole or model.file == "-"
    yield f"counts {'-' if inside else model.file}\n"
    if inside:
        yield format_counts(model.counts)
