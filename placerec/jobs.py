"""A function mapped over items in threads or processes: results and log records come in the order of the items."""

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from placerec.ahead import look_ahead
from placerec.errors import PlacerecError

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
R = TypeVar("R")
_Pool = TypeVar("_Pool", ThreadPoolExecutor, ProcessPoolExecutor)
Progress = Callable[[int, int], None]  # items done, items in all
# Shows what is being done under a label, as long as it takes.
ProgressBar = Callable[[str], AbstractContextManager[Progress]]
log = logging.getLogger("placerec")

# For fewer items than this, starting processes takes longer than they save.
FEW = 5
# The most processes: Windows waits for no more, and elsewhere systems refuse more sooner or later.
MOST = 61 if sys.platform == "win32" else 1000


def silent(label: str) -> AbstractContextManager[Progress]:
    """A `ProgressBar` that shows nothing."""
    return nullcontext(lambda done, total: None)


class JobError(PlacerecError):
    """A worker, or a cluster, that is not there or ended before its work did."""


class Executor(Protocol):
    """Like the built-in `map` of one iterable: lazy, the results in the order of the items."""

    def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterator[R]: ...


class Numbered(Protocol[T_co]):
    """A sequence as far as a cluster needs one: its length, and an item by its number."""

    def __len__(self) -> int: ...

    def __getitem__(self, at: int, /) -> T_co: ...


class ScatteredMap(Protocol[T_co]):
    """Maps functions, one after the other, over items that were handed out before."""

    def __call__(self, function: Callable[[T_co], R], /) -> Iterator[R]: ...


@runtime_checkable
class RemoteExecutor(Executor, Protocol):
    """An executor of other machines (`cluster.cluster`), which can keep items for several functions."""

    def keep(self, items: Numbered[T], /) -> ScatteredMap[T]: ...


def remote_or_local_map(work: Executor | None) -> Executor:
    """`work` if it is of other machines, else the built-in map.

    For arithmetic on large arrays, which the processors of this machine share already.
    """
    return work if isinstance(work, RemoteExecutor) else map


def scatter(items: Numbered[T], work: Executor | None) -> ScatteredMap[T]:
    """Maps functions over the items, which other machines are sent once, if there are two; else the built-in map."""
    if isinstance(work, RemoteExecutor) and len(items) > 1:
        return work.keep(items)
    return lambda function: map(function, map(items.__getitem__, range(len(items))))


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers(jobs: int | None = None) -> Executor:
    """An executor of `jobs` processes (MOST at most); 1: this process; None: threads of this process, one a processor.

    Functions and items of processes must be importable and picklable; the function goes to each process once, and what
    it logs is logged here, in the order of the items. Only some items ahead of the results are asked for. An
    exception ends the work and is raised; JobError if a process is killed, for instance for want of memory. Processes
    begin by importing the program's main module: it needs `if __name__ == "__main__":`.
    """
    if jobs is None:
        return _threads
    return map if jobs <= 1 else partial(_processes, jobs)


def map_jobs(
    function: Callable[[T], R], items: Sequence[T], *, jobs: int = 1, progress: Progress | None = None
) -> list[R]:
    """`function` of every item, in order, by `workers(jobs)`; `progress` is called with items done and in all."""
    results = []
    for result in _processes(jobs, function, items, few=2) if jobs > 1 else map(function, items):
        results.append(result)
        if progress:
            progress(len(results), len(items))
    return results


def _threads(function: Callable[[T], R], items: Iterable[T], /) -> Iterator[R]:
    count = processors()
    with _shut_in_time(ThreadPoolExecutor(count)) as pool:
        yield from look_ahead(lambda item: pool.submit(function, item), Future.result, items, 2 * count)


def _processes(jobs: int, function: Callable[[T], R], items: Iterable[T], /, few: int = FEW) -> Iterator[R]:
    jobs, rest = min(jobs, MOST), iter(items)
    first = list(islice(rest, few))
    if len(first) < few:
        yield from (_threads if few > 2 else map)(function, first)
        return
    call = partial(_call, log.getEffectiveLevel())
    # Processes that begin empty, so that no thread or lock of this one is copied half-way.
    spawn = multiprocessing.get_context("spawn")
    made = ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_begin, initargs=(function,))
    with _shut_in_time(made) as pool:

        def submit(item: T) -> "Future[LoggedResult[R]]":
            # A process that this starts meets Ctrl-C only once `_begin` has told it how to end.
            with uninterrupted():
                return pool.submit(call, item)

        try:
            items = chain(first, rest)
            for answer in look_ahead(submit, Future.result, items, 4 * jobs):
                yield answer.replay()
        except BrokenProcessPool as error:
            raise JobError("a process of the work was killed; give it more memory, or fewer jobs") from error


@contextmanager
def _shut_in_time(pool: _Pool) -> Iterator[_Pool]:
    """Of the work that nobody waits for any longer nothing is begun; what has begun is waited for.

    Not where the garbage collector ends a generator in another thread: that may be one that the pool waits for.
    """
    maker = threading.get_ident()
    try:
        yield pool
    finally:
        pool.shutdown(wait=threading.get_ident() == maker, cancel_futures=True)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Threads and processes that begin within never see Ctrl-C, which a terminal sends to all, unless they ask for it.

    Where the system has no such mask nothing changes.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_function: Callable[..., Any]


def _begin(function: Callable[..., Any]) -> None:
    """What a worker does first: it is to end with its parent, however that ends, and without a word."""
    global _function
    _function = function
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.join,), daemon=True).start()


def _end_after(wait: Callable[[], None]) -> None:
    wait()
    os.kill(os.getpid(), signal.SIGTERM)


class _LogCollector(logging.Handler):
    """Keeps what this thread logs, ready to be sent to another process."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread == self._thread:
            record.msg, record.args = record.getMessage(), None
            self.records.append(record)


@dataclass(frozen=True)
class LoggedResult(Generic[R]):
    """A result from another process, and what was logged there."""

    result: R
    records: list[logging.LogRecord]

    def replay(self) -> R:
        """The result, once what was logged there is logged here."""
        for record in self.records:
            log.handle(record)
        return self.result


def logged_result(function: Callable[[T], R], item: T, level: int) -> LoggedResult[R]:
    """In another process: `function` of the item, and what it logs at `level` and above."""
    notes = _LogCollector()
    log.setLevel(level)
    log.propagate = False
    log.addHandler(notes)
    try:
        return LoggedResult(function(item), notes.records)
    finally:
        log.removeHandler(notes)


def _call(level: int, item: Any) -> LoggedResult[Any]:
    return logged_result(_function, item, level)
