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

    `routes`: places -> how often they followed each other, two from frame to frame (`placerec.words.place_steps`),
    three from visit to visit (`place_triples` there). `distances`: per place. Both are None where sentences were
    learned, not token streams. `dictionary`: the fingerprint, None if unknown. `frames`: how many are labelled with
    each place, in alphabetical order; empty unless token streams were read, for model.json has them elsewhere.
    """

    sequences: tuple[LearnedSequence, ...] = ()
    dictionary: str | None = None
    routes: Mapping[Route, int] | None = field(default=None, repr=False)
    distances: Mapping[str, Histogram] | None = field(default=None, repr=False)
    frames: Mapping[str, int] = field(default_factory=dict, repr=False)

    @property
    def places(self) -> list[str]:
        """The places that the sequences visited, in alphabetical order."""
        return sorted({place for sequence in self.sequences for place in sequence.visits})

    @property
    def names(self) -> list[str]:
        """The names of the sequences, in order."""
        return [sequence.name for sequence in self.sequences]

    @property
    def transitions(self) -> Ints | None:
        """How often a frame at places[i] was followed by one at places[j], int64 (C, C)."""
        return None if self.routes is None else route_table(self.routes, self.places, 2)

    @property
    def triples(self) -> Ints | None:
        """How often a visit to places[j] came from one to places[i] and led to one to places[k], int64 (C, C, C)."""
        return None if self.routes is None else route_table(self.routes, self.places, 3)


def route_table(routes: Mapping[Route, int], places: Sequence[str], n: int) -> Ints:
    """The counts of the routes over n places as a table, int64 (C,) * n in the order of `places`."""
    index = {place: i for i, place in enumerate(places)}
    table = np.zeros((len(index),) * n, np.int64)
    for route, count in routes.items():
        if len(route) == n:
            table[tuple(index[place] for place in route)] = count
    return table


def table_routes(table: Ints, places: Sequence[str]) -> dict[Route, int]:
    """The routes that a table of `route_table` counts, those that occur."""
    return {tuple(places[i] for i in at): int(table[tuple(at)]) for at in np.argwhere(table).tolist()}


def labelled_frames(stream: WordStream) -> Counter[str]:
    """How many frames of a stream are labelled with each place."""
    return Counter(place for place in stream.table.places if place)


class Recorder:
    """Makes the record of token streams that come one after the other."""

    def __init__(self) -> None:
        self._learned: list[LearnedSequence] = []
        self._routes: Counter[Route] = Counter()
        self._distances: dict[str, Histogram] = {}
        self._frames: Counter[str] = Counter()

    def add(self, stream: WordStream, sentences: Mapping[str, Sentences]) -> None:
        """Take note of a stream and its sentences per place."""
        places = sorted(sentences)
        self._learned.append(LearnedSequence(stream.name, {place: len(sentences[place]) for place in places}))
        for counts in (place_steps(stream, places), place_triples(stream, places)):
            self._routes.update(table_routes(counts, places))
        self._frames.update(labelled_frames(stream))
        labels = np.array(stream.places, np.str_)
        for place in places:
            histogram = distance_histogram(stream.distances[labels == place])
            self._distances[place] = add_histograms(self._distances.get(place, {}), histogram)

    def record(self, dictionary: str | None) -> Record:
        """The record so far, of streams in the words of `dictionary`."""
        distances, frames = dict(sorted(self._distances.items())), dict(sorted(self._frames.items()))
        return Record(tuple(self._learned), dictionary, self._routes, distances, frames)


def record_streams(streams: Iterable[tuple[WordStream, Mapping[str, Sentences]]], dictionary: str | None) -> Record:
    """The record of token streams, each with its sentences per place; one stream at a time is in memory."""
    recorder = Recorder()
    for stream, sentences in streams:
        recorder.add(stream, sentences)
    return recorder.record(dictionary)


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
    """`result` with the routes and distances of `record` plus `sign` times those of `other`, if both have any."""
    if record.routes is None or other.routes is None or record.distances is None or other.distances is None:
        return result
    routes = Counter(record.routes)
    for route, count in other.routes.items():
        routes[route] += sign * count
    first, second = record.distances, other.distances
    histograms = {
        place: add_histograms(first.get(place, {}), second.get(place, {}), sign)
        for place in sorted(first.keys() | second.keys())
    }
    left = set(result.places)
    impossible = any(count < 0 or (count and not left.issuperset(route)) for route, count in routes.items())
    for place, histogram in histograms.items():
        impossible |= min(histogram.values(), default=0) < 0 or (place not in left and bool(histogram))
    if impossible:
        names = ", ".join(other.names)
        raise ModelError(
            f"{names}: the labels, times or distances are not those that were learned; give them as they were"
        )
    kept = {place: histogram for place, histogram in histograms.items() if place in left}
    return Record(result.sequences, result.dictionary, {r: n for r, n in routes.items() if n}, kept)
