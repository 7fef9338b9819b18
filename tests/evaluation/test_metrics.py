"""Metrics against small cases worked by hand, and against loops that follow the definitions word by word."""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median

import numpy as np
import pytest
from helpers.small_world import beliefs_of
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from placerec.errors import EvaluationError
from placerec.evaluation.confidence import reliability
from placerec.evaluation.metrics import Evaluation, change_latencies, evaluate
from placerec.hohmm.beliefs import Beliefs


def sequence(truth: str, best: str, belief: object = None, *, name: str = "seq1", places: str = "ABC") -> Beliefs:
    """One letter per frame, a dot where there is no label; by default 0.8 for the best place, the rest evenly."""
    if belief is None:
        rest = 0.2 / max(1, len(places) - 1)
        belief = [[0.8 if place == choice else rest for place in places] for choice in best]
    labels = [label.replace(".", "") for label in truth]
    return beliefs_of(name, places, labels, best, np.array(belief, dtype=np.float64).reshape(len(truth), len(places)))


def test_shares_of_a_case_worked_by_hand() -> None:
    # judged:   A A A A B B   (the dot is left out, whatever was decided there)
    # decided:  A A B C B A   -> right: 3 of 6
    # A: 2 of 4 recalled, decided 3 times of which 2 right; B: 1 of 2, decided twice, 1 right; C never true, 0 of 1.
    result = evaluate([sequence("AAA.ABB", "AABACBA")])
    assert (result.frames, result.unlabelled) == (6, 1)
    assert result.accuracy == 3 / 6
    assert result.balanced_accuracy == (2 / 4 + 1 / 2) / 2
    assert (result.majority_place, result.majority_accuracy) == ("A", 4 / 6)
    assert {name: tuple(vars(score).values()) for name, score in result.per_place.items()} == {
        "A": (2 / 3, 2 / 4, 4),
        "B": (1 / 2, 1 / 2, 2),
        "C": (0.0, None, 0),
    }
    assert result.confusion.tolist() == [[2, 1, 1], [1, 1, 0], [0, 0, 0]]


def test_balanced_accuracy_differs_where_places_are_uneven() -> None:
    # 9 of 10 frames are A and right, the one B is wrong: 90 % of frames, but (1 + 0) / 2 of places.
    result = evaluate([sequence("A" * 9 + "B", "A" * 10)])
    assert (result.accuracy, result.balanced_accuracy, result.majority_accuracy) == (0.9, 0.5, 0.9)


def test_a_tie_for_the_majority_goes_to_the_first_place_in_order() -> None:
    assert evaluate([sequence("CBBC", "AAAA")]).majority_place == "B"


def test_precision_without_a_decision_is_none() -> None:
    score = evaluate([sequence("AB", "AA")]).per_place["B"]
    assert (score.precision, score.recall, score.frames) == (None, 0.0, 1)


@pytest.mark.parametrize(
    ("truth", "best", "latencies"),
    [
        # One visit: nothing changes.
        ("AAAA", "BBBB", []),
        # B starts at 3; right at once, one late, two late, and never: the visit's 3 frames.
        ("AAABBB", "AAABBB", [0]),
        ("AAABBB", "AAAABB", [1]),
        ("AAABBB", "AAAACB", [2]),
        ("AAABBB", "AAAAAA", [3]),
        # Flicker: the first right frame counts, though the next are wrong again.
        ("AAABBB", "AAACBA", [1]),
        # Two changes; the second visit is missed, and a right C in the third visit does not count for it.
        ("AABBCC", "AAAACC", [2, 0]),
        ("AABBAA", "AAAAAA", [2, 0]),
        # Unlabelled frames between are no visit and belong to none; the change is where B's visit starts.
        ("AA..BB", "AABBAB", [1]),
        # The same place before and after is no change.
        ("AA..AA", "AABBBA", []),
        # An unlabelled frame ends a visit: B's first visit has 2 frames, its second is no change.
        ("AABB.BB", "AAAABBB", [2]),
        # Unlabelled ends.
        ("..AB..", "BBAABB", [1]),
        ("......", "AAAAAA", []),
        ("", "", []),
    ],
)
def test_latency_of_cases_worked_by_hand(truth: str, best: str, latencies: list[int]) -> None:
    index = {"A": 0, "B": 1, "C": 2, ".": -1}

    def codes(letters: str) -> NDArray[np.int64]:
        return np.array([index[letter] for letter in letters], dtype=np.int64)

    assert change_latencies(codes(truth), codes(truth) == codes(best)).tolist() == latencies


