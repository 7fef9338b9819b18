"""What flatters results is told: sequences of one place, labels that are strange, sequences that trained."""

import logging

import pytest

from placerec.frames.doubts import warn_of_still_sequences, warn_of_strange_labels, warn_of_training

KNOWN = ("corridor", "hall", "kitchen")


@pytest.mark.parametrize(
    ("labels", "told"),
    [
        ([["hall", "hall"], ["kitchen"]], True),
        ([["hall", "", "hall"], ["", ""]], True),
        ([["hall", "hall"], ["kitchen", "hall"]], False),
        ([["", ""]], False),
        ([], False),
    ],
)
def test_sequences_that_stay_in_one_place_are_told_if_all_do(
    labels: list[list[str]], told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    warn_of_still_sequences(labels)
    assert ("one place throughout" in caplog.text) == told


def test_a_strange_label_is_told_with_the_nearest_name(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_strange_labels([["kichen", "hall", ""], ["kichen", "attic"]], KNOWN)
    assert [record.getMessage() for record in caplog.records] == [
        "1 test frames are of 'attic', which the models do not know; they know corridor, hall, kitchen",
        "2 test frames are of 'kichen', which the models do not know; the nearest name is 'kitchen'",
    ]
    assert {record.levelno for record in caplog.records} == {logging.WARNING}


def test_where_new_places_are_looked_for_only_a_slip_of_the_pen_is_told(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_strange_labels([["kichen", "attic"]], KNOWN, expected=True)
    (record,) = caplog.records
    assert "'kichen'" in record.getMessage()


def test_sequences_that_trained_are_named_as_far_as_a_line_goes(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_training([], "words")
    assert not caplog.records
    warn_of_training([f"run{i}" for i in range(7)], "words")
    assert "run0, run1, run2, run3, run4 and 2 more: trained the words" in caplog.text
