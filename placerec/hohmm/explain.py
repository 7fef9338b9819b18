"""Why the filter believes what it believes: for each selected word what every place's model says of it, and which words
of the last moments speak for the best place and which against it.

What a word contributed is counted in the odds between the best place and the runner-up, to first order: how the odds of
now follow its probabilities. With transitions that never change the place that is its likelihood ratio. Else it is the
sum over places c of log10 p(word | c) times

    P(c then | best now) - P(c then | runner-up now)

which the transitions make smaller step by step: words fade as the filter forgets them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm import unknown
from placerec.hohmm.evidence import Evidence
from placerec.hohmm.posterior import beliefs_around, unknown_ratios
from placerec.hohmm.prediction import CHUNK, transition_steps
from placerec.hohmm.transitions import Transition
from placerec.hohmm.unknown import UnknownModel
from placerec.lm import BackoffModel
from placerec.lm.inspect import explain as explain_word
from placerec.lm.logs import LOG_ZERO
from placerec.words import WordStream

# A decision as plain data: a line of NAME.explain.jsonl (docs/files.md).
Decision = dict[str, Any]
# The end of the names of files with a decision a line.
EXPLAINED = ".explain.jsonl"
# How many selected words are asked for their contribution, and how many of them are named on either side.
WINDOW, NAMED = 20, 3
# What moved the odds by less, in decimal logarithms, is no argument.
LEAST = 0.01
_OF_PLACE, _OF_UNKNOWN = ("log10_p", "before", "after"), ("log10_ratio", "before", "after")


class TakenIn(NamedTuple):
    """A selected word as the filter took it in, on-line.

    `frame`: its number, from 0; `time`: seconds, None where unknown; `steps` of the transitions since the word before;
    `log10_likelihoods`, `before`, `after` float64 (C,): of the word in each place, and the beliefs before and after it;
    `news` float64 (3,): see `_news`.
    """

    frame: int
    time: float | None
    word: str
    steps: float
    log10_likelihoods: Floats
    before: Floats
    after: Floats
    news: Floats | None


def explain_last(taken_in: Sequence[TakenIn], models: Mapping[str, BackoffModel], transition: Transition) -> Decision:
    """What decided after the last of some words, one at least, of which WINDOW are enough."""
    frames, times, words, steps, log10_likelihoods, before, after, news = zip(*taken_in, strict=True)
    n = len(taken_in)
    part = Evidence(np.ones(n, bool), np.arange(n), np.array(log10_likelihoods), np.array(steps))
    seconds = [math.nan if time is None else time for time in times]
    stream = WordStream.of("", words, frames=map(str, frames), times=seconds)
    asked = None if news[-1] is None else np.array(news)
    *_, last = _decisions(part, stream, models, transition, np.array(before), np.array(after), asked)
    return last


def explain_part(
    part: Evidence,
    stream: WordStream,
    models: Mapping[str, BackoffModel],
    transition: Transition,
    unknown: UnknownModel | None,
) -> Iterator[Decision]:
    """What decided after each selected word of a part of a stream; `models` of the places, in order."""
    before, after = beliefs_around(part.log10_likelihoods, transition, part.elapsed)
    news = None if unknown is None else _news(part, transition, unknown, stream.distances[part.at])
    return _decisions(part, stream, models, transition, before, after, news)


def _decisions(
    part: Evidence,
    stream: WordStream,
    models: Mapping[str, BackoffModel],
    transition: Transition,
    before: Floats,
    after: Floats,
    news: Floats | None,
) -> Iterator[Decision]:
    """A decision for each of U words, from the beliefs (U, C) before and after it and what it says of a new place."""
    places = tuple(models)
    answer = _answers(models)
    longest = max(model.order for model in models.values()) - 1
    order = np.argsort(-after, axis=1, kind="stable")
    contributed = contributions(part, transition, before, after, order[:, :2])
    words = [stream.words[i] for i in part.at.tolist()]
    numbers = np.stack([part.log10_likelihoods, before, after], axis=2)
    for t, i in enumerate(part.at.tolist()):
        history = words[max(0, t - longest) : t]
        best, *others = [places[column] for column in order[t].tolist()]
        recent = [(stream.frames[part.at[t - k]], words[t - k]) for k in range(min(WINDOW, t + 1))]
        said = zip(places, numbers[t].tolist(), strict=True)
        yield {
            "frame": stream.frames[i],
            "time": None if math.isnan(stream.times[i]) else float(stream.times[i]),
            "place": stream.places[i] or None,
            "word": words[t],
            "history": history,
            "best_before": places[int(before[t].argmax())],
            "best": best,
            "rival": others[0] if others else None,
            "places": {place: _named(_OF_PLACE, row) | answer(place, (*history, words[t])) for place, row in said},
            **_arguments(recent, contributed[t].tolist()),
            **({} if news is None else {"unknown": _named(_OF_UNKNOWN, news[t].tolist())}),
        }


def contributions(part: Evidence, transition: Transition, before: Floats, after: Floats, pair: Ints) -> Floats:
    """How far each of the last WINDOW words moved the odds between two places: log10, float64 (U, WINDOW).

    `before`, `after` (U, C): the filter's beliefs; `pair` (U, 2): the places. Column k: of the word k selected frames
    ago; 0 where there is none. For one place alone all are 0.
    """
    U, C = after.shape
    found = np.zeros((U, WINDOW))
    if C < 2:
        return found
    evidence = np.maximum(part.log10_likelihoods, LOG_ZERO)
    # A word that no place explains left the prediction as it was.
    evidence[np.isneginf(part.log10_likelihoods).all(axis=1)] = 0.0
    steps = transition_steps(transition, part.elapsed[1:])
    for start in range(0, U, CHUNK):
        stop, first = min(start + CHUNK, U), max(0, start - WINDOW)
        matrices = np.moveaxis(steps.matrices(slice(first, stop - 1)), 2, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            # P(place then | place one word later, words up to then).
            earlier = after[first : stop - 1, :, None] * matrices / before[first + 1 : stop, None, :]
        earlier = np.nan_to_num(earlier, posinf=0.0)
        weight = np.eye(C)[pair[start:stop, 0]] - np.eye(C)[pair[start:stop, 1]]
        now = np.arange(start, stop)
        for k in range(WINDOW):
            if k:
                weight, now = weight[now >= k], now[now >= k]
                weight = np.einsum("tij,tj->ti", earlier[now - k - first], weight)
            found[now, k] = (weight * evidence[now - k]).sum(axis=1)
    return found


def _news(part: Evidence, transition: Transition, model: UnknownModel, distances: Floats) -> Floats:
    """Per selected word what it says of a new place, log10, and the probability of that before and after: (U, 3)."""
    ratios = unknown_ratios(part, transition, model, distances)
    places = part.log10_likelihoods.shape[1]
    before, after = beliefs_around(unknown.chain_evidence(ratios, places), unknown.CHAIN, part.elapsed)
    before[:1, 0], _ = unknown.prior(places)
    return np.stack([ratios / math.log(10), before[:, 0], after[:, 0]], axis=1)


def _answers(models: Mapping[str, BackoffModel]) -> Callable[[str, tuple[str, ...]], dict[str, Any]]:
    """A function that tells for a place and words which order answered for the last one, and the backoffs paid."""

    @cache
    def answer(place: str, words: tuple[str, ...]) -> dict[str, Any]:
        *shortened, found = explain_word(models[place], words)["steps"]
        paid = [step["log10_backoff"] for step in shortened]
        return {"order": len(found["ngram"].split(" ")), "backoffs": [None if w is None else _short(w) for w in paid]}

    return answer


def _arguments(recent: Sequence[tuple[str, str]], contributed: Sequence[float]) -> dict[str, list[dict[str, Any]]]:
    """The words that argued most `for` the best place, and most `against` it, the strongest first.

    `recent`: frame and word, the latest first; a word that comes several times argues once, with the sum.
    """
    sums: dict[str, float] = {}
    heard: dict[str, list[tuple[int, str]]] = {}
    for ago, ((frame, word), moved) in enumerate(zip(recent, contributed, strict=False)):
        sums[word] = sums.get(word, 0.0) + moved
        heard.setdefault(word, []).insert(0, (ago, frame))
    named: list[dict[str, Any]] = [
        {
            "word": word,
            "frames": [frame for _, frame in heard[word]],
            "ago": [ago for ago, _ in heard[word]],
            "log10_odds": _short(sums[word]),
        }
        for word in sorted(sums, key=lambda word: -sums[word])
    ]
    supporting = [one for one in named if sums[one["word"]] > LEAST]
    opposing = [one for one in reversed(named) if sums[one["word"]] < -LEAST]
    return {"for": supporting[:NAMED], "against": opposing[:NAMED]}


def _named(names: Sequence[str], values: Sequence[float]) -> dict[str, float | None]:
    return dict(zip(names, map(_short, values), strict=True))


def _short(value: float) -> float | None:
    """Six significant digits: a file to read; None for what is not finite."""
    return float(f"{value:.6g}") if math.isfinite(value) else None
