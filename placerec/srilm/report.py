"""What `ngram -ppl` and `ngram -counts` print: section 10 of our SRILM specification."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from placerec.lm.draft import Floats, Mask, p_of
from placerec.lm.passage import Passage
from placerec.lm.perplexity import Ranks, Totals, rank_word, tally_sentences
from placerec.lm.trie import Ints
from placerec.srilm.scorers import Scored, Scorer, View, event_numbers
from placerec.srilm.sentences import Handling, Sentences, mark, read_sentences
from placerec.srilm.streams import Streams
from placerec.srilm.vocabulary import WordList

TOKENS, SUMS, RANKS = 2, 3, 4
_BATCH = 1 << 20


def block(totals: Totals, ranks: Ranks | None = None) -> str:
    """The statistics of section 10.2, with those of debug level 4 if `ranks` are given."""
    text = f"{totals.sentences:.16g} sentences, {totals.words:.16g} words, {totals.oovs:.16g} OOVs\n"
    if not totals.words + totals.sentences > 0:
        return text
    ppl, ppl1 = _perplexity(totals.perplexity), _perplexity(totals.perplexity_per_word)
    text += f"{totals.zeroprobs:.16g} zeroprobs, logprob= {_number(totals.log10_p)} ppl= {ppl} ppl1= {ppl1}\n"
    return text if ranks is None else text + _rank_lines(ranks)


def _perplexity(value: float | None) -> str:
    return "undefined" if value is None else _number(value)


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


@dataclass
class Printer:
    """The lines and the ranks of single tokens, as much of them as `debug` asks for."""

    words: WordList
    streams: Streams
    debug: int
    events: Ints = field(init=False)

    def __post_init__(self) -> None:
        self.events = event_numbers(self.words)

    def name(self, number: int) -> str:
        """The word of a number."""
        return str(self.words.words[number])

    def token(self, word: int, context: str, tag: str, p: float, log10_p: float, weight: float = 1) -> str:
        """The start of a token's line (section 10.3)."""
        times = "" if weight == 1 else f" *{weight:.7g}"
        return f"\tp( {self.name(word)} | {context}) \t= {tag} {_number(p)} [ {_number(log10_p)}{times} ]"

    def sum(self, view: View, t: int, context: Ints) -> str:
        """The sum of all words' probabilities, for the end of a line; a warning if it is not 1."""
        if self.debug != SUMS:
            return ""
        total = float(p_of(view.spread(t)[self.events]).sum())
        if abs(total - 1) > 0.0001:
            shown = " ".join(self.name(number) for number in context[::-1].tolist())
            self.streams.say(f"\nwarning: word probs for this context sum to {total:g} != 1 : {shown}")
        return f" / {_number(total)}"

    def rank(self, view: View, t: int, word: int, log10_p: float, *, end: bool, weight: float = 1) -> Ranks:
        """The ranks of a token."""
        known = word != self.words.index[self.words.unknown]
        return rank_word(log10_p, view.spread(t)[self.events], known=known, end=end, weight=weight)


def print_perplexity(name: str, scorer: Scorer, printer: Printer, handling: Handling, *, whole: bool) -> None:
    """`-ppl`: score a text and print what `printer.debug` asks for; `whole`: no batches (a cache runs across them)."""
    sentences = read_sentences(name, printer.words, handling, printer.streams)
    passage, sentence, ended = mark(sentences, printer.words, handling)
    summary = _Summary(printer, sentences)
    first = 0
    for start, stop in _batches(passage, whole):
        part = Passage(passage.ids[start:stop], passage.first[start:stop], passage.scored[start:stop])
        last = len(ended) if stop == len(passage.ids) else int(sentence[stop])
        batch = _Batch(part, sentence[start:stop] - first, ended[first:last], sentences.weights[first:last])
        summary.add(*_score_batch(scorer, printer, batch))
        first = last
    summary.finish(name)


def _batches(passage: Passage, whole: bool) -> Iterator[tuple[int, int]]:
    """Where the passage is cut: between sentences."""
    size = len(passage.ids)
    starts = np.flatnonzero(passage.first)
    following = np.searchsorted(starts, np.arange(0, 1 if whole else size, _BATCH))
    cuts = starts[np.unique(following[following < len(starts)])].tolist() or [0]
    yield from zip(cuts, [*cuts[1:], size], strict=True)


