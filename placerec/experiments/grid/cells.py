"""Models and filtering: from the token streams of one fold to the results of all its cells.

The numbers are those of `train-lm`, `decode` and `evaluate` on the same streams: the n-grams are counted once at the
highest order, and the probabilities are rounded as ARPA files hold them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from placerec.evaluation.metrics import change_latencies, evaluate, right_frames
from placerec.experiments.grid.splits import Fold
from placerec.experiments.store import WordsJob, load, save
from placerec.hohmm import Beliefs, Emissions, Transition, fixed_transition, learned_transition
from placerec.hohmm.decoder import warn_of_unlisted
from placerec.hohmm.evidence import DictionaryModels, evidence_in
from placerec.hohmm.posterior import posterior
from placerec.hohmm.transitions import Per
from placerec.lm import NgramCounts, count_ngrams
from placerec.lm.arpa import as_printed
from placerec.lm.backoff import unite_models
from placerec.lm.trie import Trie
from placerec.model import Corpus, ModelOptions, estimate_place, read_corpus
from placerec.words import Selection, WordStream, parse_selection, place_steps
from placerec.words.folder import read_streams
from placerec.words.stream import FIRST

# What is kept of an evaluation, beside counts for every sequence.
KEPT = ("frames", "accuracy", "balanced_accuracy", "majority_accuracy", "change_latency_frames", "log_loss", "ece")


class GridCell(NamedTuple):
    """How models are made of selected words, and how the filter uses them."""

    smoothing: str
    order: int
    transition: str


@dataclass(frozen=True)
class CellJob:
    """The cells of one selection on one fold: `train` and `test` are token stream files.

    `kept`: the file where results are kept, whose name is a digest of the streams and the selection.
    """

    train: tuple[Path, ...]
    test: tuple[Path, ...]
    select: str
    cells: tuple[GridCell, ...]
    stay: float
    per: Per
    kept: Path

    def name(self, cell: GridCell) -> str:
        """The key of a cell's results in `kept`: all that they depend on beside streams and selection."""
        filter_ = ("learned",) if cell.transition == "learned" else (cell.transition, f"{self.stay!r}", self.per)
        return " ".join((cell.smoothing, str(cell.order), *filter_))


@dataclass(frozen=True)
class GridJob:
    """The cells of one size, seed, fold and selection; `images`: what made the tokens, None where they were given."""

    size: int
    seed: int
    fold: Fold
    images: WordsJob | None
    work: CellJob


def run_cells(job: CellJob) -> dict[str, Any]:
    """The results of a job, by name of the cell, beside `data` (`describe_data`) and `frame-wise SMOOTHING`.

    Only those are computed that are not kept already.
    """
    results = load(job.kept)
    missing = [cell for cell in job.cells if job.name(cell) not in results]
    if missing:
        results |= _computed(job, missing)
        save(job.kept, results)
    return results


def believe_cell(job: CellJob, cell: GridCell) -> list[Beliefs]:
    """The beliefs of one cell over the test sequences, computed anew."""
    return next(_believed(job, _read(job, [cell]), [cell]))[1]


@dataclass(frozen=True)
class _Streams:
    """The streams of a job, and per place the counts of n-grams of selected words, and of all words (`whole`) alone."""

    corpus: Corpus
    training: list[WordStream]
    tests: list[WordStream]
    counts: list[NgramCounts]
    whole: Corpus
    words: list[NgramCounts]


def _read(job: CellJob, cells: Sequence[GridCell]) -> _Streams:
    corpus = read_corpus(job.train, selection=parse_selection(job.select))
    whole = read_corpus(job.train, selection=Selection())
    counts = _counts(corpus, max(cell.order for cell in cells))
    return _Streams(corpus, read_streams(job.train), read_streams(job.test), counts, whole, _counts(whole, 1))


def _computed(job: CellJob, cells: Sequence[GridCell]) -> dict[str, Any]:
    streams = _read(job, cells)
    listed = frozenset(streams.corpus.vocabulary)
    for stream in streams.tests:
        warn_of_unlisted(stream, {FIRST: listed})
    results: dict[str, Any] = {"data": describe_data(streams.training, streams.tests)}
    for smoothing in dict.fromkeys(cell.smoothing for cell in cells):
        results[f"frame-wise {smoothing}"] = _frame_wise(streams, smoothing)
    return results | {job.name(cell): judged(beliefs) for cell, beliefs in _believed(job, streams, cells)}


