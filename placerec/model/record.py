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
    places = sorted({place for sequence in learned for place in sequence.visits})
    transitions = np.zeros((len(places), len(places)), np.int64)
    distances: dict[str, Histogram] = {place: {} for place in places}
    for stream, sequence in zip(streams, learned, strict=True):
        transitions += place_steps(stream, places)
        labels = np.array(stream.places, np.str_)
        for place in sequence.visits:
            histogram = distance_histogram(stream.distances[labels == place])
            distances[place] = add_histograms(distances[place], histogram)
    return Record(learned, dictionary, transitions, distances)


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
        size = len(description["places"])
        steps, known = description["transitions"], description["distances"]
        transitions = None if steps is None else np.array([[*map(_count, row)] for row in steps["counts"]], np.int64)
        distances = known and {
            place: {int(b): _count(count) for b, count in known[place].items()} for place in description["places"]
        }
        return Record(
            learned,
            description["dictionary"],
            None if transitions is None else transitions.reshape(size, size),
            distances,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(
            f"{path}: does not say which visits were learned, as an older placerec or an editor leaves it; "
            "train the model again"
        ) from error


def _count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(value)
    return value
