"""Work in several processes: order, notes, failures, and no process that outlives its parent."""

import itertools
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Iterator
from functools import partial
from pathlib import Path

import pytest
from helpers.waiting import wait_until

from placerec.errors import MissingExtraError, PlacerecError, StreamError
from placerec.jobs import FEW, map_jobs, processors, workers

log = logging.getLogger("placerec.test")


def note(number: int) -> int:
    time.sleep(0.1 / (1 + number))
    log.warning("%d of many", number)
    log.debug("not asked for")
    return number**2


def fail(number: int) -> int:
    if number == 2:
        raise StreamError("two cannot be used; take three")
    return number


def die(number: int) -> int:
    os.kill(os.getpid(), 9)
    return number


def wait(path: str) -> None:
    Path(path).write_text(str(os.getpid()))
    time.sleep(60)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_and_notes_are_in_order(jobs: int, caplog: pytest.LogCaptureFixture) -> None:
    told = []
    with caplog.at_level(logging.WARNING, "placerec"):
        results = map_jobs(note, [1, 2, 3, 4], jobs=jobs, progress=lambda done, total: told.append((done, total)))
    assert results == [1, 4, 9, 16]
    assert [record.getMessage() for record in caplog.records] == [f"{n} of many" for n in (1, 2, 3, 4)]
    assert told == [(n, 4) for n in (1, 2, 3, 4)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_exception_comes_through(jobs: int) -> None:
    with pytest.raises(StreamError, match="two cannot be used; take three"):
        map_jobs(fail, [1, 2, 3], jobs=jobs)


def lack(number: int) -> int:
    raise MissingExtraError("rosbags", "a bag", "pip install rosbags")


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_not_installed_is_told_by_other_processes_too(jobs: int) -> None:
    with pytest.raises(MissingExtraError, match=r"^a bag needs the package rosbags, which is not installed: pip inst"):
        map_jobs(lack, [1, 2, 3], jobs=jobs)


def test_no_number_of_jobs_is_too_great() -> None:
    assert map_jobs(fail, [0, 1], jobs=10**12) == [0, 1]


def test_a_killed_process_is_told() -> None:
    with pytest.raises(PlacerecError, match="was killed; give it more memory, or fewer jobs"):
        map_jobs(die, [1, 2], jobs=2)


def test_nothing_to_do_and_processors() -> None:
    assert map_jobs(fail, [], jobs=2) == []
    assert processors() >= 1


@pytest.mark.skipif(sys.platform == "win32", reason="other signals there")
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    paths = [str(tmp_path / "a"), str(tmp_path / "b")]
    program = tmp_path / "program.py"
    program.write_text(
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from placerec.jobs import map_jobs\nfrom test_jobs import wait\n"
        f"if __name__ == '__main__':\n    map_jobs(wait, {paths!r}, jobs=2)\n"
    )
    with subprocess.Popen([sys.executable, str(program)]) as parent:
        workers = [wait_until(partial(_number_in, Path(path)), "the worker never began") for path in paths]
        parent.kill()
    wait_until(lambda: not any(map(_runs, workers)), "a worker outlived its parent")


def _number_in(path: Path) -> int | None:
    return int(path.read_text() or 0) if path.exists() else None


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    # Nobody waits for it any more: it may stay as an entry without a process.
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"


def double(number: int) -> int:
    return 2 * number


def fail_late(number: int) -> int:
    if number == 30:
        raise StreamError("thirty")
    return number


@pytest.mark.parametrize("jobs", [None, 1, 2])
def test_only_some_items_are_asked_for_ahead_of_the_results(jobs: int | None) -> None:
    asked = 0

    def endless() -> Iterator[int]:
        nonlocal asked
        while True:
            asked += 1
            yield asked

    window = 8 + FEW if jobs else 2 * processors()
    results = workers(jobs)(double, endless())
    for number in range(1, 200):
        assert next(results) == 2 * number
        assert asked <= number + window + 1
    if isinstance(results, Generator):
        results.close()


@pytest.mark.parametrize("jobs", [None, 1, 2])
def test_an_exception_ends_the_work_where_it_comes(jobs: int | None) -> None:
    results = workers(jobs)(fail_late, itertools.count())
    assert list(itertools.islice(results, 30)) == list(range(30))
    with pytest.raises(StreamError, match="thirty"):
        next(results)


@pytest.mark.parametrize("jobs", [None, 1, 2])
def test_an_exception_of_the_items_comes_through(jobs: int | None) -> None:
    def items() -> Iterator[int]:
        yield from range(10)
        raise StreamError("no more of them")

    with pytest.raises(StreamError, match="no more of them"):
        list(workers(jobs)(double, items()))


@pytest.mark.parametrize("jobs", [None, 1, 2])
@pytest.mark.parametrize("count", [0, 1, FEW - 1, 40])
def test_any_number_of_items(jobs: int | None, count: int) -> None:
    assert list(workers(jobs)(double, range(count))) == [2 * number for number in range(count)]


class Ending:
    """An item whose way to another process ends the work: as the garbage collector does, in a thread of the pool."""

    def __init__(self) -> None:
        self.begun, self.ended = threading.Event(), threading.Event()
        self.results: Generator[int, None, None] | None = None

    def __reduce__(self) -> tuple[type[int], tuple[int]]:
        assert self.begun.wait(60)
        assert self.results is not None
        self.results.close()
        self.ended.set()
        return int, (7,)


def echo(item: object) -> int:
    return 1


def test_work_that_a_thread_of_the_pool_gives_up_ends() -> None:
    """A thread that waits for itself would keep the program for good."""
    item = Ending()
    made = workers(2)(echo, [0] * FEW + [item])
    assert isinstance(made, Generator)
    item.results = made
    assert next(made) == 1
    item.begun.set()
    assert item.ended.wait(60), "the thread waits for itself"
