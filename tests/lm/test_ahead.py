"""Work in other threads: the results and errors of work in one, and what is set for the caller holds for all."""

from collections.abc import Iterator
from threading import get_ident

import numpy as np
import pytest

from placerec.lm.ahead import work_ahead


@pytest.mark.parametrize("size", range(6))
def test_results_come_in_order(size: int) -> None:
    assert list(work_ahead(lambda n: n * n, iter(range(size)))) == [n * n for n in range(size)]


def test_work_is_done_beside_and_items_are_read_as_needed() -> None:
    read = []

    def items() -> Iterator[int]:
        for n in range(10):
            read.append(n)
            yield n

    results = work_ahead(lambda n: get_ident(), items())
    assert next(results) != get_ident()
    assert read == [0, 1, 2]


@pytest.mark.parametrize("bad", [0, 1, 2, 3])
def test_errors_come_where_the_result_would(bad: int) -> None:
    results = work_ahead(lambda n: 1 // (n - bad), range(4))
    assert [next(results) for _ in range(bad)] == [1 // (n - bad) for n in range(bad)]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_errors_in_numbers_are_treated_as_for_the_caller() -> None:
    with np.errstate(divide="ignore"):
        assert all(np.isneginf(list(work_ahead(np.log, np.zeros((4, 1))))))
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        list(work_ahead(np.log, np.array([1.0, 0.0])))
