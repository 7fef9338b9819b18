"""Work on other machines: an executor as `jobs` has them, on a Dask cluster (https://distributed.dask.org).

An item is sent with the task that needs it, so that the scheduler hands out again what a lost worker had; what is
kept for several functions lies with the workers, and is sent again if its worker is lost.
"""

import logging
import platform
import re
import signal
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import metadata
from itertools import chain, count
from multiprocessing import resource_tracker
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any, Generic, TypeVar
from uuid import uuid4

from placerec.ahead import look_ahead
from placerec.errors import check_optional
from placerec.jobs import JobError, LoggedResult, Numbered, RemoteExecutor, ScatteredMap, logged_result, uninterrupted
from placerec.version import __version__

T = TypeVar("T")
R = TypeVar("R")
Task = Callable[[bool], Any]  # gives the future of a task; True: what it needs from before may be lost
log = logging.getLogger("placerec")

CONNECT = 10.0  # seconds until a scheduler has answered
JOIN = 30.0  # seconds for a first worker to come, or for another one after the last was lost
LOSSES = 5  # how often the same task may be lost
KEPT = 16  # the most items that lie with a worker as one
_LOCAL = re.compile(r"local:([1-9][0-9]*)")
_REMOTE = re.compile(r"(tcp|tls)://\S+:[0-9]+")
_SAME = "install the same everywhere"
_TALKERS = ("asyncio", "bokeh", "distributed", "tornado")


def check_address(address: str) -> None:
    """JobError for what is no address of a cluster."""
    if not _LOCAL.fullmatch(address) and not _REMOTE.fullmatch(address):
        raise JobError(
            f"{address!r} is no cluster; give tcp://HOST:PORT of a scheduler, or local:N for N processes here"
        )


@contextmanager
def cluster(address: str) -> Iterator[RemoteExecutor]:
    """An executor whose workers are those of the scheduler at `address`, or N processes of this machine (`local:N`).

    Functions and items must be importable and picklable; the function is sent once; what it logs is logged here, in the
    order of the items. Some items more than there are threads are asked for ahead of the results. Workers may come and
    go. Raises JobError if there is no scheduler, no worker, or one of another version of placerec, and in the map if
    no worker is left, or items kill theirs; MissingExtraError without Dask.
    """
    check_address(address)
    with ExitStack() as stack:
        distributed = stack.enter_context(_quiet())
        if local := _LOCAL.fullmatch(address):
            scheduler = stack.enter_context(_local(distributed, int(local[1])))
        else:
            scheduler = address
        client = stack.enter_context(_client(distributed, scheduler))
        _check_workers(client, address)
        yield _Dask(client, address)


@contextmanager
def _quiet() -> Iterator[Any]:
    """The module `distributed`, whose loggers and warnings are kept from the user meanwhile: its errors are ours."""
    check_optional("distributed", "--cluster")
    import distributed

    names = {*_TALKERS, *logging.root.manager.loggerDict}
    loggers = [logging.getLogger(name) for name in names if name.partition(".")[0] in _TALKERS]
    levels = [(logger, logger.level) for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module=r"distributed|dask|tornado")
            # Of a function with a large codebook, which is sent once.
            warnings.filterwarnings("ignore", "Sending large graph")
            yield distributed
    finally:
        for logger, level in levels:
            logger.setLevel(level)


@contextmanager
def _local(distributed: Any, workers: int) -> Iterator[str]:
    """The address of a scheduler in this process, with workers in others; nothing of them is left."""
    import dask

    with TemporaryDirectory(prefix="placerec-") as folder, dask.config.set({"temporary-directory": folder}):
        options = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
        try:
            if hasattr(signal, "pthread_sigmask"):
                # It is there before the first process, and where it begins it lets Ctrl-C in again.
                resource_tracker.ensure_running()
            with uninterrupted():
                made = distributed.LocalCluster(n_workers=workers, silence_logs=logging.CRITICAL, **options)
        except (OSError, RuntimeError) as error:
            raise JobError(f"local:{workers}: the processes cannot be started ({error}); try fewer") from error
        with made:
            yield made.scheduler_address


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    if address.startswith("tls:") and not distributed.Security().get_connection_args("client")["ssl_context"]:
        raise JobError(f"{address}: needs certificates; name them in Dask's configuration, under distributed.comm.tls")
    try:
        client = distributed.Client(address, timeout=CONNECT, set_as_default=False, direct_to_workers=False)
    except (OSError, ValueError) as error:
        remedy = "start one with `dask scheduler`, or use local:N"
        raise JobError(f"{address}: no scheduler answers there; {remedy}") from error
    with client:
        yield client


def _check_workers(client: Any, address: str) -> None:
    """JobError if no worker comes, or if one of them would not do what this process does."""
    try:
        client.wait_for_workers(1, timeout=JOIN)
    except TimeoutError as error:
        raise JobError(f"{address}: the scheduler has no workers; start some with `dask worker {address}`") from error
    here, others = _versions(), {}
    for worker, there in client.run(_versions, on_error="return").items():
        if isinstance(there, OSError):
            continue  # lost meanwhile
        if isinstance(there, Exception):
            raise JobError(f"{worker}: cannot import placerec; install placerec {__version__} there") from there
        if there["placerec"] != __version__:
            raise JobError(f"{worker}: has placerec {there['placerec']}, and {__version__} is wanted; {_SAME}")
        others.update({(name, there[name]): worker for name in here if there[name] != here[name]})
    for (name, version), worker in others.items():
        log.warning("%s: has %s %s, and here is %s; the bytes may differ", worker, name, version, here[name])


