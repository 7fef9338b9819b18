"""What `ngram -ppl` and `ngram -counts` print: section 10 of our SRILM specification."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.lm.logs import p_of
from placerec.lm.perplexity import Ranks, Totals, rank_word, tally_sentences
from placerec.lm.score import TokenSequence
from placerec.lm.vocabulary import SENTENCE_END
from placerec.srilm.model.scorers import ModelView, Scored, Scorer, View, event_numbers
from placerec.srilm.text.counts_file import MALFORMED, split_count
from placerec.srilm.text.sentences import Handling, Marked, Sentences, joined, mark, read_sentences
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList

TOKENS, SUMS, RANKS = 2, 3, 4


def _block(totals: Totals, ranks: Ranks | None) -> str:
    text = f"{totals.sentences:.16g} sentences, {totals.words:.16g} words, {totals.oovs:.16g} OOVs\n"
    if not totals.words + totals.sentences > 0:
        return text
    ppl, ppl1 = ("undefined" if value is None else _number(value) for value in (totals.ppl, totals.ppl1))
    text += f"{totals.zeroprobs:.16g} zeroprobs, logprob= {_number(totals.log10_p)} ppl= {ppl} ppl1= {ppl1}\n"
    return text if ranks is None else text + _rank_lines(ranks)


def _number(value: float) -> str:
    return f"{value:.7g}"


def _rank_lines(ranks: Ranks) -> str:
    words = [_ratio(count, ranks.words) for count in ranks.leading_words]
    tokens = [_ratio(count, ranks.tokens) for count in ranks.leading]
    square = ranks.square / ranks.tokens if ranks.tokens else 0.0
    return (
        f"{ranks.words:.16g} words, rank1= {words[0]} rank5= {words[1]} rank10= {words[2]}\n"
        f"{ranks.tokens:.16g} words+sents, rank1wSent= {tokens[0]} rank5wSent= {tokens[1]} rank10wSent= {tokens[2]}"
        f" qloss= {square**0.5:.16g} absloss= {_ratio(ranks.absolute, ranks.tokens)}\n"
    )


def _ratio(part: float, whole: float) -> str:
    # What C's 0.0 / 0.0 prints.
    return f"{part / whole:.16g}" if whole else "-nan"


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
        return _block(totals, ranks if self.debug >= RANKS else None)

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
            shown = " ".join(self.name(number) for number in context[::-1].tolist())
            self.streams.say(f"\nwarning: word probs for this context sum to {total:g} != 1 : {shown}")
        return f" / {_number(total)}"

    def rank(self, view: View, t: int, word: int, log10_p: float, *, end: bool, weight: float = 1) -> Ranks:
        """The rank of a token's word among all words, as tallies of one token."""
        known = word != self.words.index[self.words.unknown]
        return rank_word(log10_p, view.distribution(t)[self.events], known=known, end=end, weight=weight)


def print_perplexity(name: str, scorer: Scorer, printer: Printer, handling: Handling, *, whole: bool) -> None:
    """`-ppl`: score a text and print what `printer.debug` asks for; `whole`: in one go (a cache runs on and on)."""
    parts = read_sentences(printer.streams.lines(name), printer.words, handling)
    if whole:
        parts = iter([joined(list(parts))])
    summary = _Summary(printer)
    for sentences in parts:
        summary.add(sentences, *_score_sentences(scorer, printer, sentences, mark(sentences, printer.words, handling)))
    summary.finish(name)


def _score_sentences(
    scorer: Scorer, printer: Printer, sentences: Sentences, marked: Marked
) -> tuple[Floats, list["_Line"]]:
    """The totals of each sentence (S, 5), and what there is to print about its words."""
    sequence, lengths = _sequence(marked), marked.lengths
    ended = lengths - marked.opened > 0
    last = sequence.ids[(np.cumsum(lengths) - 1)[ended]]
    ended[ended] = last == printer.words.index.get(SENTENCE_END, -1)
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
                self.printer.streams.print(escaped + "\n")
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
        self.printer.streams.print(_block(self.group, None) + "\n")
        self.group, self.grouped = Totals(), True

    def finish(self, name: str) -> None:
        """What stands at the end of a file."""
        if self.grouped:
            self._group()
        self.printer.streams.print(f"file {name}: " + self.printer.block(self.total, self.ranks))


