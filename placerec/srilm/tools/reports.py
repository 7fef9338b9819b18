"""What `ngram -ppl` and `ngram -counts` print: section 10 of our SRILM specification."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Singles
from placerec.lm.logs import p_of, shown
from placerec.lm.perplexity import Ranks, Totals, rank_word, tally_sentences
from placerec.lm.score import TokenSequence
from placerec.srilm.model.scorers import Scored, Scorer, View, event_mask, event_numbers
from placerec.srilm.text.counts_file import MALFORMED, split_count
from placerec.srilm.text.sentences import Handling, Marked, Sentences, mark, read_sentences
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList

TOKENS, SUMS, RANKS = 2, 3, 4


def totals_block(totals: Totals, ranks: Ranks | None = None) -> str:
    """The block of statistics (section 10.2): totals and perplexities, and the ranks if there are any."""
    # A negative weight times no OOVs is no -0.
    totals = Totals(*(total + 0.0 for total in totals))
    text = f"{totals.sentences:.16g} sentences, {totals.words:.16g} words, {totals.oovs:.16g} OOVs\n"
    if not totals.words + totals.sentences > 0:
        return text
    ppl, ppl1 = ("undefined" if value is None else _number(value) for value in (totals.ppl, totals.ppl1))
    text += f"{totals.zeroprobs:.16g} zeroprobs, logprob= {_number(totals.log10_p)} ppl= {ppl} ppl1= {ppl1}\n"
    return text if ranks is None else text + _rank_lines(ranks)


def _number(value: float) -> str:
    return shown(value, 7)


def _rank_lines(ranks: Ranks) -> str:
    words = [_ratio(count, ranks.words) if ranks.words else "0" for count in ranks.leading_words]
    tokens = [_ratio(count, ranks.tokens) for count in ranks.leading]
    square = ranks.square / ranks.tokens if ranks.tokens else 0.0
    # As pow has it; negative weights may leave less than nothing.
    root = "-nan" if square < 0 else shown(square**0.5, 16)
    return (
        f"{ranks.words:.16g} words, rank1= {words[0]} rank5= {words[1]} rank10= {words[2]}\n"
        f"{ranks.tokens:.16g} words+sents, rank1wSent= {tokens[0]} rank5wSent= {tokens[1]} rank10wSent= {tokens[2]}"
        f" qloss= {root} absloss= {_ratio(ranks.absolute, ranks.tokens)}\n"
    )


def _ratio(part: float, whole: float) -> str:
    # What C's 0.0 / 0.0 prints.
    return shown(part / whole, 16) if whole else "-nan"


class Printer:
    """The lines and the ranks of single tokens, as much of them as `debug` asks for."""

    def __init__(self, words: WordList, streams: Streams, debug: int) -> None:
        self.words, self.streams, self.debug = words, streams, debug

    @cached_property
    def events(self) -> Ints:
        """The words that can be predicted."""
        return event_numbers(self.words)

    def name(self, number: int) -> str:
        """The word that has this number of SRILM's."""
        return str(self.words.words[number])

    def block(self, totals: Totals, ranks: Ranks | None) -> str:
        """The block of statistics (section 10.2): totals and perplexities, and with -debug 4 the ranks."""
        return totals_block(totals, ranks if self.debug >= RANKS else None)

    def token(self, word: int, context: str, tag: str, p: float, log10_p: float, weight: float = 1) -> str:
        """The line of a token without its end: p( WORD | CONTEXT) = TAG P [ LOG10P ] (section 10.3)."""
        times = "" if weight == 1 else f" *{weight:.7g}"
        return f"\tp( {self.name(word)} | {context}) \t= {tag} {_number(p)} [ {_number(log10_p)}{times} ]"

    def sum(self, view: View, t: int, context: Ints) -> str:
        """The sum of all words' probabilities, for the end of a line; a warning if it is not 1."""
        if self.debug != SUMS:
            return ""
        total = float(p_of(view.distribution(t)[self.events]).sum())
        if abs(total - 1) > 0.0001:
            words = " ".join(self.name(number) for number in context[::-1].tolist())
            self.streams.say(f"\nwarning: word probs for this context sum to {shown(total)} != 1 : {words}")
        return f" / {_number(total)}"

    def rank(self, view: View, t: int, word: int, log10_p: float, *, end: bool, weight: float = 1) -> Ranks:
        """The rank of a token's word among all words, as tallies of one token."""
        known = word != self.words.index[self.words.unknown]
        marker = word == self.words.end
        return rank_word(log10_p, view.distribution(t)[self.events], known=known, end=end, marker=marker, weight=weight)


