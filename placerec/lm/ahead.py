"""Work on a stream in threads, its results in order; for functions that let other threads run, as numpy does."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from threading import Semaphore, Thread
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future

_AHEAD = 4
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def work_ahead(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """The results of a function for items that are read as needed, worked on by two threads."""
    # Takes a while to import.
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(2) as pool:
        waiting: deque[Future[_Result]] = deque()
        for item in items:
            waiting.append(pool.submit(function, item))
            if len(waiting) == _AHEAD:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def make_ahead(items: Iterable[_Item]) -> Iterator[_Item]:
    """The items, of which another thread makes the next few while one is used."""
    made: deque[_Item] = deque()
    errors: list[BaseException] = []
    ready, room = Semaphore(0), Semaphore(_AHEAD)
    wanted = True

    def make() -> None:
        try:
            for item in items:
                room.acquire()
                if not wanted:
                    return
                made.append(item)
                ready.release()
        except BaseException as error:
            errors.append(error)
        ready.release()

    Thread(target=make, daemon=True).start()
    try:
        while ready.acquire() and made:
            yield made.popleft()
            room.release()
    finally:
        wanted = False
        room.release()
    if errors:
        raise errors[0]
