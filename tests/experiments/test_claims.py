"""Claims on results whose truth is known, and the bootstrap beside a slow version."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from placerec.evaluation.bootstrap import draw
from placerec.experiments.grid.claims import CANNOT_TELL, FAILS, HOLDS, NOT_TRIED, judge
from placerec.experiments.grid.results import MissingCellsError, Results, Row, SequenceCount, scores

SELECTS = ("none", "subsample:3", "subsample:5", "compress:3", "unique")
Percent = Callable[[int, str, str, int, int], float]


def grid(
    percent: Percent,
    *,
    sizes: Sequence[int] = (10, 20),
    smoothings: Sequence[str] = ("witten-bell", "lidstone-backoff"),
    selects: Sequence[str] = SELECTS,
    orders: Sequence[int] = (1, 2, 3, 4, 5, 6),
    sequences: int = 6,
) -> Results:
    """Results of two seeds; `percent` of size, smoothing, selection, order and sequence are right."""
    rows = []
    for size in sizes:
        for seed in (0, 1):
            for smoothing in smoothings:
                for select in selects:
                    for order in orders:
                        counts = {}
                        for s in range(sequences):
                            frames = 1000 * (s + 1)
                            right = round(frames * percent(size, smoothing, select, order, s) / 100) + (2 * seed - 1)
                            counts[f"run{s}"] = SequenceCount(frames, right, 0, frames // 3, 0)
                        rows.append(row(size, seed, smoothing, select, order, counts))
    return Results(rows, {})


def row(size: int, seed: int, smoothing: str, select: str, order: int, counts: dict[str, SequenceCount]) -> Row:
    return Row(size, seed, "test", smoothing, select, order, "fixed", 0, 0, 0, 0, 0, None, 0, 0, counts)


def as_the_paper_says(size: int, smoothing: str, select: str, order: int, sequence: int) -> float:
    """Sequences differ far more than cells do: only pairs tell."""
    large, wb = size == 20, smoothing == "witten-bell"
    percent = 68.0 + 3 * large - 5 * (order == 1) + 3 * (sequence - 3)
    if select == "unique":
        return percent + 6 + 8 * (large and wb) + wb
    percent += 0.6 * (order % 2) + wb * (0.3 + 0.2 * order)
    if select == "none":
        return percent - max(0, order - 2)
    gain = {"subsample:3": 5.5, "subsample:5": 3.0, "compress:3": 4.0}[select]
    if large and select == "subsample:5":
        gain = 13.9 if wb else -5
    if large and wb and select == "compress:3":
        gain = -3
    return percent + gain


def otherwise(size: int, smoothing: str, select: str, order: int, sequence: int) -> float:
    large, wb = size == 20, smoothing == "witten-bell"
    loss = {"none": 0, "subsample:3": 4, "subsample:5": 2, "compress:3": 3, "unique": 6}[select]
    percent = 40.0 - 3 * large - 2 * wb + 5 * (order == 1) - 3 * max(0, order - 2) * (select != "none")
    return percent - loss + 8 * (large and wb and select == "compress:3") + 0.5 * sequence


def either(size: int, smoothing: str, select: str, order: int, sequence: int) -> float:
    """Half of the sequences say one thing, half the other."""
    sign = 1 if sequence % 2 else -1.2
    rank = 3.0 * SELECTS.index(select) + 4 * (size == 20) + 3 * (smoothing == "witten-bell")
    return 80 + sign * (rank - 20 + order * (1 + (select != "none") + (smoothing == "witten-bell"))) * 0.8


def test_the_papers_claims_hold_where_they_are_true() -> None:
    claims = judge(grid(as_the_paper_says), "fixed")
    assert [claim.name for claim in claims] == [f"O{i}" for i in range(1, 12)]
    for claim in claims:
        verdicts = [(one.text, one.verdict, one.interval) for one in claim.statements]
        assert claim.verdict == HOLDS, verdicts


def test_they_do_not_hold_where_they_are_false() -> None:
    for claim in judge(grid(otherwise), "fixed"):
        verdicts = [(one.text, one.verdict, one.interval) for one in claim.statements]
        assert claim.verdict == FAILS, (claim.name, verdicts)


def test_sequences_that_disagree_cannot_tell() -> None:
    verdicts = {claim.name: claim.verdict for claim in judge(grid(either), "fixed")}
    assert {name: verdicts[name] for name in ("O1", "O2", "O3", "O7", "O8", "O9", "O10", "O11")} == dict.fromkeys(
        ("O1", "O2", "O3", "O7", "O8", "O9", "O10", "O11"), CANNOT_TELL
    )


@pytest.mark.parametrize(
    ("lacking", "name", "reason", "verdict"),
    [
        ({"sizes": [10]}, "O1", "the grid has one size only", NOT_TRIED),
        ({"selects": SELECTS[1:]}, "O2", "the grid has no select none", NOT_TRIED),
        ({"selects": ["none"]}, "O2", "the grid has no select for it", NOT_TRIED),
        ({"selects": ["none", "unique"]}, "O3", "the grid has no select subsample:3", NOT_TRIED),
        ({"sizes": [10, 15]}, "O4", "the grid has no size 20", CANNOT_TELL),
        ({"selects": ["none", "unique"]}, "O5", "the grid has no select compress:3", NOT_TRIED),
        ({"sizes": [20], "smoothings": ["witten-bell"]}, "O5", "nothing but S = 20 with Witten-Bell", CANNOT_TELL),
        ({"orders": [1, 2]}, "O6", "the grid has no two orders above 1", CANNOT_TELL),
        ({"orders": [2]}, "O7", "the grid has one order only", NOT_TRIED),
        ({"smoothings": ["witten-bell"]}, "O8", "the grid has no smoothing lidstone-backoff or lidstone", NOT_TRIED),
        ({"orders": [2, 3]}, "O9", "the grid has no order 1", NOT_TRIED),
        ({"orders": [1, 2]}, "O10", "the grid has no order for it", NOT_TRIED),
        ({"sequences": 5}, "O11", "5 test sequences; a verdict needs 6 or more", CANNOT_TELL),
    ],
)
def test_what_the_grid_lacks_is_told(lacking: dict[str, Sequence[int]], name: str, reason: str, verdict: str) -> None:
    claims = {claim.name: claim for claim in judge(grid(as_the_paper_says, **lacking), "fixed")}  # type: ignore[arg-type]
    assert claims[name].verdict == verdict
    assert all((one.verdict == NOT_TRIED) == (one.values is None) for one in claims[name].statements)
    assert any(reason in statement.reason for statement in claims[name].statements)


def test_other_smoothings_do_not_count_beside_the_papers() -> None:
    more = grid(as_the_paper_says, smoothings=("witten-bell", "lidstone-backoff", "absolute"))
    for one, other in zip(judge(more, "fixed"), judge(grid(as_the_paper_says), "fixed"), strict=True):
        assert [s.interval for s in one.statements] == [s.interval for s in other.statements]


def test_the_bootstrap_is_that_of_a_slow_version() -> None:
    results = grid(either, orders=(1, 2), selects=("none", "unique"), sequences=4)
    found = scores(results.rows, draws=50)
    weights = np.concatenate([np.ones((1, 4)), draw(4, 0, 50)])
    assert (weights[0] == 1).all()
    assert (weights.sum(axis=1) == 4).all()
    for d, weight in enumerate(weights.astype(int)):
        chosen = [f"run{s}" for s in range(4) for _ in range(weight[s])]
        for size in (10, 20):
            for smoothing in ("witten-bell", "lidstone-backoff"):
                accuracies = []
                for row in results.rows:
                    if (row.size, row.smoothing, row.select, row.order) == (size, smoothing, "unique", 2):
                        right = sum(row.sequences[name].right for name in chosen)
                        accuracies.append(100 * right / sum(row.sequences[name].frames for name in chosen))
                cell = found.take(size=[size], smoothing=[smoothing], select=["unique"], order=[2])
                assert cell[..., d].item() == pytest.approx(np.mean(accuracies))
    assert found.majority == pytest.approx(33.3, abs=0.1)


def test_an_interval_needs_two_sequences() -> None:
    for sequences, there in ((1, False), (2, True)):
        for claim in judge(grid(as_the_paper_says, sequences=sequences), "fixed"):
            assert claim.verdict == CANNOT_TELL
            for one in claim.statements:
                assert one.values is not None
                assert (one.interval is not None) == there


def test_a_cell_that_is_not_there_is_told() -> None:
    with pytest.raises(MissingCellsError, match="no order 7"):
        scores(grid(either, orders=(1,)).rows).take(order=[7])
