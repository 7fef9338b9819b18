"""How probable words are after those before them: one look-up for whole texts, single words, and all words at once.

Back-off (section 6.8 of our SRILM specification): the longest listed n-gram that ends in a word gives its log10 p; each
context that is longer than that n-gram's, and listed, adds its weight.

An n-gram is known by a code: a number whose digits, to the base of V+1, are its words' numbers plus 1. The digit 0 is a
word that is not listed, and what stands before a sequence: it changes nothing in front of an n-gram, so that what is
shorter is found in no table but its own. Where codes of the next order would not fit into 63 bits, the words but for
the last are one digit: their row in the table of their order, plus 1.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask, Numbers, Singles
from placerec.lm.row_index import RowIndex

# A row an n-gram or a word: float32 (m,), whose sums are SRILM's, or float64, (m,) or of C models (m, C).
Values = NDArray[Any]
_MOST_CODES = 1 << 62
# Words that are looked up together: the work space stays in cache, and memory does not grow with the text.
CHUNK = 1 << 16


class TokenSequence(NamedTuple):
    """Sequences of words, one behind the other: word numbers `ids` (T,), -1 for a word that no model knows.

    `first` bool (T,): a sequence starts here, words before it are no context. `scored` bool (T,): the word is
    predicted; the others are context only.
    """

    ids: Ints
    first: Mask
    scored: Mask

    @staticmethod
    def of_rows(ngrams: Ints) -> "TokenSequence":
        """N-grams, a matrix of word numbers int64 (m, n), whose last words are predicted."""
        position = np.tile(np.arange(ngrams.shape[1]), len(ngrams))
        return TokenSequence(ngrams.reshape(-1), position == 0, position == ngrams.shape[1] - 1)

    @property
    def place(self) -> Ints:
        """How many words of the sequence stand before each word, int64 (T,)."""
        position = np.arange(len(self.ids))
        return position - np.maximum.accumulate(np.where(self.first, position, 0))


class Ngrams(NamedTuple):
    """N-grams of one order: words, integers (m, n), log10 p and backoff weights (m,) or (m, C), contexts or not (m,).

    `listed` bool (m,): has a log10 p of its own, the others are contexts only; None: all have.
    """

    words: Numbers
    log10_p: Values
    backoff: Values
    is_context: Mask
    listed: Mask | None = None


class Table(NamedTuple):
    """N-grams of one order: their rows by their codes; a row more at the end is what is not there: 0, no context.

    `start`: how many n-grams are shorter. `renumbered`: in codes of the next order a row stands for the n-gram.
    """

    rows: RowIndex
    backoff: Values
    is_context: Mask
    listed: Mask | None
    start: int
    renumbered: bool

    def unanswered(self, row: Ints) -> Ints:
        """The places of rows (T,) that hold no log10 p."""
        missing = row < 0
        if self.listed is not None:
            missing |= ~self.listed.take(row, mode="wrap")
        return missing.nonzero()[0]

    def stems(self, codes: Ints) -> Ints:
        """What codes of the next order begin with, for n-grams of these codes (T,)."""
        return self.rows.find(codes) + 1 if self.renumbered else codes


class Contexts:
    """The 0, 1, ..., N-1 words before each of T words: their `codes` (T,), and the `stems` (T,) of longer codes.

    `digits` (T,) of the words; sequences begin at `starts`.
    """

    def __init__(self, tables: "ScoreTables", digits: Ints, starts: Ints | int) -> None:
        nothing = np.zeros(len(digits), np.int64)
        self.codes, self.stems, self._tables = [nothing], [nothing], tables.tables[:-1]
        for table in self._tables:
            codes = np.zeros(len(digits), np.int64)
            if len(self.codes) > 1:
                np.multiply(self.stems[-1][:-1], tables.V + 1, out=codes[1:])
            codes[1:] += digits[:-1]
            codes[starts] = 0
            self.codes.append(codes)
            self.stems.append(table.stems(codes))

    @cached_property
    def rows(self) -> list[Ints]:
        """The rows of the last 1, ..., N-1 words, (T,), -1 where they are no context that is listed."""
        found = []
        for table, codes in zip(self._tables, self.codes[1:], strict=True):
            row = table.rows.find(codes)
            row[~table.is_context.take(row, mode="wrap")] = -1
            found.append(row)
        return found

    @property
    def lengths(self) -> Ints:
        """How many words before each word are contexts that are listed, int64 (T,)."""
        lengths = np.zeros(len(self.codes[0]), np.int64)
        for row in self.rows:
            lengths += row >= 0
        return lengths


class ScoreTables:
    """The n-grams of orders 1..N over words 0..V-1, of one model or of C models.

    `log10_p` (m+1,) or (m+1, C): order by order, at the end that of what is not there, -inf.
    """

    def __init__(self, V: int, tables: list[Table], log10_p: Values) -> None:
        self.V, self.tables, self.log10_p = V, tables, log10_p

    def digits(self, ids: Ints) -> Ints:
        """The digits of word numbers int64 (T,); 0 for -1, and for numbers from V on."""
        digits = ids + 1
        digits[digits > self.V] = 0
        return digits

    def find(self, contexts: Contexts, digits: Ints, order: int | None = None) -> tuple[Values, NDArray[np.int8]]:
        """log10 p (T,) or (T, C) of words after contexts, and the length (T,) of the n-gram that answers, 0 for none.

        `order`: that of the longest n-gram to look for (default: N).
        """
        n, base = order or len(self.tables), self.V + 1
        table, codes = self.tables[n - 1], contexts.stems[n - 1] * base
        codes += digits
        best, answered = table.rows.find(codes), np.full(len(digits), n, np.int8)
        left, paid = table.unanswered(best), []
        best += table.start
        for k in range(n - 1, 0, -1):
            if not len(left):
                break
            table = self.tables[k - 1]
            # What may answer now, and the contexts that did not help before: both have k words.
            shorter = contexts.stems[k - 1][left] * base + digits[left]
            row = table.rows.find(np.concatenate([shorter, contexts.codes[k][left]]))
            row, context = row[: len(left)], row[len(left) :]
            known = (context >= 0).nonzero()[0]
            paid.append((left[known], table.backoff.take(context[known], axis=0)))
            best[left], answered[left] = row + table.start, k
            left = left[table.unanswered(row)]
        best[left], answered[left] = -1, 0
        log10_p = self.log10_p.take(best, axis=0, mode="wrap")
        sums = _sums(log10_p)
        with np.errstate(invalid="ignore"):
            # From short contexts to long.
            for at, weight in reversed(paid):
                sums[at] += weight
            if sums is not log10_p:
                log10_p += sums
        return log10_p, answered

    def score(self, ids: Ints) -> Values:
        """log10 p (T,) or (T, C) of each of T words after those before it: empty first context, no markers."""
        scores = np.empty((len(ids), *self.log10_p.shape[1:]), self.log10_p.dtype)
        for start in range(0, len(ids), CHUNK):
            before = max(0, start - len(self.tables) + 1)
            digits = self.digits(ids[before : start + CHUNK])
            contexts = Contexts(self, digits, 0)
            scores[start : start + CHUNK] = self.find(contexts, digits)[0][start - before :]
        return scores

    def scores_by_order(self, contexts: Contexts, digits: Ints) -> Values:
        """log10 p (N, T) with at most 0, 1, ..., N-1 words of context."""
        return np.stack([self.find(contexts, digits, n)[0] for n in range(1, len(self.tables) + 1)])

    def distribution(self, contexts: Contexts, t: int) -> Values:
        """log10 p (V,) or (V, C) of every word in the place of word `t`."""
        log10_p, base = self._of_words.copy(), self.V + 1
        sums = _sums(log10_p)
        for k, table in enumerate(self.tables[1:], start=1):
            row = int(contexts.rows[k - 1][t])
            if row < 0:
                break
            sums += self.tables[k - 1].backoff[row]
            codes, rows = self._sorted[k]
            code = int(contexts.stems[k][t]) * base
            start, stop = codes.searchsorted([code, code + base])
            words, found = codes[start:stop] % base - 1, rows[start:stop]
            if table.listed is not None:
                words, found = words[table.listed[found]], found[table.listed[found]]
            log10_p[words] = self.log10_p[table.start + found]
            if sums is not log10_p:
                sums[words] = 0
        with np.errstate(invalid="ignore"):
            return log10_p if sums is log10_p else log10_p + sums

    def follow(self, index: Mapping[str, int]) -> Callable[[str], list[float]]:
        """A function to be asked for each word of a text in turn: log10 p under each of C models, as `score` gives it.

        `index`: the numbers of words. Constant memory: the function remembers where the last N-1 words stand. The
        tables must be of C models and list every ending of an n-gram.
        """
        base, unigrams, log10_p = self.V + 1, self._unigrams.tolist(), self.log10_p
        longer = [(table.rows.finder(), table.start, table.renumbered) for table in self.tables[1:]]
        weights, renumbered_words = [table.backoff for table in self.tables[:-1]], self.tables[0].renumbered
        # Of the last 1, 2, ... words, as many as are listed: their row, and what longer codes begin with.
        contexts: list[int] = []
        stems: list[int] = []

        def score(word: str) -> list[float]:
            nonlocal contexts, stems
            digit = index[word] + 1
            best = row = unigrams[digit - 1]
            rows, ends = [row], [row + 1 if renumbered_words else digit]
            for stem, (find, start, renumbered) in zip(stems, longer, strict=False):
                code = stem * base + digit
                row = find(code)
                if row < 0:
                    break
                best = start + row
                rows.append(row)
                ends.append(row + 1 if renumbered else code)
            scores: list[float] = log10_p[best].tolist()
            for k in range(len(rows) - 1, len(contexts)):
                scores = list(map(add, scores, weights[k][contexts[k]].tolist()))
            contexts, stems = rows[: len(longer)], ends
            return scores

        return score

    @cached_property
    def _of_words(self) -> Values:
        """log10 p (V,) or (V, C) of every word without context."""
        return self.log10_p.take(self._unigrams, axis=0, mode="wrap")

    @cached_property
    def _unigrams(self) -> Ints:
        """The row of each word in the table of order 1, (V,)."""
        return self.tables[0].rows.find(np.arange(1, self.V + 1))

    @cached_property
    def _sorted(self) -> list[tuple[Ints, Ints]]:
        """Per order the codes, ascending, and their rows: what follows a context stands together."""
        codes = [table.rows.keys() for table in self.tables]
        rows = [np.argsort(keys) for keys in codes]
        return [(keys[row], row) for keys, row in zip(codes, rows, strict=True)]

    def codes(self, words: Numbers) -> Ints:
        """The codes (m,) of n-grams, integers (m, n)."""
        codes = words[:, 0].astype(np.int64) + 1
        for table, word in zip(self.tables, words.T[1:], strict=False):
            codes = table.stems(codes) * (self.V + 1)
            codes += word
            codes += 1
        return codes


def _sums(log10_p: Values) -> Values:
    """What backoff weights are added to: float32 ones are first summed up, as SRILM does, float64 ones need not be."""
    return np.zeros_like(log10_p) if log10_p.dtype == np.float32 else log10_p


def build_tables(V: int, orders: Sequence[Sequence[Ngrams]]) -> ScoreTables:
    """The tables of distinct n-grams of words 0..V-1, each order in any number of pieces; their contexts are listed."""
    *_, (tables, _) = _built(V, orders)
    return tables


def build_regular_tables(V: int, orders: Sequence[Sequence[Ngrams]]) -> ScoreTables | None:
    """The tables of orders 1..N over words 0..V-1; None if an n-gram is listed twice or the context has no weight."""
    for tables, stems in _built(V, orders):
        if not tables.tables[-1].rows.distinct or not _have_contexts(tables, stems):
            return None
    return tables


def _built(V: int, orders: Sequence[Sequence[Ngrams]]) -> Iterator[tuple[ScoreTables, Ints]]:
    """The tables of order 1, then of 1 and 2, ...; and what the codes (m,) of the last order begin with."""
    log10_p = _joined([_answers(piece) for pieces in orders for piece in pieces], np.float32(-np.inf))
    tables, base, start = ScoreTables(V, [], log10_p), V + 1, 0
    possible = base
    for n, pieces in enumerate(orders, start=1):
        codes = _joined([tables.codes(piece.words) for piece in pieces], 0)[:-1]
        renumbered = possible > _MOST_CODES // base
        possible = (len(codes) + 1 if renumbered else possible) * base
        # Nothing is longer than what the highest order lists.
        contexts = pieces if n < len(orders) else []
        weights = _joined([_weights(piece) for piece in contexts], np.float32(0))
        is_context = _joined([piece.is_context for piece in contexts], False)
        tables.tables.append(Table(RowIndex(codes), weights, is_context, _listed(pieces), start, renumbered))
        start += len(codes)
        yield tables, codes // base


def _joined(pieces: list[Any], end: Any) -> NDArray[Any]:
    """The rows of all pieces, and one more that holds `end`."""
    last = np.full_like(pieces[0][:1], end, shape=(1, *pieces[0].shape[1:])) if pieces else np.array([end])
    return np.concatenate([*pieces, last])


def _answers(piece: Ngrams) -> Values:
    if piece.listed is None:
        return piece.log10_p
    return np.where(piece.listed, piece.log10_p, np.float32(-np.inf))


def _weights(piece: Ngrams) -> Values:
    return np.where(piece.is_context, piece.backoff.T, np.float32(0)).T


def _listed(pieces: Sequence[Ngrams]) -> Mask | None:
    masks = [np.ones(len(piece.words), bool) if piece.listed is None else piece.listed for piece in pieces]
    return None if all(mask.all() for mask in masks) else _joined(masks, False)


def _have_contexts(tables: ScoreTables, stems: Ints) -> bool:
    """Whether all n-grams' contexts are listed with a weight; contexts are looked up once where they stand together."""
    if len(tables.tables) < 2:
        return True
    stems = stems[np.diff(stems, prepend=-1) != 0]
    shorter = tables.tables[-2]
    row = stems - 1 if shorter.renumbered else shorter.rows.find(stems)
    return bool(shorter.is_context.take(row, mode="wrap").all())


def joint_log10_p(
    tables: ScoreTables, sequence: TokenSequence, length: int, silent: Mask, *, start: int, end: int
) -> Singles:
    """log10 of the joint probability of the last `length` words before each word, float32 (T,).

    Each is predicted from those of them that stand before it, by at most N-1. The oldest counts as `end` (the number
    of </s>) if it is `start` (that of <s>); words that are `silent`, bool (T,), and have probability 0 are left out
    (section 11.2 of our SRILM specification).
    """
    digits = tables.digits(sequence.ids)
    contexts = Contexts(tables, digits, np.flatnonzero(sequence.first))
    by_order = tables.scores_by_order(contexts, digits)
    as_end = tables.log10_p[tables.tables[0].rows.find(np.array([end + 1]))[0]]
    place, total = sequence.place, np.zeros(len(digits), np.float32)
    for back in range(length, 0, -1):
        at = np.flatnonzero(place >= back)
        depth = np.minimum(length, place[at]) - back
        value = by_order[np.minimum(depth, len(by_order) - 1), at - back]
        opening = (depth == 0) & (sequence.ids[at - back] == start)
        value = np.where(opening, as_end, np.where(np.isneginf(value) & silent[at - back], np.float32(0), value))
        total[at] += value
    return total
