"""Work that goes on ahead of its results, which come in order: as much of it as memory should hold, and no more."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from threading import Semaphore, Thread
from typing import TypeVar

_AHEAD = 4
_Item = TypeVar("_Item")
_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


def look_ahead(
    start: Callable[[_Item], _Task],
    finish: Callable[[_Task], _Result],
    items: Iterable[_Item],
    ahead: int,
    *,
    at_end: Callable[[Iterable[_Task]], object] = lambda tasks: None,
) -> Iterator[_Result]:
    """What `finish` makes of the task that `start` began for each item, with at most `ahead` tasks begun before it.

    `at_end` is called with the tasks that nobody waits for any longer: some only if an error ended the work, or whoever
    takes the results stopped.
    """
    tasks: deque[_Task] = deque()
    try:
        for item in items:
            tasks.append(start(item))
            if len(tasks) > ahead:
                yield finish(tasks.popleft())
        while tasks:
            yield finish(tasks.popleft())
    finally:
        at_end(tasks)


def work_ahead(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """The results of a function that lets other threads run, as numpy does, of items that are read as needed."""
    # Takes a while to import.
    from concurrent.futures import Future, ThreadPoolExecutor

    with ThreadPoolExecutor(2) as pool:
        yield from look_ahead(lambda item: pool.submit(function, item), Future.result, items, _AHEAD - 1)


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
