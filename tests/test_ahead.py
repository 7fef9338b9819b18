"""Work done in other threads: in order, not too far ahead, and with their errors."""

import threading
import time
from collections.abc import Iterator

import pytest

from placerec import ahead
from placerec.ahead import look_ahead, make_ahead, work_ahead


def test_results_come_in_order() -> None:
    def late(number: int) -> int:
        time.sleep(0.002 * (number % 3))
        return number * number

    assert list(work_ahead(late, range(20))) == [number * number for number in range(20)]
    assert list(work_ahead(late, [])) == []


def test_only_some_tasks_are_begun_and_nobody_waits_for_those_that_are_left() -> None:
    begun: list[int] = []
    left: list[int] = []

    def begin(item: int) -> int:
        begun.append(item)
        return -item

    results = look_ahead(begin, abs, range(10**9), 3, at_end=left.extend)
    assert [next(results), next(results)] == [0, 1]
    assert begun == [0, 1, 2, 3, 4]
    results.close()  # type: ignore[attr-defined]
    assert left == [-2, -3, -4]
    assert list(look_ahead(begin, abs, range(5), 3, at_end=left.extend)) == [0, 1, 2, 3, 4]
    assert left == [-2, -3, -4]


def test_items_come_in_order_from_another_thread() -> None:
    makers = set()

    def items() -> Iterator[int]:
        for number in range(100):
            makers.add(threading.get_ident())
            yield number

    assert list(make_ahead(items())) == list(range(100))
    assert len(makers) == 1
    assert threading.get_ident() not in makers
    assert list(make_ahead(())) == []


def test_not_too_many_items_are_made_ahead() -> None:
    made = []

    def items() -> Iterator[int]:
        for number in range(10 * ahead._AHEAD):
            made.append(number)
            yield number

    for number in make_ahead(items()):
        time.sleep(0.001)
        # One more is held by who made it, until there is room.
        assert len(made) <= number + ahead._AHEAD + 2


def test_an_error_comes_after_what_was_made_before() -> None:
    def items() -> Iterator[int]:
        yield from range(3)
        raise ValueError("broken")

    found: list[int] = []
    with pytest.raises(ValueError, match="broken"):
        found.extend(make_ahead(items()))
    assert found == [0, 1, 2]


def test_who_stops_early_leaves_no_thread_and_no_open_iterator() -> None:
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            yield from range(10**9)
        finally:
            closed.set()

    before = threading.active_count()
    taken = make_ahead(items())
    assert next(taken) == 0
    taken.close()  # type: ignore[attr-defined]
    assert closed.wait(10)
    end = time.monotonic() + 10
    while threading.active_count() > before and time.monotonic() < end:
        time.sleep(0.01)
    assert threading.active_count() == before
