"""`ngram -counts`: the probability of a table of n-grams; section 10.4 of our SRILM specification."""

from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.lm.logs import p_of
from placerec.lm.perplexity import Ranks, Totals
from placerec.lm.score import TokenSequence
from placerec.lm.vocabulary import SENTENCE_END
from placerec.srilm.model.scorers import ModelView, Scorer
from placerec.srilm.text.counts_file import MALFORMED, split_count
from placerec.srilm.tools.reports import RANKS, TOKENS, Printer, block

Table = dict[tuple[int, ...], float]


@dataclass(frozen=True)
class Counting:
    """How counts are read and scored: n-grams up to `order`; `entropy`: weighted by the model's joint probability."""

    order: int
    fractional: bool = False
    entropy: bool = False
    escape: str | None = None


@dataclass
class _Sums:
    """Totals and ranks, of all n-grams and of those since the last escaped line."""

    total: Totals = field(default_factory=Totals)
    ranks: Ranks = field(default_factory=Ranks)


def print_counts(name: str, scorer: Scorer, printer: Printer, counting: Counting) -> None:
    """Score the n-grams of a counts file, each given its own first words, and print what `printer.debug` asks for."""
    total, grouped = _Sums(), False
    table: Table = {}
    lines = printer.streams.lines(name)
    for line in lines:
        if counting.escape is not None and line.startswith(counting.escape):
            if table:
                _add(total, _group(table, scorer, printer, counting, shown=True))
                table, grouped = {}, True
            printer.streams.print(line + "\n")
            continue
        words, count = split_count(line, counting.fractional)
        if count is None:
            printer.streams.say(f"{lines.position}{MALFORMED}")
        elif len(words) <= counting.order:
            ngram = tuple(map(printer.words.known, words))
            table[ngram] = table.get(ngram, 0) + count
    _add(total, _group(table, scorer, printer, counting, shown=grouped or printer.debug >= 1))
    ranks = total.ranks if printer.debug >= RANKS else None
    printer.streams.print(f"file {name}: {block(_whole(total.total, counting), ranks)}")


def _add(total: _Sums, part: _Sums) -> None:
    total.total = total.total.plus(part.total)
    total.ranks = total.ranks.plus(part.ranks)


def _whole(totals: Totals, counting: Counting) -> Totals:
    return totals._replace(sentences=0, words=1) if counting.entropy else totals


def _group(table: Table, scorer: Scorer, printer: Printer, counting: Counting, *, shown: bool) -> _Sums:
    """Score the n-grams between two escaped lines."""
    sums = _Sums()
    for n in range(1, counting.order + 1):
        ngrams = [ngram for ngram, count in table.items() if len(ngram) == n and count]
        ngrams.sort(key=lambda ngram: [printer.name(word) for word in ngram])
        if ngrams:
            counts = np.array([table[ngram] for ngram in ngrams], np.float64)
            _add(sums, _score(np.array(ngrams, np.int64), counts, scorer, printer, counting))
    if shown:
        ranks = sums.ranks if printer.debug >= RANKS else None
        printer.streams.print(block(_whole(sums.total, counting), ranks) + "\n")
    return sums


def _score(ngrams: Ints, counts: Floats, scorer: Scorer, printer: Printer, counting: Counting) -> _Sums:
    """Score n-grams of one length, a matrix (m, n), that occur `counts` (m,) times."""
    m, n = ngrams.shape
    # A word more behind each n-gram: the joint probability of what stands before it is the n-gram's.
    behind = np.full((m, 1), printer.words.index[printer.words.unknown])
    sequence = TokenSequence.of_rows(np.concatenate([ngrams, behind], axis=1))
    sequence = sequence._replace(scored=sequence.place == n - 1)
    view = scorer.view(sequence)
    scored = view.score()
    weights = counts
    if counting.entropy and isinstance(view, ModelView):
        weights = counts * p_of(view.joint(n)[n :: n + 1])
    end, unknown = printer.words.index.get(SENTENCE_END), printer.words.index[printer.words.unknown]
    sums = _Sums()
    for i, (ngram, count, weight) in enumerate(zip(ngrams.tolist(), counts.tolist(), weights.tolist(), strict=True)):
        t, word = i * (n + 1) + n - 1, ngram[-1]
        log10_p = float(scored.log10_p[t])
        zero, last = log10_p == -np.inf, word == end
        totals = Totals(
            count if last else 0,
            0 if last else count,
            count if zero and word == unknown else 0,
            count if zero and word != unknown else 0,
            0 if zero else weight * log10_p,
        )
        sums.total = sums.total.plus(totals)
        if printer.debug >= TOKENS:
            context = " ".join(printer.name(number) for number in ngram[-2::-1])
            p = float(p_of(scored.log10_p[t : t + 1])[0])
            text = printer.token(word, context + " ", scored.tag(t), p, log10_p, weight)
            printer.streams.print(text + printer.sum(view, t, np.array(ngram[:-1], np.int64)) + "\n")
        if printer.debug >= RANKS:
            sums.ranks = sums.ranks.plus(printer.rank(view, t, word, log10_p, end=last, weight=count))
    return sums
