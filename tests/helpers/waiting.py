"""Waiting in tests for what other processes do: in bounded time."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def wait_until(found: Callable[[], T | None], complaint: str) -> T:
    """The result of `found` once it is true; the test fails with `complaint` if it is not within a minute."""
    until = time.monotonic() + 60
    while not (result := found()):
        assert time.monotonic() < until, complaint
        time.sleep(0.05)
    return result
