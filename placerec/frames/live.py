"""Frames as they come: a thread fetches them, and whoever is too slow for it misses the older ones."""

import math
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from placerec.errors import SourceError
from placerec.frames.sequence import Frame, Image

Stopped = Callable[[], bool]

# How long a stop may go unnoticed. A signal handler may take no lock, so nobody wakes those who wait.
_NAP = 0.1
# A camera is given so long to notice that it is stopped; one that hangs is left to its own time limit.
_PATIENCE = 3.0
# Whoever interrupts a group of processes may reach each of them twice at once.
_TWICE = 1.0


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """Frame `number` (from 0), its image or the reason why it has none, and when it came by time.monotonic()."""

    number: int
    frame: Frame
    image: Image | str
    came: float


class LatestFrameQueue:
    """Iterates over what `live_frames` gives, which runs in a thread of its own and is asked for the next at once.

    At most `room` frames wait; a newer one takes the place of the oldest, so that nobody lags further behind than
    that. `live_frames` is called with a function that tells whether to stop. The iteration ends with it, or by `stop`,
    which a signal handler may call; what it raises is raised here, after the frames before. `seen`: frames that came;
    `dropped`: those that nobody got.
    """

    def __init__(self, live_frames: Callable[[Stopped], Iterable[LiveFrame]], room: int = 1) -> None:
        self.seen = 0
        self.dropped = 0
        self._waiting: deque[LiveFrame] = deque(maxlen=room)
        self._news = threading.Condition()
        self._stopped = self._ended = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._fetch, args=(live_frames,), daemon=True, name="queue")
        self._thread.start()

    def stop(self) -> None:
        """Ask for no more frames; those that wait are still given."""
        self._stopped = True

    def close(self) -> None:
        """Stop, and let go of the source."""
        self.stop()
        self._thread.join(_PATIENCE)

    def __iter__(self) -> Iterator[LiveFrame]:
        while True:
            with self._news:
                while not (self._waiting or self._ended or self._stopped):
                    self._news.wait(_NAP)
                live = self._waiting.popleft() if self._waiting else None
            if live is None:
                break
            yield live
        if self._error is not None:
            raise self._error

    def _fetch(self, live_frames: Callable[[Stopped], Iterable[LiveFrame]]) -> None:
        try:
            for live in live_frames(lambda: self._stopped):
                with self._news:
                    self.seen += 1
                    self.dropped += len(self._waiting) == self._waiting.maxlen
                    self._waiting.append(live)
                    self._news.notify()
        except BaseException as error:
            self._error = error
        finally:
            with self._news:
                self._ended = True
                self._news.notify()


def real_time(frames: Iterable[tuple[Frame, Image | str]], stopped: Stopped) -> Iterator[LiveFrame]:
    """A recording as if it happened now: every frame comes so long after the first as its time stamp says.

    The next frame is read before it is due. Raises SourceError for a frame without a time.
    """
    begin: float | None = None
    for number, (frame, image) in enumerate(frames):
        if math.isnan(frame.time):
            raise SourceError(f"{frame.path}: frame {frame.name} has no time, and without one it cannot be played live")
        if begin is None:
            begin = time.monotonic() - frame.time
        while (left := begin + frame.time - time.monotonic()) > 0 and not stopped():
            time.sleep(min(left, _NAP))
        if stopped():
            return
        yield LiveFrame(number, frame, image, time.monotonic())


@contextmanager
def ended_by_interrupt(queue: LatestFrameQueue) -> Iterator[None]:
    """Within, Ctrl-C stops `queue`; another one, a second later or more, is what it always is.

    Only the main thread hears of signals; in another nothing changes. Nor does it where interrupts are ignored.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before in (signal.SIG_IGN, None):
        yield
        return
    since: float | None = None

    def stop(number: int, frame: object) -> None:
        nonlocal since
        if since is None:
            since = time.monotonic()
            queue.stop()
        elif time.monotonic() - since >= _TWICE:
            signal.signal(signal.SIGINT, before)
            signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
