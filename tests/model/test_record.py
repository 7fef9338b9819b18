"""What model.json keeps of the training sequences: what is taken away must have been there."""

import math

import pytest

from placerec.errors import ModelError
from placerec.model.record import Record, add_record, record_streams, take_away
from placerec.words import Selection, WordStream, sentences_per_place


def recorded(streams: dict[str, list[str]]) -> Record:
    """The record of sequences by the labels of their frames; all words are equal."""
    made = [WordStream.of(name, ["w0"] * len(labels), labels) for name, labels in streams.items()]
    return record_streams([(stream, sentences_per_place([stream], Selection("unique"))) for stream in made], None)


@pytest.mark.parametrize(("lost", "edited"), [("ab", "a-b"), ("aba", "ab-ba")])
def test_what_led_to_a_place_that_goes_cannot_stay(lost: str, edited: str) -> None:
    """Only run1 was in b; a frame without a label cuts a step, or the way from a over b to a."""
    record = recorded({"run1": [*lost], "run2": ["a"]})
    assert take_away(record, recorded({"run1": [*lost]})).places == ["a"]
    with pytest.raises(ModelError, match=r"^run1: the labels, times or distances are not those that were learned"):
        take_away(record, recorded({"run1": [place.strip("-") for place in edited]}))


@pytest.mark.parametrize("distance", [math.nan, 4.0])
def test_distances_in_a_place_that_goes_cannot_stay(distance: float) -> None:
    streams = [WordStream.of("run1", ["w0"], ["b"], distances=[far]) for far in (1.0, distance)]
    learned, edited = (record_streams([(stream, {"b": [["w0"]]})], None) for stream in streams)
    both = add_record(recorded({"run2": ["a"]}), learned)
    assert take_away(both, learned).places == ["a"]
    with pytest.raises(ModelError, match=r"^run1: the labels, times or distances are not those that were learned"):
        take_away(both, edited)
