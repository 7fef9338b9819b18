"""Why the filter believes what it believes: for each selected word what every place's model says of it, and which words
of the last moments speak for the best place and which against it.

What a word contributed is counted in the odds between the best place and the runner-up, to first order: how the odds of
now follow its probabilities. With transitions that never change the place that is its likelihood ratio. Else it is the
sum over places c of log10 p(word | c) times

    P(c then | best now) - P(c then | runner-up now)

which the transitions make smaller step by step: words fade as the filter forgets them.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm import unknown
from placerec.hohmm.evidence import Evidence, distances_at, weighted
from placerec.hohmm.posterior import beliefs_around, unknown_ratios
from placerec.hohmm.prediction import CHUNK, transition_steps
from placerec.hohmm.transitions import Transition
from placerec.hohmm.unknown import UnknownModel
from placerec.lm import BackoffModel
from placerec.lm.inspect import explain as explain_word
from placerec.lm.logs import LOG_ZERO
from placerec.words import WordStream
from placerec.words.stream import FIRST, WordColumn, column_of

# A decision as plain data: a line of NAME.explain.jsonl (docs/files.md).
Decision = dict[str, Any]
# Of each dictionary, by name, the first one's first: the models of the places, in order.
Models = Mapping[str, Mapping[str, BackoffModel]]
# The end of the names of files with a decision a line.
EXPLAINED = ".explain.jsonl"
# How many selected words are asked for their contribution, and how many of them are named on either side.
WINDOW, NAMED = 20, 3
# What moved the odds by less, in decimal logarithms, is no argument.
LEAST = 0.01
_OF_PLACE, _OF_UNKNOWN = ("log10_p", "before", "after"), ("log10_ratio", "before", "after")


class TakenIn(NamedTuple):
    """The selected words of a frame as the filter took them in, on-line.

    `frame`: its number, from 0; `time`: seconds, None where unknown; `words`: of each of D dictionaries, None where it
    has none; `steps` of the transitions since the words before; `own` float64 (D, C): log10 p of the words in each
    place; `before`, `after` float64 (C,): the beliefs before and after them; `news` float64 (3,): see `_news`.
    """

    frame: int
    time: float | None
    words: tuple[str | None, ...]
    steps: float
    own: Floats
    before: Floats
    after: Floats
    news: Floats | None


def explain_last(taken_in: Sequence[TakenIn], models: Models, transition: Transition, alpha: float) -> Decision:
    """What decided after the last of some frames, one at least, of which WINDOW are enough."""
    frames, times, words, steps, own, before, after, news = zip(*taken_in, strict=True)
    n = len(taken_in)
    part = Evidence(np.ones(n, bool), np.arange(n), np.stack(own, axis=1), np.array(steps), alpha)
    seconds = [math.nan if time is None else time for time in times]
    first, *others = ([word or "" for word in column] for column in zip(*words, strict=True))
    stream = WordStream.of("", first, frames=map(str, frames), times=seconds)
    further = (WordColumn(tuple(column), np.full(n, np.nan)) for column in others)
    stream = replace(stream, further=dict(zip([*models][1:], further, strict=True)))
    asked = None if news[-1] is None else np.array(news)
    *_, last = _decisions(part, stream, models, transition, np.array(before), np.array(after), asked)
    return last


def explain_part(
    part: Evidence,
    stream: WordStream,
    models: Models,
    transition: Transition,
    unknown: Sequence[UnknownModel],
) -> Iterator[Decision]:
    """What decided after each selected frame of a part of a stream."""
    before, after = beliefs_around(part.log10_likelihoods, transition, part.elapsed)
    news = _news(part, transition, unknown, distances_at(stream, models, part.at)) if unknown else None
    return _decisions(part, stream, models, transition, before, after, news)


def _decisions(
    part: Evidence,
    stream: WordStream,
    models: Models,
    transition: Transition,
    before: Floats,
    after: Floats,
    news: Floats | None,
) -> Iterator[Decision]:
    """A decision for each of U frames, from the beliefs (U, C) before and after it and what it says of a new place."""
    places = tuple(models[FIRST])
    said = [_Said(own, stream, name, part.own[d], part.at) for d, (name, own) in enumerate(models.items())]
    order = np.argsort(-after, axis=1, kind="stable")
    contributed = contributions(part, transition, before, after, order[:, :2])
    numbers = np.stack([part.log10_likelihoods, before, after], axis=2)
    for t, i in enumerate(part.at.tolist()):
        best, *others = [places[column] for column in order[t].tolist()]
        recent = [
            (k, stream.frames[part.at[t - k]], word, float(contributed[d, t, k]))
            for k in range(min(WINDOW, t + 1))
            for d, one in enumerate(said)
            if (word := one.words[t - k])
        ]
        rows = zip(places, numbers[t].tolist(), strict=True)
        first, *further = said
        yield {
            "frame": stream.frames[i],
            "time": None if math.isnan(stream.times[i]) else float(stream.times[i]),
            "place": stream.places[i] or None,
            "word": first.words[t] or None,
            "history": first.history(t),
            "best_before": places[int(before[t].argmax())],
            "best": best,
            "rival": others[0] if others else None,
            "places": {place: _named(_OF_PLACE, row) | first.answer(place, t) for place, row in rows},
            **_arguments(recent),
            **({} if news is None else {"unknown": _named(_OF_UNKNOWN, news[t].tolist())}),
            **({"alpha": part.alpha, "dictionaries": {one.column: one.tell(t) for one in said}} if further else {}),
        }


class _Said:
    """What the models of one dictionary say of the selected words of a part of a stream."""

    def __init__(
        self, models: Mapping[str, BackoffModel], stream: WordStream, name: str, log10_p: Floats, at: Ints
    ) -> None:
        self.column = column_of(name)
        self._models, self._log10_p = models, log10_p
        given = stream.in_dictionary(name).words if name in stream.dictionaries else [""] * len(stream)
        silent: list[bool] = np.logical_or.reduce(np.isnan(log10_p), axis=1).tolist()
        # The words in order, "" where the dictionary says nothing; and how many selected ones came before each.
        self.words = ["" if nothing else given[i] for i, nothing in zip(at.tolist(), silent, strict=True)]
        self._selected = [word for word in self.words if word]
        self._before = [0, *accumulate(bool(word) for word in self.words)]
        self._longest = max(model.order for model in models.values()) - 1
        self._answer = _answers(models)

    def history(self, t: int) -> list[str]:
        """The words that the models see before the one of frame t."""
        end = self._before[t]
        return self._selected[max(0, end - self._longest) : end]

    def answer(self, place: str, t: int) -> dict[str, Any]:
        """Which order of the place's model answered for the word of frame t, and the backoffs paid."""
        word = self.words[t]
        return self._answer(place, (*self.history(t), word)) if word else {"order": None, "backoffs": []}

    def tell(self, t: int) -> dict[str, Any]:
        """Word and history of frame t, and of each place log10 p, the order that answered and the backoffs paid."""
        rows = zip(self._models, self._log10_p[t].tolist(), strict=True)
        places = {place: {"log10_p": _short(p)} | self.answer(place, t) for place, p in rows}
        return {"word": self.words[t] or None, "history": self.history(t), "places": places}


