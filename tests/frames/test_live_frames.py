"""Frames from a thread of their own: the newest first, everything counted, and an end in every case."""

import math
import os
import signal
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from placerec.errors import SourceError
from placerec.frames import Frame
from placerec.frames.live import LatestFrameQueue, LiveFrame, Stopped, ended_by_interrupt, real_time
from placerec.frames.sequence import Gray

IMAGE = np.zeros((8, 8), np.uint8)


def frame(number: int, seconds: float = 0.0) -> Frame:
    return Frame(str(number), seconds, "", Path("there"))


def live_frames(numbers: Iterable[int]) -> Iterator[LiveFrame]:
    return (LiveFrame(number, frame(number), IMAGE, time.monotonic()) for number in numbers)


def never_ending(stopped: Stopped) -> Iterator[LiveFrame]:
    number = 0
    while not stopped():
        yield from live_frames([number])
        number += 1
        time.sleep(0.002)


@pytest.mark.parametrize("room", [1, 3])
def test_whoever_is_slow_gets_the_newest(room: int) -> None:
    queue = LatestFrameQueue(lambda stopped: live_frames(range(100)), room)
    queue._thread.join()
    with closing(queue):
        assert [live.number for live in queue] == [*range(100 - room, 100)]
        assert (queue.seen, queue.dropped) == (100, 100 - room)


def test_who_keeps_up_gets_everything() -> None:
    taken = threading.Semaphore(0)

    def patient(stopped: Stopped) -> Iterator[LiveFrame]:
        for live in live_frames(range(50)):
            yield live
            taken.acquire()

    numbers = []
    with closing(LatestFrameQueue(patient)) as queue:
        for live in queue:
            numbers.append(live.number)
            taken.release()
        assert (numbers, queue.seen, queue.dropped) == ([*range(50)], 50, 0)


def test_an_error_comes_after_the_frames_before_it() -> None:
    def broken(stopped: Stopped) -> Iterator[LiveFrame]:
        yield from live_frames([0])
        raise SourceError("the cable is out")

    queue = LatestFrameQueue(broken)
    queue._thread.join()
    iterator = iter(queue)
    assert next(iterator).number == 0
    with pytest.raises(SourceError, match="the cable is out"):
        next(iterator)


def test_stop_ends_the_source_and_the_iteration() -> None:
    queue = LatestFrameQueue(never_ending)
    for live in queue:
        if live.number >= 3:
            queue.stop()
    queue.close()
    assert not queue._thread.is_alive()
    assert queue.seen >= 4


def test_a_source_that_hangs_does_not_keep_anybody() -> None:
    release = threading.Event()

    def hanging(stopped: Stopped) -> Iterator[LiveFrame]:
        yield from live_frames([0])
        release.wait(60)

    queue = LatestFrameQueue(hanging)
    for _ in queue:
        queue.stop()
    release.set()
    queue.close()


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Interrupts as Python has them, however this process was started."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_an_interrupt_ends_the_feed() -> None:
    with closing(LatestFrameQueue(never_ending)) as queue, ended_by_interrupt(queue):
        for _ in queue:
            if queue.seen >= 3:
                # Twice at once is one.
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interrupts")
def test_a_later_interrupt_is_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("placerec.frames.live._TWICE", 0)
    with closing(LatestFrameQueue(never_ending)) as queue:
        with ended_by_interrupt(queue):
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interrupts")
def test_ignored_interrupts_stay_ignored_and_other_threads_are_not_told() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with closing(LatestFrameQueue(never_ending)) as queue, ended_by_interrupt(queue):
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    signal.signal(signal.SIGINT, signal.default_int_handler)
    seen = []

    def elsewhere() -> None:
        with closing(LatestFrameQueue(never_ending)) as queue, ended_by_interrupt(queue):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_a_recording_is_played_at_its_own_pace() -> None:
    times = [1e9, 1e9 + 0.1, 1e9 + 0.15, 1e9 + 0.15, 1e9 + 0.3]
    images: list[tuple[Frame, Gray | str]] = [(frame(i, seconds), IMAGE) for i, seconds in enumerate(times)]
    came = [live.came for live in real_time(images, lambda: False)]
    # Never early, whatever the machine is busy with.
    assert all(a - came[0] >= seconds - times[0] - 1e-6 for a, seconds in zip(came, times, strict=True))
    assert [live.number for live in real_time(images[:1], lambda: False)] == [0]
    assert list(real_time(images, lambda: True)) == []


def test_frames_without_times_cannot_be_played() -> None:
    with pytest.raises(SourceError, match="there: frame 0 has no time, and without one it cannot be played live"):
        list(real_time([(frame(0, math.nan), IMAGE)], lambda: False))