@dataclass(frozen=True)
class _Batch:
    """Sentences: their words, the sentence of each word (T,), and for each sentence whether it ends, and its weight."""

    part: Passage
    sentence: Ints
    ended: Mask
    weights: Floats


def _score_batch(scorer: Scorer, printer: Printer, batch: _Batch) -> tuple[Floats, dict[int, "_Line"]]:
    """The totals of each sentence (S, 5), and what there is to print about its words."""
    view = scorer.view(batch.part)
    scored = view.score()
    at = np.flatnonzero(batch.part.scored)
    unknown = batch.part.ids[at] == printer.words.index[printer.words.unknown]
    totals = tally_sentences(scored.log10_p[at], unknown, batch.sentence[at], batch.ended) * batch.weights[:, None]
    return totals, _token_lines(printer, view, scored, batch) if printer.debug >= TOKENS else {}


@dataclass
class _Line:
    """The lines of one sentence's tokens, and their ranks."""

    text: list[str] = field(default_factory=list)
    ranks: Ranks = field(default_factory=Ranks)


def _token_lines(printer: Printer, view: View, scored: Scored, batch: _Batch) -> dict[int, _Line]:
    part = batch.part
    lines: dict[int, _Line] = {sentence: _Line() for sentence in range(len(batch.ended))}
    at = np.flatnonzero(part.scored)
    begin = np.maximum.accumulate(np.where(part.first, np.arange(len(part.ids)), 0))
    # The first word of a sentence is marked by the lack of dots.
    opening = part.first[at] | ((at > 0) & part.first[at - 1] & ~part.scored[at - 1])
    columns = (at, begin[at], batch.sentence[at], opening, scored.log10_p[at], p_of(scored.log10_p[at]))
    words = part.ids.tolist()
    for t, start, sentence, opens, log10_p, p in zip(*(column.tolist() for column in columns), strict=True):
        before = (printer.name(words[t - 1]) if t > start else "") + (" " if opens else " ...")
        text = printer.token(words[t], before, scored.tag(t), p, log10_p)
        line = lines[sentence]
        line.text.append(text + printer.sum(view, t, part.ids[start:t]) + "\n")
        if printer.debug >= RANKS:
            last = t + 1 == len(words) or bool(part.first[t + 1])
            end, weight = bool(last and batch.ended[sentence]), float(batch.weights[sentence])
            line.ranks += printer.rank(view, t, words[t], log10_p, end=end, weight=weight)
    return lines


class _Summary:
    """Prints sentence by sentence, group by group (between escaped lines), and at the end the whole."""

    def __init__(self, printer: Printer, sentences: Sentences) -> None:
        self.printer = printer
        self.sentences = sentences
        self.done = 0
        self.total = Totals()
        self.group = Totals()
        self.ranks = Ranks()
        self.escapes = iter([*sentences.escapes, (1 << 62, "")])
        self.next_escape, self.escaped = next(self.escapes)
        self.grouped = False

    def add(self, totals: Floats, lines: dict[int, _Line]) -> None:
        """Sentences' totals (S, 5), and what there is to print about their tokens."""
        if self.printer.debug == 0 and not self.sentences.escapes:
            self.done += len(totals)
            self.total += Totals(*totals.sum(axis=0).tolist())
            return
        for i, row in enumerate(totals.tolist()):
            self._escape()
            self._sentence(Totals(*row), lines.get(i, _Line()))
            self.done += 1

    def _sentence(self, totals: Totals, line: _Line) -> None:
        self.total += totals
        self.group += totals
        self.ranks += line.ranks
        if self.printer.debug >= 1:
            ranks = line.ranks if self.printer.debug >= RANKS else None
            text = self.sentences.shown[self.done] + "\n" + "".join(line.text)
            self.printer.streams.print(text + block(totals, ranks) + "\n")

    def _escape(self) -> None:
        """Copy the escaped lines that stand before the next sentence."""
        while self.next_escape <= self.done:
            if self.printer.debug == 0 and self.done > 0:
                self._group()
            self.printer.streams.print(self.escaped + "\n")
            self.next_escape, self.escaped = next(self.escapes)

    def _group(self) -> None:
        self.printer.streams.print(block(self.group) + "\n")
        self.group, self.grouped = Totals(), True

    def finish(self, name: str) -> None:
        """What stands at the end of a file."""
        self._escape()
        if self.grouped:
            self._group()
        ranks = self.ranks if self.printer.debug >= RANKS else None
        self.printer.streams.print(f"file {name}: " + block(self.total, ranks))
