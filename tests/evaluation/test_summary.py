"""The table for the terminal."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.small_world import beliefs_of

from placerec.evaluation.metrics import evaluate
from placerec.evaluation.summary import format_evaluation, shorten


def test_the_whole_table_of_a_small_case() -> None:
    text = format_evaluation(
        evaluate(
            [
                beliefs_of("day", ["hall", "lab"], ["hall", "hall", "lab", ""], ["hall", "lab", "hall", "hall"]),
                beliefs_of("night", ["hall", "lab"], ["hall"], ["hall"]),
            ]
        )
    )
    assert text == (
        "frames             4 judged, 1 without a label left out\n"
        "accuracy           50.0 %   (majority class, always 'hall': 75.0 %)\n"
        "balanced accuracy  33.3 %   (mean recall of the places)\n"
        "change latency     1 frame, median of 1 change of place\n"
        "calibration error  0.000   (ECE: belief beside share right, 15 bins; 0 is calibrated)\n"
        "log loss           0.693   (nats per frame; 0 is best)\n"
        "risk-coverage      0.500   (area; of the surest half 50.0 % are right)\n"
        "sequences          2: 33.3 % (day) to 100.0 % (night)\n"
        "\n"
        "  #  place    frames  precision     recall\n"
        "  1  hall          3     66.7 %     66.7 %\n"
        "  2  lab           1      0.0 %      0.0 %\n"
        "\n"
        "frames by true place (rows) and decided place (columns, by number)\n"
        "            1   2\n"
        "  1  hall   2   1\n"
        "  2  lab    1   ·"
    )


@pytest.mark.parametrize("count", [2, 12, 60])
def test_long_names_and_many_places_fit_100_columns(count: int) -> None:
    places = [f"the very long name of the place with the number {number} in the left wing" for number in range(count)]
    truth = [place for place in places for _ in range(1000 // count)]
    text = format_evaluation(
        evaluate(
            [beliefs_of("s" * 200, places, truth, truth[1:] + truth[:1]), beliefs_of("t" * 200, places, truth, truth)]
        )
    )
    lines = text.split("\n")
    assert max(map(len, lines)) <= 100
    assert all(line == line.rstrip() for line in lines)
    assert not any(not line and not after for line, after in pairwise(lines))


def test_too_many_places_for_a_matrix_list_the_largest_confusions() -> None:
    places = [f"p{number}" for number in range(40)]
    best = [*places[:30], *["p0"] * 10]
    lines = format_evaluation(evaluate([beliefs_of("s", places, places + ["p7"] * 3, best + ["p8"] * 3)])).split("\n")
    start = lines.index("most frequent confusions (too many places for a matrix of this width)")
    assert lines[start + 1] == "       3  p7 taken for p8"
    assert len(lines[start:]) == 11


def test_what_is_undefined_is_a_dash() -> None:
    text = format_evaluation(evaluate([beliefs_of("s", ["a", "b"], ["a"], ["a"])]))
    assert "change latency     – (0 changes of place)" in text
    assert "  2  b             0          –          –" in text


def test_new_places_have_a_line_where_they_were_asked_for() -> None:
    made = beliefs_of("s", ["a"], ["a", "a", "z"], ["a", "a", "unknown"])
    text = format_evaluation(evaluate([replace(made, unknown=np.array([0.1, 0.3, 0.8]))]))
    assert "unknown AUROC      1.000   (1 frame of places without a column, 2 of others)" in text
    made = beliefs_of("s", ["a"], ["a"] * 3, ["a", "a", "unknown"])
    text = format_evaluation(evaluate([replace(made, unknown=np.array([0.1, 0.3, 0.8]))]))
    assert "unknown AUROC      –   (0 frames of places without a column, 3 of others)" in text
    assert "unknown AUROC" not in format_evaluation(evaluate([beliefs_of("s", ["a"], ["a"], ["a"])]))


def test_a_shortened_name_keeps_both_ends() -> None:
    assert shorten("kitchen", 7) == "kitchen"
    assert shorten("large office 12", 9) == "larg…e 12"