def print_perplexity(name: str, scorer: Scorer, printer: Printer, handling: Handling) -> None:
    """`-ppl`: score a text and print what `printer.debug` asks for."""
    summary = _Summary(printer)
    for sentences in read_sentences(printer.streams.lines(name), printer.words, handling):
        summary.add(sentences, *_score_sentences(scorer, printer, sentences, mark(sentences, printer.words, handling)))
    summary.finish(name)


def _score_sentences(
    scorer: Scorer, printer: Printer, sentences: Sentences, marked: Marked
) -> tuple[Floats, list["_Line"]]:
    """The totals of each sentence (S, 5), and what there is to print about its words."""
    sequence, lengths = _sequence(marked), marked.lengths
    ended = lengths - marked.opened > 0
    last = sequence.ids[(np.cumsum(lengths) - 1)[ended]]
    ended[ended] = last == printer.words.end
    view = scorer(sequence)
    scored = view.score()
    unknown = sequence.ids == printer.words.index[printer.words.unknown]
    totals = tally_sentences(scored.log10_p, unknown, sequence.scored, lengths, ended) * sentences.weights[:, None]
    if printer.debug < TOKENS:
        return totals, [_Line() for _ in ended] if printer.debug else []
    return totals, _token_lines(printer, view, scored, sequence, lengths, ended, sentences.weights)


def _sequence(marked: Marked) -> TokenSequence:
    """What is to be scored: all words but <s> at the beginning of sentences."""
    begin, some = np.cumsum(marked.lengths) - marked.lengths, marked.lengths > 0
    first, scored = np.zeros(len(marked.numbers), bool), np.ones(len(marked.numbers), bool)
    first[begin[some]] = True
    scored[begin[some & marked.opened]] = False
    return TokenSequence(marked.numbers, first, scored)


@dataclass
class _Line:
    """The lines of one sentence's tokens, and their ranks."""

    text: list[str] = field(default_factory=list)
    ranks: Ranks = field(default_factory=Ranks)


def _token_lines(
    printer: Printer, view: View, scored: Scored, part: TokenSequence, lengths: Ints, ended: Mask, weights: Floats
) -> list[_Line]:
    """The lines of sentences with these lengths (S,) that end in </s> or not (S,), and the ranks times weights (S,)."""
    lines = [_Line() for _ in ended]
    at = np.flatnonzero(part.scored)
    begin = np.maximum.accumulate(np.where(part.first, np.arange(len(part.ids)), 0))
    # The first word of a sentence is marked by the lack of dots.
    opening = part.first[at] | ((at > 0) & part.first[at - 1] & ~part.scored[at - 1])
    sentence = np.repeat(np.arange(len(lengths)), lengths)[at]
    columns = (at, begin[at], sentence, opening, scored.log10_p[at], p_of(scored.log10_p[at]))
    words = part.ids.tolist()
    # N-grams repeat, and printing numbers takes long.
    printed: dict[tuple[int, int, bool, str, float], str] = {}
    for t, start, i, opens, log10_p, p in zip(*(column.tolist() for column in columns), strict=True):
        key = (words[t - 1] if t > start else -1, words[t], opens, scored.tag(t), log10_p)
        text = printed.get(key)
        if text is None:
            before = (printer.name(key[0]) if t > start else "") + (" " if opens else " ...")
            text = printed[key] = printer.token(words[t], before, key[3], p, log10_p)
        line = lines[i]
        line.text.append(text + printer.sum(view, t, part.ids[start:t]) + "\n")
        if printer.debug >= RANKS:
            last = t + 1 == len(words) or bool(part.first[t + 1])
            end, weight = bool(last and ended[i]), float(weights[i])
            line.ranks = line.ranks.plus(printer.rank(view, t, words[t], log10_p, end=end, weight=weight))
    return lines