def test_latency_is_the_median_over_the_changes_of_all_sequences() -> None:
    # seq1: 0 and 2 frames; seq2: 1 frame. The end of seq1 and the start of seq2 are no change.
    result = evaluate([sequence("AABBCC", "AABBBB"), sequence("AAABBB", "AAAABB", name="seq2")])
    assert (result.changes, result.change_latency_frames) == (3, 1.0)
    alone = evaluate([sequence("AA", "AB"), sequence("BB", "AB", name="seq2")])
    assert (alone.changes, alone.change_latency_frames) == (0, None)


def test_log_loss_is_the_mean_of_natural_logarithms() -> None:
    belief = [[0.5, 0.25, 0.25], [0.5, 0.25, 0.25], [0.1, 0.1, 0.8]]
    # True places A, B, and a frame without a label: -(ln 0.5 + ln 0.25) / 2 = 1.5 ln 2.
    result = evaluate([sequence("AB.", "AAC", belief)])
    assert result.log_loss == pytest.approx(1.5 * math.log(2))


def test_no_belief_in_the_true_place_is_clipped() -> None:
    # Belief 0 in B, and D, which has no column: both -ln 1e-15 = 34.5388.
    result = evaluate([sequence("BD", "AA", [[1, 0, 0], [1, 0, 0]])])
    assert result.log_loss == pytest.approx(15 * math.log(10))
    # What is sure and right costs 0, and not -0.
    sure = evaluate([sequence("AB", "AB", np.array([[1.0, 0, 0], [0, 1 + 1e-15, 0]]))])
    assert str(sure.log_loss) == "0.0"


def test_calibration_error_of_a_case_worked_by_hand() -> None:
    # Bins are (k/15, (k+1)/15]. 0.95 and 0.99 lie in the last: mean belief 0.97, accuracy 0.5, gap 0.47, 2 frames.
    # 0.2 is 3/15 and belongs to (2/15, 3/15]: gap 0.2, 1 frame. 0.21 lies in the bin above: right, gap 0.79, 1 frame.
    confidence = np.array([0.95, 0.99, 0.2, 0.21])
    right = np.array([True, False, False, True])
    assert reliability(confidence, right).error == pytest.approx((2 * 0.47 + 0.2 + 0.79) / 4)
    # Were the edge in the bin above, 0.2 and 0.21 would share it: mean 0.205, accuracy 0.5, gap 0.295 for 2 frames.
    assert reliability(np.array([0.2, 0.21]), right[2:]).error == pytest.approx((0.2 + 0.79) / 2)


def test_calibration_counts_beliefs_of_0_and_1() -> None:
    assert reliability(np.array([0.0, 1.0]), np.array([True, False])).error == 1.0
    assert reliability(np.array([0.0, 1.0]), np.array([False, True])).error == 0.0


def test_ece_is_of_the_decided_place_not_of_the_largest_belief() -> None:
    # A Viterbi path may decide against the filter: belief 0.25 in B, which is right.
    assert evaluate([sequence("B", "B", [[0.5, 0.25, 0.25]])]).ece == pytest.approx(0.75)


def test_a_true_place_without_a_column_appears() -> None:
    result = evaluate([sequence("AZY", "AAB")])
    assert result.places == ("A", "B", "C", "Y", "Z")
    assert vars(result.per_place["Z"]) == {"precision": None, "recall": 0.0, "frames": 1}
    assert result.to_json()["confusion"] == {
        "A": {"A": 1, "B": 0, "C": 0, "Y": 0, "Z": 0},
        "B": {"A": 0, "B": 0, "C": 0, "Y": 0, "Z": 0},
        "C": {"A": 0, "B": 0, "C": 0, "Y": 0, "Z": 0},
        "Y": {"A": 0, "B": 1, "C": 0, "Y": 0, "Z": 0},
        "Z": {"A": 1, "B": 0, "C": 0, "Y": 0, "Z": 0},
    }


def with_unknown(made: Beliefs, unknown: list[float]) -> Beliefs:
    best = tuple("unknown" if new > 0.5 else place for place, new in zip(made.best, unknown, strict=True))
    return replace(made, best=best, unknown=np.array(unknown))