def _believed(job: CellJob, streams: _Streams, cells: Sequence[GridCell]) -> Iterator[tuple[GridCell, list[Beliefs]]]:
    """The cells and their beliefs; models are made once for all transitions."""
    places, listed = tuple(streams.corpus.sentences), frozenset(streams.corpus.vocabulary)
    selection = parse_selection(job.select)

    def filtered(stream: WordStream, union: Emissions, way: Transition) -> Beliefs:
        models = DictionaryModels(FIRST, union, listed)
        evidence = next(evidence_in(stream, [models], selection=selection, per=way.per, max_gap=None))
        belief, _ = posterior(evidence, way)
        return Beliefs.of(stream, places, belief, selected=evidence.selected)

    for (smoothing, order), same in groupby(sorted(cells), lambda cell: cell[:2]):
        union = _models(streams.counts, streams.corpus, smoothing, order)
        for cell in same:
            if cell.transition == "fixed":
                way = fixed_transition(len(places), job.stay, job.per)
            else:
                way = learned_transition(np.sum([place_steps(one, places) for one in streams.training], axis=0))
            yield cell, [filtered(test, union, way) for test in streams.tests]


def _counts(corpus: Corpus, order: int) -> list[NgramCounts]:
    sentences = corpus.sentences.values()
    return [count_ngrams(text, order, vocabulary=corpus.vocabulary, markers=False) for text in sentences]


def _models(counts: Sequence[NgramCounts], corpus: Corpus, smoothing: str, order: int) -> Emissions:
    """The models of the counts of a corpus' sentences, place by place."""
    options, texts = ModelOptions(order=order, smoothing=smoothing), corpus.sentences.values()
    pairs = zip(counts, texts, strict=True)
    return unite_models([as_printed(estimate_place(up_to(one, order), options, text)) for one, text in pairs])


def up_to(counts: NgramCounts, order: int) -> NgramCounts:
    """The counts of the orders up to `order` alone."""
    keys = counts.trie.keys[:order]
    return NgramCounts(Trie(counts.trie.vocabulary, keys), counts.counts[:order], counts.seen[:order])


def _frame_wise(streams: _Streams, smoothing: str) -> dict[str, int]:
    """Frames of each sequence that their own word alone gets right: naive Bayes, no filter, no selection."""
    union, places = _models(streams.words, streams.whole, smoothing, 1), list(streams.corpus.sentences)
    listed = frozenset(streams.corpus.vocabulary)
    right = {}
    for stream in streams.tests:
        known = np.array([word in listed for word in stream.words], bool)
        log10_p = union.score([word for word in stream.words if word in listed])
        best = np.array([places[i] for i in log10_p.argmax(axis=1).tolist()], np.str_)
        right[stream.name] = int((best == np.array(stream.places, np.str_)[known]).sum())
    return right


def judged(beliefs: Sequence[Beliefs]) -> dict[str, Any]:
    """What is kept of an evaluation, in plain values."""
    found = evaluate(beliefs)
    return {name: getattr(found, name) for name in KEPT} | {
        "sequences": {one.name: _counts_of(one) for one in beliefs},
        "majority": {one.name: one.truth.count(found.majority_place) for one in beliefs},
    }


def _counts_of(one: Beliefs) -> list[int]:
    """The labelled frames of a sequence, how many of them were decided rightly, and how many late."""
    truth, right = one.stream.table.places.codes(sorted({*one.truth} - {""})), right_frames(one)
    return [int((truth >= 0).sum()), int(right.sum()), int(change_latencies(truth, right).sum())]


def describe_data(training: Sequence[WordStream], tests: Sequence[WordStream]) -> dict[str, Any]:
    """Labelled images per place, and the mean run of equal words in training (readings A30)."""
    frames = sum(len(stream) for stream in training)
    runs = sum(1 + sum(a != b for a, b in zip(stream.words, stream.words[1:], strict=False)) for stream in training)
    return {"same_word_run": frames / runs, "train": _images(training), "test": _images(tests)}


def _images(streams: Sequence[WordStream]) -> dict[str, int]:
    labels = [place for stream in streams for place in stream.places if place]
    return {place: labels.count(place) for place in sorted(set(labels))}