class _Summary:
    """Prints sentence by sentence, group by group (between escaped lines), and at the end the whole."""

    def __init__(self, printer: Printer) -> None:
        self.printer = printer
        self.total, self.group, self.ranks = Totals(), Totals(), Ranks()
        self.started = self.grouped = False

    def add(self, sentences: Sentences, totals: Floats, lines: Sequence[_Line]) -> None:
        """Sentences with their totals (S, 5), and what there is to print about their tokens."""
        before = 0
        for place, escaped in (*sentences.escapes, (len(totals), None)):
            self._sentences(sentences.shown[before:place], totals[before:place], lines[before:place])
            if escaped is not None:
                if self.printer.debug == 0 and self.started:
                    self._group()
                self.printer.streams.print(escaped)
            before = place

    def _sentences(self, shown: Sequence[str], totals: Floats, lines: Sequence[_Line]) -> None:
        self.started |= len(totals) > 0
        whole = Totals(*totals.sum(axis=0).tolist())
        self.total = self.total.plus(whole)
        self.group = self.group.plus(whole)
        for text, row, line in zip(shown, totals.tolist(), lines, strict=False):
            self.ranks = self.ranks.plus(line.ranks)
            block = self.printer.block(Totals(*row), line.ranks)
            self.printer.streams.print(text + "\n" + "".join(line.text) + block + "\n")

    def _group(self) -> None:
        self.printer.streams.print(totals_block(self.group) + "\n")
        self.group, self.grouped = Totals(), True

    def finish(self, name: str) -> None:
        """What stands at the end of a file."""
        if self.grouped:
            self._group()
        self.printer.streams.print(f"file {name}: " + self.printer.block(self.total, self.ranks))


_Table = dict[tuple[int, ...], float]
_Sums = tuple[Totals, Ranks]
# SRILM's counts are of 64 bits.
_MOST = 2**64 - 1


@dataclass(frozen=True)
class Counting:
    """How counts are read and scored: n-grams up to `order`; `entropy`: weighted by the model's joint probability.

    `walked`: in the order of SRILM's hash tables, not sorted; a cache depends on it.
    """

    order: int
    fractional: bool = False
    entropy: bool = False
    escape: str | None = None
    walked: bool = False


def print_counts(name: str, scorer: Scorer, printer: Printer, counting: Counting) -> None:
    """Score the n-grams of a counts file, each given its own first words, and print what `printer.debug` asks for."""
    parts: list[_Sums] = []
    table: _Table = {}
    lines = printer.streams.lines(name)
    for line in lines:
        if counting.escape is not None and line.startswith(counting.escape):
            if table:
                parts.append(_group(table, scorer, printer, counting, shown=True))
                table = {}
            printer.streams.print(line + lines.end)
            continue
        words, count = split_count(line, counting.fractional, most=_MOST)
        if count is None:
            printer.streams.say(f"{lines.position}{MALFORMED}")
        elif len(words) <= counting.order:
            ngram = tuple(map(printer.words.known, words))
            total = table.get(ngram, 0) + count
            table[ngram] = total if counting.fractional or total <= _MOST else total - _MOST - 1
    if table or parts:
        parts.append(_group(table, scorer, printer, counting, shown=bool(parts) or printer.debug >= 1))
    whole = printer.block(*_sum(parts)) if parts else totals_block(Totals())
    printer.streams.print(f"file {name}: {whole}")


def _sum(parts: Sequence[_Sums]) -> _Sums:
    return reduce(lambda a, b: (a[0].plus(b[0]), a[1].plus(b[1])), parts, (Totals(), Ranks()))


