"""`ngram-count -count-lm`: the weights of a count model by EM on a text."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats
from placerec.lm.counts import NgramCounts
from placerec.lm.score import TokenSequence
from placerec.lm.vocabulary import SENTENCE_START
from placerec.srilm.model.count_models import CountModel, CountView, Level, format_count_model, read_count_model
from placerec.srilm.model.scorers import event_mask
from placerec.srilm.order.counts import FirstSeen
from placerec.srilm.text.streams import SrilmError, Streams
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.options import Parsed


def write_count_model(
    options: Parsed, counts: NgramCounts, words: WordList, first: FirstSeen, streams: Streams
) -> None:
    """Estimate the weights of -init-lm's model on `counts` and write the model to -lm."""
    if not options["init-lm"]:
        raise SrilmError("count-lm estimation needs initial model")
    order = max(1, options["order"])
    model = read_count_model(options["init-lm"], words, streams, order, "format error in init-lm file")
    samples = _samples(model, counts, first)
    before = 0.0
    for i in range(options["em-iters"]):
        expected = _expected(model, samples)
        streams.say(f"iteration {i}: log likelihood = {expected.log10_p:g}")
        if i and abs(expected.log10_p - before) < options["em-delta"] * abs(expected.log10_p):
            break
        before = expected.log10_p
        _tell(expected, options["debug"], streams)
        found = expected.total > 0
        weights = np.where(found, expected.taken / np.where(found, expected.total, 1), model.weights)
        model = replace(model, weights=weights)
    with streams.output(options["lm"]) as file:
        file.writelines(text.encode("latin-1") for text in format_count_model(model, whole=False))


class _Samples(NamedTuple):
    """N-grams whose last words are to be predicted: how often they occur (m,), and the model's counts for them."""

    times: Floats
    levels: list[Level]


class _Expected(NamedTuple):
    """log10 p of all samples; how often each weight's part is expected to have been asked, and to have answered."""

    log10_p: float
    taken: Floats
    total: Floats


def _samples(model: CountModel, counts: NgramCounts, first: FirstSeen) -> _Samples:
    """The n-grams whose last word is predicted with as much context as there is, order by order in SRILM's walk."""
    words, trie = model.words, counts.trie
    numbers = words.numbers(trie.vocabulary)
    events = event_mask(words)
    matrices = [numbers[trie.matrix(n)] for n in range(1, counts.order + 1)]
    ids: list[int] = []
    lengths, times = [], []
    orders, rows = first.walk(counts)
    by_order = np.argsort(orders, kind="stable")
    for n, row in zip(orders[by_order].tolist(), rows[by_order].tolist(), strict=True):
        ngram, count = matrices[n - 1][row].tolist(), counts.counts[n - 1][row]
        # Shorter ones than the longest stand at the beginning of sentences.
        whole = n == model.order or (n < model.order and ngram[0] == words.index[SENTENCE_START])
        if whole and events[ngram[-1]] and count > 0:
            ids += ngram
            lengths.append(n)
            times.append(float(count))
    last = np.cumsum(lengths, dtype=np.int64) - 1
    opening, scored = np.zeros(len(ids), bool), np.zeros(len(ids), bool)
    opening[last - np.array(lengths, np.int64) + 1] = scored[last] = True
    view = CountView(model, TokenSequence(np.array(ids, np.int64), opening, scored))
    levels = [Level(level.count[last], level.context[last], level.there[last]) for level in view.levels(view.digits)]
    return _Samples(np.array(times, np.float64), levels)


def _expected(model: CountModel, samples: _Samples) -> _Expected:
    """The E-step: from the longest context down, what each order has answered; the rest goes to the next shorter."""
    taken, total = np.zeros_like(model.weights), np.zeros_like(model.weights)
    times, levels = samples
    mixed = [model.mixed(levels[: k + 1]) for k in range(len(levels))]
    possible = mixed[-1] > 0
    log10_p = float(times[possible] @ np.log10(mixed[-1][possible]))
    left = np.where(possible, times, 0.0)
    for k in range(len(levels) - 1, -1, -1):
        there = np.flatnonzero(levels[k].there & (mixed[k] > 0))
        row = model.row(levels[k].context[there])
        share = model.weights[row, k] * levels[k].ratio[there] / mixed[k][there]
        np.add.at(taken[:, k], row, left[there] * share)
        np.add.at(total[:, k], row, left[there])
        left[there] *= 1 - share
    return _Expected(log10_p, taken, total)


def _tell(expected: _Expected, debug: int, streams: Streams) -> None:
    """The expected counts (-debug 1), or which weights stay for want of data."""
    for row, (taken, total) in enumerate(zip(expected.taken.tolist(), expected.total.tolist(), strict=True)):
        if debug >= 1:
            shown = " ".join(f"{part:g}/{whole:g}" for part, whole in zip(taken, total, strict=True))
            streams.say(f"posterior counts {row}: {shown}")
            continue
        for k, whole in enumerate(total[1:], start=1):
            if not whole:
                streams.say(f"warning: no data to estimate mixture weight for count {row}, order {k}")
