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
from placerec.frames.feed import Arrival, Feed, Stopped, ended_by_interrupt, paced
from placerec.frames.sequence import Gray

IMAGE = np.zeros((8, 8), np.uint8)


def frame(number: int, seconds: float = 0.0) -> Frame:
    return Frame(str(number), seconds, "", Path("there"))


def arrivals(numbers: Iterable[int]) -> Iterator[Arrival]:
    return (Arrival(number, frame(number), IMAGE, time.monotonic()) for number in numbers)


def never_ending(stopped: Stopped) -> Iterator[Arrival]:
    number = 0
    while not stopped():
        yield from arrivals([number])
        number += 1
        time.sleep(0.002)


@pytest.mark.parametrize("room", [1, 3])
def test_whoever_is_slow_gets_the_newest(room: int) -> None:
    feed = Feed(lambda stopped: arrivals(range(100)), room)
    feed._thread.join()
    with closing(feed):
        assert [arrival.number for arrival in feed] == [*range(100 - room, 100)]
        assert (feed.seen, feed.dropped) == (100, 100 - room)


def test_who_keeps_up_gets_everything() -> None:
    taken = threading.Semaphore(0)

    def patient(stopped: Stopped) -> Iterator[Arrival]:
        for arrival in arrivals(range(50)):
            yield arrival
            taken.acquire()

    numbers = []
    with closing(Feed(patient)) as feed:
        for arrival in feed:
            numbers.append(arrival.number)
            taken.release()
        assert (numbers, feed.seen, feed.dropped) == ([*range(50)], 50, 0)


def test_an_error_comes_after_the_frames_before_it() -> None:
    def broken(stopped: Stopped) -> Iterator[Arrival]:
        yield from arrivals([0])
        raise SourceError("the cable is out")

    feed = Feed(broken)
    feed._thread.join()
    iterator = iter(feed)
    assert next(iterator).number == 0
    with pytest.raises(SourceError, match="the cable is out"):
        next(iterator)


def test_stop_ends_the_source_and_the_iteration() -> None:
    feed = Feed(never_ending)
    for arrival in feed:
        if arrival.number >= 3:
            feed.stop()
    feed.close()
    assert not feed._thread.is_alive()
    assert feed.seen >= 4


def test_a_source_that_hangs_does_not_keep_anybody() -> None:
    release = threading.Event()

    def hanging(stopped: Stopped) -> Iterator[Arrival]:
        yield from arrivals([0])
        release.wait(60)

    feed = Feed(hanging)
    for _ in feed:
        feed.stop()
    release.set()
    feed.close()


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Interrupts as Python has them, however this process was started."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_an_interrupt_ends_the_feed() -> None:
    with closing(Feed(never_ending)) as feed, ended_by_interrupt(feed):
        for _ in feed:
            if feed.seen >= 3:
                # Twice at once is one.
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interrupts")
def test_a_later_interrupt_is_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("placerec.frames.feed._TWICE", 0)
    with closing(Feed(never_ending)) as feed:
        with ended_by_interrupt(feed):
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interrupts")
def test_ignored_interrupts_stay_ignored_and_other_threads_are_not_told() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with closing(Feed(never_ending)) as feed, ended_by_interrupt(feed):
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    signal.signal(signal.SIGINT, signal.default_int_handler)
    seen = []

    def elsewhere() -> None:
        with closing(Feed(never_ending)) as feed, ended_by_interrupt(feed):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_a_recording_is_played_at_its_own_pace() -> None:
    times = [1e9, 1e9 + 0.1, 1e9 + 0.15, 1e9 + 0.15, 1e9 + 0.3]
    shots: list[tuple[Frame, Gray | str]] = [(frame(i, seconds), IMAGE) for i, seconds in enumerate(times)]
    came = [arrival.came for arrival in paced(shots, lambda: False)]
    # Never early, whatever the machine is busy with.
    assert all(a - came[0] >= seconds - times[0] - 1e-6 for a, seconds in zip(came, times, strict=True))
    assert [arrival.number for arrival in paced(shots[:1], lambda: False)] == [0]
    assert list(paced(shots, lambda: True)) == []


def test_frames_without_times_cannot_be_played() -> None:
    with pytest.raises(SourceError, match="there: frame 0 has no time, and without one it cannot be played live"):
        list(paced([(frame(0, math.nan), IMAGE)], lambda: False))
