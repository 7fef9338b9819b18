"""Work in several processes: one `map_jobs` for serial and parallel work, with the same results and the same notes."""

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import TypeVar

from placerec.errors import PlacerecError

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[int, int], None]
log = logging.getLogger("placerec")


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_jobs(
    function: Callable[[T], R], items: Sequence[T], *, jobs: int = 1, progress: Progress | None = None
) -> list[R]:
    """`function` of every item, in order, in `jobs` processes (1: in this one).

    `function` and items must be importable and picklable. What it logs is logged here, in the order of the items. An
    exception ends all work and is raised; PlacerecError if a process is killed, for instance for want of memory.
    `progress` is called with items done and in all.
    """
    tell = progress or (lambda done, total: None)
    if jobs <= 1 or len(items) <= 1:
        return list(_serial(function, items, tell))
    with _Workers(min(jobs, len(items))) as pool:
        waiting = [pool.submit(partial(_recorded, function, log.getEffectiveLevel()), item) for item in items]
        try:
            for done, future in enumerate(as_completed(waiting), start=1):
                future.result()
                tell(done, len(items))
        except BrokenProcessPool as error:
            raise PlacerecError("a process of the work was killed; give it more memory, or fewer jobs") from error
        finally:
            pool.shutdown(cancel_futures=True)
    results = []
    for future in waiting:
        result, records = future.result()
        for record in records:
            log.handle(record)
        results.append(result)
    return results


def _serial(function: Callable[[T], R], items: Sequence[T], tell: Progress) -> Iterator[R]:
    for done, item in enumerate(items, start=1):
        yield function(item)
        tell(done, len(items))


class _Workers(ProcessPoolExecutor):
    """Processes that begin empty, so that no thread or lock of this one is copied half-way."""

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)


def _begin() -> None:
    """What a worker does first: it is to end with its parent, however that ends, and without a word."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.join,), daemon=True).start()


def _end_after(wait: Callable[[], None]) -> None:
    wait()
    os.kill(os.getpid(), signal.SIGTERM)


class _Notes(logging.Handler):
    """Keeps what is logged, ready to be sent to another process."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        record.msg, record.args = record.getMessage(), None
        self.records.append(record)


def _recorded(function: Callable[[T], R], level: int, item: T) -> tuple[R, list[logging.LogRecord]]:
    notes = _Notes()
    log.setLevel(level)
    log.propagate = False
    log.addHandler(notes)
    try:
        return function(item), notes.records
    finally:
        log.removeHandler(notes)