def _versions() -> dict[str, str]:
    """The versions and the kind of processor that decide on the bytes of results."""
    packages = {name: metadata.version(name) for name in ("numpy", "scipy")}
    return {"placerec": __version__, **packages, "processor": platform.machine()}


@dataclass(frozen=True)
class _Item(Generic[T]):
    """Keeps Dask from looking for tasks inside an item."""

    item: T


@dataclass(frozen=True)
class _Function:
    """The function of a map, and the version of placerec that it is of."""

    function: _Item[Callable[..., Any]]
    version: str

    def here(self) -> Callable[..., Any]:
        """The function, for a worker of any age; JobError on one of another version of placerec."""
        if self.version != __version__:
            raise JobError(f"a worker has placerec {__version__}, and {self.version} is wanted; {_SAME}")
        return self.function.item


def _call(function: _Function, items: _Item[list[Any]], level: int) -> list[LoggedResult[Any]]:
    return [logged_result(function.here(), item, level) for item in items.item]


class _Dask:
    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address

    def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterator[R]:
        submit = self._submitter(function)
        tasks = ((lambda lost, item=item: submit(_Item([item]))) for item in items)
        yield from self._results(tasks)

    def keep(self, items: Numbered[T], /) -> ScatteredMap[T]:
        """Maps functions over `items`, which are sent to the workers once, and again where a worker is lost."""
        size = max(1, min(KEPT, len(items) // (4 * max(1, self._threads()))))
        groups = [range(first, min(first + size, len(items))) for first in range(0, len(items), size)]
        places: list[Any] = [None] * len(groups)

        def place(group: int, lost: bool) -> Any:
            if lost or places[group] is None:
                together = _Item([items[i] for i in groups[group]])
                with self._reached():
                    places[group] = self._client.scatter([together], hash=False)[0]
            return places[group]

        def each(function: Callable[[T], R], /) -> Iterator[R]:
            submit = self._submitter(function)
            tasks = ((lambda lost, group=group: submit(place(group, lost))) for group in range(len(groups)))
            yield from self._results(tasks)

        return each

    def _submitter(self, function: Callable[..., Any]) -> Callable[[Any], Any]:
        """A function that submits a task, `function` of some items; `function` is sent to the scheduler once."""
        # Under the function's name the scheduler remembers how long its tasks take.
        name = f"{getattr(getattr(function, 'func', function), '__name__', 'work').strip('_')}-{uuid4().hex}"
        known = self._client.submit(_Function, _Item(function), __version__, key=f"{name}-function")
        numbers, level = count(), log.getEffectiveLevel()
        return lambda item: self._client.submit(_call, known, item, level, key=(name, next(numbers)))

    def _results(self, tasks: Iterable[Task]) -> Iterator[Any]:
        """The results of the tasks' items in order; only some tasks are submitted before the first is done."""
        ahead = 2 * self._threads() + 4
        found = look_ahead(lambda task: (task, task(False)), self._result, tasks, ahead, at_end=self._cancel)
        for answer in chain.from_iterable(found):
            yield answer.replay()

    def _cancel(self, submitted: Iterable[tuple[Task, Any]]) -> None:
        """Take back tasks that nobody waits for; nothing is said if the scheduler is gone."""
        waiting = [future for _, future in submitted]
        if waiting and self._client.status == "running":
            with suppress(OSError):
                self._client.cancel(waiting, force=True)

    def _result(self, submitted: tuple[Task, Any]) -> Any:
        """The result of a task, which is submitted again if what it needs was lost with a worker."""
        task, future = submitted
        from distributed import KilledWorker
        from distributed.comm.core import CommClosedError

        for _ in range(LOSSES):
            try:
                return self._wait(future)
            except KilledWorker as error:
                raise JobError(
                    f"{self._address}: several workers were killed at the same item; give them more memory"
                ) from error
            except (CancelledError, CommClosedError) as error:
                if self._client.status != "running":
                    raise self._gone() from error
            future = task(True)
        raise JobError(f"{self._address}: workers are lost again and again; see what ends them")

    def _wait(self, future: Any) -> Any:
        since = monotonic()
        while True:
            try:
                return future.result(timeout=JOIN / 6)
            except TimeoutError as error:
                if future.status == "error":
                    raise  # the function's own
                if future.done() or self._threads():
                    since = monotonic()
                elif monotonic() - since > JOIN:
                    remedy = f"start more with `dask worker {self._address}`"
                    raise JobError(f"{self._address}: no worker is left; {remedy}") from error

    def _threads(self) -> int:
        with self._reached():
            return sum(self._client.nthreads().values())

    @contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._gone() from error

    def _gone(self) -> JobError:
        return JobError(f"{self._address}: the scheduler is gone; start it again")