_Table = dict[tuple[int, ...], float]
_Sums = tuple[Totals, Ranks]


@dataclass(frozen=True)
class Counting:
    """How counts are read and scored: n-grams up to `order`; `entropy`: weighted by the model's joint probability."""

    order: int
    fractional: bool = False
    entropy: bool = False
    escape: str | None = None


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
            printer.streams.print(line + "\n")
            continue
        words, count = split_count(line, counting.fractional)
        if count is None:
            printer.streams.say(f"{lines.position}{MALFORMED}")
        elif len(words) <= counting.order:
            ngram = tuple(map(printer.words.known, words))
            table[ngram] = table.get(ngram, 0) + count
    parts.append(_group(table, scorer, printer, counting, shown=bool(parts) or printer.debug >= 1))
    printer.streams.print(f"file {name}: {_counts_block(printer, _sum(parts), counting)}")


def _sum(parts: Sequence[_Sums]) -> _Sums:
    return reduce(lambda a, b: (a[0].plus(b[0]), a[1].plus(b[1])), parts, (Totals(), Ranks()))


def _counts_block(printer: Printer, sums: _Sums, counting: Counting) -> str:
    totals, ranks = sums
    return printer.block(totals._replace(sentences=0, words=1) if counting.entropy else totals, ranks)


def _group(table: _Table, scorer: Scorer, printer: Printer, counting: Counting, *, shown: bool) -> _Sums:
    """Score the n-grams between two escaped lines."""
    parts = []
    for n in range(1, counting.order + 1):
        ngrams = [ngram for ngram, count in table.items() if len(ngram) == n and count]
        ngrams.sort(key=lambda ngram: [printer.name(word) for word in ngram])
        if ngrams:
            counts = np.array([table[ngram] for ngram in ngrams], np.float64)
            parts.append(_score_ngrams(np.array(ngrams, np.int64), counts, scorer, printer, counting))
    sums = _sum(parts)
    if shown:
        printer.streams.print(_counts_block(printer, sums, counting) + "\n")
    return sums


def _score_ngrams(ngrams: Ints, counts: Floats, scorer: Scorer, printer: Printer, counting: Counting) -> _Sums:
    """Score n-grams of one length, a matrix (m, n), that occur `counts` (m,) times."""
    m, n = ngrams.shape
    # A word more behind each n-gram: the joint probability of what stands before it is the n-gram's.
    behind = np.full((m, 1), printer.words.index[printer.words.unknown])
    sequence = TokenSequence.of_rows(np.concatenate([ngrams, behind], axis=1))
    sequence = sequence._replace(scored=sequence.place == n - 1)
    view = scorer(sequence)
    scored = view.score()
    weights = counts
    if counting.entropy and isinstance(view, ModelView):
        weights = counts * p_of(view.joint(n)[n :: n + 1])
    end, unknown = printer.words.index.get(SENTENCE_END), printer.words.index[printer.words.unknown]
    total, ranks = Totals(), Ranks()
    for i, (ngram, count, weight) in enumerate(zip(ngrams.tolist(), counts.tolist(), weights.tolist(), strict=True)):
        t, word = i * (n + 1) + n - 1, ngram[-1]
        log10_p = float(scored.log10_p[t])
        zero, last = log10_p == -np.inf, word == end
        oov, impossible = zero and word == unknown, zero and word != unknown
        counted = Totals(last, not last, oov, impossible).times(count)
        total = total.plus(counted._replace(log10_p=0 if zero else weight * log10_p))
        if printer.debug >= TOKENS:
            context = " ".join(printer.name(number) for number in ngram[-2::-1])
            p = float(p_of(scored.log10_p[t : t + 1])[0])
            text = printer.token(word, context + " ", scored.tag(t), p, log10_p, weight)
            printer.streams.print(text + printer.sum(view, t, np.array(ngram[:-1], np.int64)) + "\n")
        if printer.debug >= RANKS:
            ranks = ranks.plus(printer.rank(view, t, word, log10_p, end=last, weight=count))
    return total, ranks
