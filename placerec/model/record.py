"""What model.json keeps of the training sequences: integers only, so that adding and taking away is exact."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import ModelError
from placerec.hohmm.distances import Histogram, add_histograms, distance_histogram
from placerec.words import Sentences, WordStream, place_steps


@dataclass(frozen=True)
class LearnedSequence:
    """A training sequence, and how many sentences it gave to each place that it visited (0: no selected word)."""

    name: str
    visits: Mapping[str, int]


@dataclass(frozen=True)
class Record:
    """The training sequences in order, and what was counted in them beside n-grams.

    `transitions` int64 (C, C), places in alphabetical order: see `placerec.words.place_steps`. `distances`: per place.
    Both are None where sentences were learned, not token streams. `dictionary`: the fingerprint, None if unknown.
    """

    sequences: tuple[LearnedSequence, ...] = ()
    dictionary: str | None = None
    transitions: NDArray[np.int64] | None = field(default=None, repr=False)
    distances: Mapping[str, Histogram] | None = field(default=None, repr=False)

    @property
    def places(self) -> list[str]:
        """The places that the sequences visited, in alphabetical order."""
        return sorted({place for sequence in self.sequences for place in sequence.visits})

    @property
    def names(self) -> list[str]:
        """The names of the sequences, in order."""
        return [sequence.name for sequence in self.sequences]


NO_RECORD = Record()


def record_streams(
    streams: Sequence[WordStream], sentences: Iterable[Mapping[str, Sentences]], dictionary: str | None
) -> Record:
    """The record of token streams with the sentences per place of each."""
    learned = tuple(
        LearnedSequence(stream.name, {place: len(text) for place, text in its.items()})
        for stream, its in zip(streams, sentences, strict=True)
    )
    places = Record(learned).places
    transitions = np.zeros((len(places), len(places)), np.int64)
    distances: dict[str, Histogram] = {place: {} for place in places}
    for stream, sequence in zip(streams, learned, strict=True):
        transitions += place_steps(stream, places)
        labels = np.array(stream.places, np.str_)
        for place in sequence.visits:
            histogram = distance_histogram(stream.distances[labels == place])
            distances[place] = add_histograms(distances[place], histogram)
    return Record(learned, dictionary, transitions, distances)


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
    steps = _spread(record, places) + sign * _spread(other, places)
    histograms = {place: add_histograms(its.get(place, {}), others.get(place, {}), sign) for place in places}
    left = set(result.places)
    kept = np.array([place in left for place in places], bool)
    lost = [histograms.pop(place) for place in places if place not in left]
    counts = [count for histogram in histograms.values() for count in histogram.values()]
    if steps.min() < 0 or steps[~kept].any() or steps[:, ~kept].any() or any(lost) or min(counts, default=0) < 0:
        names = ", ".join(other.names)
        raise ModelError(
            f"{names}: the labels, times or distances are not those that were learned; give them as they were"
        )
    return Record(result.sequences, result.dictionary, steps[np.ix_(kept, kept)], histograms)


def _spread(record: Record, places: Sequence[str]) -> NDArray[np.int64]:
    """The steps of a record between `places`, which hold its own."""
    spread = np.zeros((len(places), len(places)), np.int64)
    at = [places.index(place) for place in record.places]
    spread[np.ix_(at, at)] = 0 if record.transitions is None else record.transitions
    return spread


def describe_record(record: Record) -> dict[str, Any]:
    """The part of model.json that holds a record."""
    distances = record.distances
    return {
        "sequences": [{"name": s.name, "visits": dict(s.visits)} for s in record.sequences],
        "dictionary": record.dictionary,
        "transitions": None if record.transitions is None else {"counts": record.transitions.tolist()},
        "distances": distances
        and {place: {str(b): count for b, count in histogram.items()} for place, histogram in distances.items()},
    }


def read_record(path: Path, description: Mapping[str, Any]) -> Record:
    """The record in the content of the model.json `path`; ModelError if it is not there or not usable."""
    try:
        learned = tuple(
            LearnedSequence(str(item["name"]), {place: _count(n) for place, n in item["visits"].items()})
            for item in description["sequences"]
        )
        places, steps = description["places"], description["transitions"]
        distances = _distances(description)
        if Record(learned).places != places or (steps is None) != (distances is None):
            raise ValueError(places)
        transitions = steps and np.array([[*map(_count, row)] for row in steps["counts"]], np.int64)
        record = Record(learned, description["dictionary"], transitions, distances)
        if transitions is not None and transitions.shape != (len(places), len(places)):
            raise ValueError(transitions.shape)
        return record
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise ModelError(
            f"{path}: does not say which visits were learned, as an older placerec or an editor leaves it; "
            "train the model again"
        ) from error


def read_distances(path: Path, description: Mapping[str, Any]) -> list[Histogram] | None:
    """The distances of each place in the content of the model.json `path`, None if it has none; ModelError as above."""
    try:
        distances = _distances(description)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"{path}: 'distances' holds no numbers of frames; train the model again") from error
    return None if distances is None else [distances[place] for place in description["places"]]


def _distances(description: Mapping[str, Any]) -> dict[str, Histogram] | None:
    known = description["distances"]
    return known and {place: {int(b): _count(n) for b, n in known[place].items()} for place in description["places"]}


def _count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(value)
    return value