def _group(table: _Table, scorer: Scorer, printer: Printer, counting: Counting, *, shown: bool) -> _Sums:
    """Score the n-grams between two escaped lines."""
    parts, ranks_of = [], _walk(table) if counting.walked else {}
    for n in range(1, counting.order + 1):
        ngrams = [ngram for ngram, count in table.items() if len(ngram) == n and count]
        ngrams.sort(key=lambda ngram: ranks_of[ngram] if ranks_of else [printer.name(word) for word in ngram])
        if ngrams:
            counts = np.array([table[ngram] for ngram in ngrams], np.float64)
            parts.append(_score_ngrams(np.array(ngrams, np.int64), counts, scorer, printer, counting))
    totals, ranks = _sum(parts)
    if counting.entropy:
        totals = totals._replace(sentences=0, words=1)
    if shown:
        printer.streams.print(printer.block(totals, ranks) + "\n")
    return totals, ranks


def _walk(table: _Table) -> dict[tuple[int, ...], int]:
    """The place of each n-gram, and of its prefixes, among those of its length in SRILM's unsorted order."""
    from placerec.srilm.order.hashing import table_order

    places: dict[tuple[int, ...], int] = {(): 0}
    for n in range(1, max(map(len, table), default=0) + 1):
        nodes = sorted({ngram[:n]: 0 for ngram in table if len(ngram) >= n}, key=lambda node: places[node[:-1]])
        parents = [places[node[:-1]] for node in nodes]
        tables = np.unique(np.array(parents, np.int64), return_inverse=True)[1]
        order = table_order(tables, np.array([node[-1] for node in nodes], np.uint64))
        places |= {nodes[i]: place for place, i in enumerate(order.tolist())}
    return places


def _score_ngrams(ngrams: Ints, counts: Floats, scorer: Scorer, printer: Printer, counting: Counting) -> _Sums:
    """Score n-grams of one length, a matrix (m, n), that occur `counts` (m,) times."""
    n = ngrams.shape[1]
    sequence = TokenSequence.of_rows(ngrams)
    weights = counts * p_of(_joint_log10_p(ngrams, scorer, printer.words)) if counting.entropy else counts
    view = scorer(sequence)
    scored = view.score()
    log10_p, word = scored.log10_p[n - 1 :: n], ngrams[:, -1]
    end, unknown = word == printer.words.end, word == printer.words.index[printer.words.unknown]
    zero = np.isneginf(log10_p)
    chosen = (np.where(mask, counts, 0) for mask in (end, ~end, zero & unknown, zero & ~unknown))
    logs = np.where(zero, 0, weights * log10_p.astype(np.float64))
    # Summed one after the other, as SRILM does.
    total, ranks = Totals(*(float(np.add.accumulate(column)[-1]) for column in (*chosen, logs))), Ranks()
    for i, (ngram, count, weight) in enumerate(
        zip(ngrams.tolist(), counts.tolist(), weights.tolist(), strict=True) if printer.debug >= TOKENS else ()
    ):
        t = i * n + n - 1
        context = " ".join(printer.name(number) for number in ngram[-2::-1])
        p, log_p = float(p_of(log10_p[i : i + 1])[0]), float(log10_p[i])
        text = printer.token(ngram[-1], context + " ", scored.tag(t), p, log_p, weight)
        printer.streams.print(text + printer.sum(view, t, np.array(ngram[:-1], np.int64)) + "\n")
        if printer.debug >= RANKS:
            ranks = ranks.plus(printer.rank(view, t, ngram[-1], log_p, end=bool(end[i]), weight=count))
    return total, ranks


def _joint_log10_p(ngrams: Ints, scorer: Scorer, words: WordList) -> Singles:
    """log10 of the joint probability of the words of n-grams, float32 (m,), by a scorer (section 11.2).

    Each word is predicted from those before it; the first counts as </s> if it is <s>. Words that are never predicted
    and have probability 0 are left out.
    """
    sequence = TokenSequence.of_rows(ngrams)._replace(scored=np.ones(ngrams.size, bool))
    asked = ngrams.copy()
    start, end = words.start, words.end
    asked[:, 0] = np.where(asked[:, 0] == start, end, asked[:, 0])
    log10_p = scorer(sequence).score(asked.ravel()).log10_p.reshape(ngrams.shape)
    silent = np.isneginf(log10_p) & ~event_mask(words)[asked]
    return np.add.accumulate(np.where(silent, np.float32(0), log10_p), axis=1, dtype=np.float32)[:, -1]
