"""What is recorded of the training sequences: integers only, so that adding and taking away is exact."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Ints
from placerec.errors import ModelError
from placerec.hohmm.unknown import Histogram, add_histograms, distance_histogram
from placerec.words import Sentences, WordStream, place_steps, place_triples

Route = tuple[str, ...]


@dataclass(frozen=True)
class LearnedSequence:
    """A training sequence, and how many sentences it gave to each place that it visited (0: no selected word)."""

    name: str
    visits: Mapping[str, int]


@dataclass(frozen=True)
class Record:
    """The training sequences in order, and what was counted in them beside n-grams.

    `transitions` int64 (C, C), places in alphabetical order: see `placerec.words.place_steps`; `triples` int64 (C, C,
    C): see `place_triples` there. `distances`: per place. The three are None where sentences were learned, not token
    streams. `dictionary`: the fingerprint, None if unknown.
    """

    sequences: tuple[LearnedSequence, ...] = ()
    dictionary: str | None = None
    transitions: Ints | None = field(default=None, repr=False)
    distances: Mapping[str, Histogram] | None = field(default=None, repr=False)
    triples: Ints | None = field(default=None, repr=False)

    @property
    def places(self) -> list[str]:
        """The places that the sequences visited, in alphabetical order."""
        return sorted({place for sequence in self.sequences for place in sequence.visits})

    @property
    def names(self) -> list[str]:
        """The names of the sequences, in order."""
        return [sequence.name for sequence in self.sequences]


NO_RECORD = Record()


def record_streams(streams: Iterable[tuple[WordStream, Mapping[str, Sentences]]], dictionary: str | None) -> Record:
    """The record of token streams, each with its sentences per place; one stream at a time is in memory."""
    learned: list[LearnedSequence] = []
    steps: tuple[Counter[Route], Counter[Route]] = Counter(), Counter()
    distances: dict[str, Histogram] = {}
    for stream, sentences in streams:
        places = sorted(sentences)
        learned.append(LearnedSequence(stream.name, {place: len(sentences[place]) for place in places}))
        for total, found in zip(steps, (place_steps(stream, places), place_triples(stream, places)), strict=True):
            seen = np.argwhere(found).tolist()
            total.update({tuple(places[i] for i in route): int(found[tuple(route)]) for route in seen})
        labels = np.array(stream.places, np.str_)
        for place in places:
            histogram = distance_histogram(stream.distances[labels == place])
            distances[place] = add_histograms(distances.get(place, {}), histogram)
    places = Record(tuple(learned)).places
    transitions, triples = (_tabulated(counts, places, n) for n, counts in enumerate(steps, start=2))
    return Record(tuple(learned), dictionary, transitions, {place: distances[place] for place in places}, triples)


def _tabulated(counts: Mapping[Route, int], places: Sequence[str], n: int) -> Ints:
    """Counts of routes over n places as int64 (C, C) or (C, C, C)."""
    index = {place: i for i, place in enumerate(places)}
    table = np.zeros((len(places),) * n, np.int64)
    for route, count in counts.items():
        table[tuple(index[place] for place in route)] = count
    return table


def add_record(record: Record, new: Record) -> Record:
    """The record of the sequences of both, in this order."""
    both = Record((*record.sequences, *new.sequences), record.dictionary or new.dictionary)
    return _counted(both, record, new, 1)


def take_away(record: Record, gone: Record) -> Record:
    """The record without the sequences of `gone`; ModelError if more was counted in these than `record` holds."""
    names = set(gone.names)
    left = Record(tuple(s for s in record.sequences if s.name not in names), record.dictionary)
    return _counted(left, record, gone, -1)


def _counted(result: Record, record: Record, other: Record, sign: int) -> Record:
    """`result` with the steps and distances of `record` plus `sign` times those of `other`; both have them, or none."""
    its, others = record.distances, other.distances
    if its is None or others is None:
        return result
    places = sorted({*record.places, *other.places})
    steps = [_spread(mine, record.places, places) for mine in (record.transitions, record.triples)]
    for total, theirs in zip(steps, (other.transitions, other.triples), strict=True):
        total += sign * _spread(theirs, other.places, places)
    histograms = {place: add_histograms(its.get(place, {}), others.get(place, {}), sign) for place in places}
    left = set(result.places)
    kept = [i for i, place in enumerate(places) if place in left]
    lost = [histograms.pop(place) for place in places if place not in left]
    counts = [count for histogram in histograms.values() for count in histogram.values()]
    transitions, triples = (total[np.ix_(*[kept] * total.ndim)] for total in steps)
    gone = transitions.sum() < steps[0].sum() or triples.sum() < steps[1].sum()
    if gone or any(lost) or min(counts, default=0) < 0 or any(total.min() < 0 for total in steps):
        names = ", ".join(other.names)
        raise ModelError(
            f"{names}: the labels, times or distances are not those that were learned; give them as they were"
        )
    return Record(result.sequences, result.dictionary, transitions, histograms, triples)


def _spread(steps: Ints | None, places: Sequence[str], wider: Sequence[str]) -> Ints:
    """Counts (C, C) or (C, C, C) between `places` as counts between `wider` ones, which hold them."""
    assert steps is not None
    spread = np.zeros((len(wider),) * steps.ndim, np.int64)
    spread[np.ix_(*[[wider.index(place) for place in places]] * steps.ndim)] = steps
    return spread