def test_a_place_never_trained_is_right_as_unknown() -> None:
    # True A A Z Z, decided A, unknown, unknown, A: right, wrong, right, wrong.
    result = evaluate([with_unknown(sequence("AAZZ", "AAAA", places="AB"), [0.1, 0.7, 0.9, 0.4])])
    assert result.places == ("A", "B", "Z", "unknown")
    assert (result.accuracy, result.balanced_accuracy) == (0.5, 0.5)
    assert {name: tuple(vars(score).values()) for name, score in result.per_place.items()} == {
        "A": (1 / 2, 1 / 2, 2),
        "B": (None, None, 0),
        "Z": (None, 1 / 2, 2),
        "unknown": (1 / 2, None, 0),
    }
    assert result.confusion.tolist() == [[1, 0, 0, 1], [0, 0, 0, 0], [1, 0, 0, 1], [0, 0, 0, 0]]
    # Z is found at once where it begins; the beliefs are those in A (0.8) and `unknown` together.
    assert (result.changes, result.change_latency_frames) == (1, 0)
    evidence = [0.9 * 0.8, 0.3 * 0.8, 0.9, 0.4]
    assert result.log_loss == pytest.approx(-np.log(evidence).mean())
    # 0.72 (right) and 0.7 (wrong) share a bin; 0.9 is right, and 0.6 * 0.8 in A wrong.
    assert result.ece == pytest.approx((abs(0.72 + 0.7 - 1) + abs(0.9 - 1) + 0.48) / 4)
    # Of the pairs of a frame of Z and one of A, 0.9 beats both and 0.4 beats 0.1.
    assert result.new_places is not None
    assert (result.new_places.new, result.new_places.auroc) == (2, 3 / 4)
    data = result.to_json()
    assert (data["unknown_auroc"], data["unknown_frames"]) == (3 / 4, 2)
    assert result.sequences["seq1"].accuracy == 0.5


def test_without_the_column_nobody_is_judged_by_it() -> None:
    result = evaluate([sequence("AZ", "AA")])
    assert result.new_places is None
    assert "unknown_auroc" not in result.to_json()
    assert (result.accuracy, result.per_place["Z"].recall) == (0.5, 0.0)
    # Beside a sequence that has it, one that has not counts for the accuracy alone.
    both = evaluate([sequence("AZ", "AA"), with_unknown(sequence("AZ", "AA", name="seq2"), [0.2, 0.8])])
    assert (both.accuracy, both.sequences["seq1"].accuracy, both.sequences["seq2"].accuracy) == (0.75, 0.5, 1.0)
    assert both.new_places is not None
    assert (both.new_places.new, both.new_places.known) == (1, 1)


def test_a_label_called_unknown_is_a_new_place() -> None:
    result = evaluate([with_unknown(beliefs_of("seq1", "AB", ["A", "unknown"], "AA"), [0.2, 0.8])])
    assert result.places == ("A", "B", "unknown")
    assert (result.accuracy, result.to_json()["unknown_auroc"]) == (1.0, 1.0)


def test_where_all_frames_are_known_the_area_is_undefined() -> None:
    result = evaluate([with_unknown(sequence("AB", "AB"), [0.2, 0.1])])
    assert result.to_json()["unknown_auroc"] is None


def test_sequences_may_have_different_places() -> None:
    result = evaluate([sequence("AB", "AB", places="BA"), sequence("CA", "CA", name="seq2", places="CA")])
    assert result.places == ("B", "A", "C")
    assert result.accuracy == 1
    assert result.log_loss == pytest.approx(-math.log(0.8))


def test_each_sequence_has_its_accuracy() -> None:
    result = evaluate([sequence("A.B", "ABA"), sequence("..", "AA", name="seq2")])
    assert {name: tuple(vars(score).values()) for name, score in result.sequences.items()} == {
        "seq1": (2, 1, 0.5),
        "seq2": (0, 2, None),
    }


def test_json_holds_what_the_contract_names_and_no_nan() -> None:
    data = evaluate([sequence("AAA", "AAB")]).to_json()
    assert {"frames", "unlabelled", "accuracy", "balanced_accuracy", "majority_accuracy", "per_place"} <= data.keys()
    assert {"risk_coverage", "reliability"} <= data.keys()
    assert {"confusion", "change_latency_frames", "ece", "log_loss", "sequences", "changes"} <= data.keys()
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert data["change_latency_frames"] is None