def contributions(part: Evidence, transition: Transition, before: Floats, after: Floats, pair: Ints) -> Floats:
    """How far the last WINDOW words of each dictionary moved the odds between two places: log10, (D, U, WINDOW).

    `before`, `after` (U, C): the filter's beliefs; `pair` (U, 2): the places. Column k: of the word k selected frames
    ago; 0 where there is none. For one place alone all are 0.
    """
    U, C = after.shape
    found = np.zeros((len(part.own), U, WINDOW))
    if C < 2:
        return found
    evidence = np.maximum(np.nan_to_num(weighted(part.alpha, part.own), nan=0.0, neginf=-np.inf), LOG_ZERO)
    # Words that no place explains left the prediction as it was.
    evidence[:, np.isneginf(part.log10_likelihoods).all(axis=1)] = 0.0
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
            found[:, now, k] = (weight * evidence[:, now - k]).sum(axis=2)
    return found


def _news(part: Evidence, transition: Transition, models: Sequence[UnknownModel], distances: Floats) -> Floats:
    """Per selected frame what it says of a new place, log10, and the probability of that before and after: (U, 3)."""
    ratios = unknown_ratios(part, transition, models, distances)
    places = part.own.shape[2]
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


def _arguments(recent: Iterable[tuple[int, str, str, float]]) -> dict[str, list[dict[str, Any]]]:
    """The words that argued most `for` the best place, and most `against` it, the strongest first.

    `recent`: how many frames ago, frame, word, and how far it moved the odds, the latest first; a word that comes
    several times argues once, with the sum.
    """
    sums: dict[str, float] = {}
    heard: dict[str, list[tuple[int, str]]] = {}
    for ago, frame, word, moved in recent:
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
