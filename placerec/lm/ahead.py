"""Work on a stream in other threads, its results in order."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from threading import Thread
from typing import Generic, TypeVar

import numpy as np

# One result is used while two are made.
_AHEAD = 3
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class _Work(Thread, Generic[_Item, _Result]):
    """Works on one item. A thread of its own: what concurrent.futures offers takes longer to import than to save."""

    def __init__(self, function: Callable[[_Item], _Result], item: _Item) -> None:
        super().__init__(daemon=True)
        self.function, self.item = function, item
        self.results: list[_Result] = []
        self.error: BaseException | None = None
        # What is done about log 0 and the like is set for each thread.
        self.handling = np.geterr()

    def run(self) -> None:
        """In the thread."""
        try:
            with np.errstate(**self.handling):
                self.results.append(self.function(self.item))
        except BaseException as error:
            self.error = error

    def result(self) -> _Result:
        """What came of it, once it is there."""
        self.join()
        if self.error is not None:
            raise self.error
        return self.results[0]


def work_ahead(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """The results of a function that lets other threads run (as numpy does), for items that are read as needed."""
    waiting: deque[_Work[_Item, _Result]] = deque()
    for item in items:
        waiting.append(_Work(function, item))
        waiting[-1].start()
        if len(waiting) == _AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()