def test_beliefs_without_labels_are_refused() -> None:
    with pytest.raises(EvaluationError) as raised:
        evaluate([sequence("..", "AA"), sequence("", "", name="seq2")])
    assert str(raised.value) == (
        "no frame of seq1, seq2 has a label, so nothing can be judged; give the true places in the column `place`"
    )
    with pytest.raises(EvaluationError, match="no sequence to judge; name at least one beliefs file"):
        evaluate([])


def test_two_sequences_of_one_name_are_refused() -> None:
    with pytest.raises(EvaluationError) as raised:
        evaluate([sequence("A", "A"), sequence("B", "B")])
    assert str(raised.value) == "two sequences are called 'seq1'; rename one file or leave it out"


@st.composite
def recordings(draw: st.DrawFn) -> list[Beliefs]:
    made = []
    for number in range(draw(st.integers(1, 3))):
        truth = draw(st.text("AABBC.Z", max_size=25))
        best = draw(st.text("ABC", min_size=len(truth), max_size=len(truth)))
        cells = st.lists(st.integers(0, 15), min_size=3, max_size=3).filter(any)
        rows = draw(st.lists(cells, min_size=len(truth), max_size=len(truth)))
        belief = [[cell / sum(row) for cell in row] for row in rows]
        made.append(sequence(truth, best, belief, name=f"seq{number}"))
    return made


@given(beliefs=recordings())
def test_metrics_equal_the_plain_loops(beliefs: list[Beliefs]) -> None:
    frames = [
        (label, best, dict(zip(item.places, row, strict=True)))
        for item in beliefs
        for label, best, row in zip(item.truth, item.best, item.belief.tolist(), strict=True)
        if label
    ]
    if not frames:
        with pytest.raises(EvaluationError):
            evaluate(beliefs)
        return
    result = evaluate(beliefs)
    labels = Counter(label for label, _, _ in frames)
    assert result.frames == len(frames)
    assert result.accuracy == pytest.approx(sum(label == best for label, best, _ in frames) / len(frames))
    assert result.majority_accuracy == pytest.approx(max(labels.values()) / len(frames))
    assert result.log_loss == pytest.approx(
        sum(-math.log(max(row.get(label, 0), 1e-15)) for label, _, row in frames) / len(frames)
    )
    assert result.ece == pytest.approx(plain_ece([(row[best], label == best) for label, best, row in frames]))
    latencies = [latency for item in beliefs for latency in plain_latencies(item.truth, item.best)]
    assert result.changes == len(latencies)
    assert result.change_latency_frames == (median(latencies) if latencies else None)
    recalls = [plain_recall(result, frames, label) for label in labels]
    assert result.balanced_accuracy == pytest.approx(sum(recalls) / len(recalls))
    pairs = Counter((label, best) for label, best, _ in frames)
    cells = [[pairs[label, best] for best in result.places] for label in result.places]
    assert result.confusion.tolist() == cells


def plain_recall(result: Evaluation, frames: list[tuple[str, str, dict[str, float]]], place: str) -> float:
    decided = [best == place for label, best, _ in frames if label == place]
    recall = sum(decided) / len(decided)
    assert result.per_place[place].recall == pytest.approx(recall)
    return recall


def plain_ece(frames: list[tuple[float, bool]]) -> float:
    error = 0.0
    for number in range(15):
        low, high = number / 15, (number + 1) / 15
        inside = [pair for pair in frames if low < pair[0] <= high or (number == 0 and pair[0] == 0)]
        if inside:
            gap = abs(sum(belief for belief, _ in inside) - sum(right for _, right in inside)) / len(inside)
            error += gap * len(inside) / len(frames)
    return error


def plain_latencies(truth: Sequence[str], best: tuple[str, ...]) -> list[int]:
    visits: list[tuple[str, list[str]]] = []
    before = ""
    for label, choice in zip(truth, best, strict=True):
        if label and label == before:
            visits[-1][1].append(choice)
        elif label:
            visits.append((label, [choice]))
        before = label
    found = []
    for (previous, _), (place, choices) in pairwise(visits):
        if place != previous:
            found.append(choices.index(place) if place in choices else len(choices))
    return found
