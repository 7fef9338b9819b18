"""Cameras: devices (`camera:0`, `camera:/dev/video2`) and those on a network (`camera:rtsp://...`, `camera:http://...`).

A camera has no end and no past: its frames are known as they come, and are numbered from 0. A frame's time is in
seconds since 1970, by the clock of this machine at the first frame and by one that never jumps from then on.
"""

import logging
import os
import re
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from placerec.errors import SourceError
from placerec.frames.image import quiet
from placerec.frames.live import LatestFrameQueue, LiveFrame, Stopped, ended_by_interrupt
from placerec.frames.sequence import Frame, Gray, Image, Sequence, SourceOptions
from placerec.frames.video import grabbed_image

if TYPE_CHECKING:
    import cv2

# cv2 is imported where it is used: finding sources must not cost its import.

PREFIX = "camera:"
WAIT = 10  # seconds that a camera may take to answer, and to give the next image
RETRIES = 10  # images in a row that may be damaged
HELD = 64  # frames of a recording that wait for whoever describes them
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Camera:
    """Every `every`-th image of a camera, without an end; `source`: what the user named it by, without `camera:`."""

    source: str
    every: int = 1
    endless: ClassVar[bool] = True

    @property
    def path(self) -> Path:
        """What frames and messages name it by: no password of an address, and no slashes that a path would lose."""
        return Path(PREFIX + re.sub(r"//[^/@]*@", "//", self.source))

    @property
    def name(self) -> str:
        """The sequence's: `camera0`, `video2`, or the address of a camera on a network."""
        if self.source.isdecimal():
            return f"camera{int(self.source)}"
        if "://" not in self.source:
            return Path(self.source).name
        address = re.sub(r"^\w+://([^/@]*@)?|[?#].*", "", self.source)
        return re.sub(r"[^\w.-]+", "-", address).strip("-.") or "camera"

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
        """The frames from now on, until the camera gives no more or Ctrl-C is pressed; `first` must be 0.

        Raises SourceError if the camera cannot be opened, or never gives an image.
        """
        queue = LatestFrameQueue(partial(self.live_frames, colours=colours), room=HELD)
        told = False
        with closing(queue), ended_by_interrupt(queue):
            for number, live in enumerate(queue):
                if not number:
                    log.info("%s: recording until Ctrl-C", self)
                yield live.frame, live.image
                if queue.dropped and not told:
                    log.warning("%s: images come faster than they are worked on; some are dropped", self)
                    told = True
        log.info("%s: %d images came, %d of them dropped", self, queue.seen, queue.dropped)

    def picture(self, index: int) -> Gray | str:
        """None: what is gone by is gone."""
        return f"{self}: frame {index} is gone; a camera keeps nothing"

    def files(self) -> list[Path]:
        """None: nothing of a camera is there twice."""
        return []

    def live_frames(self, stopped: Stopped, *, colours: bool = False) -> Iterator[LiveFrame]:
        """Frames as they come, on the thread that asks for them; `colours`: each with a `ColourImage`.

        Raises SourceError for a camera that cannot be opened, or never gives an image.
        """
        positions, began = count(), None
        with quiet(), _opened(self) as capture:
            for damaged in _grabbed(capture, stopped):
                came = time.monotonic()
                began = time.time() - came if began is None else began
                for good in (*[False] * damaged, True):
                    position = next(positions)
                    if position % self.every:
                        continue
                    frame = Frame(f"{position:06d}", began + came, "", self.path)
                    name = f"{self}: frame {frame.name}"
                    image = grabbed_image(capture, name, colours=colours) if good else f"{name} cannot be decoded"
                    yield LiveFrame(position // self.every, frame, image, came)
        if began is None and not stopped():
            raise SourceError(f"{self}: gives no image; look whether another program uses it, and whether it is on")
        if not stopped():
            log.warning("%s: gives no more images", self)

    def __str__(self) -> str:
        return PREFIX + re.sub(r"//[^/@]*@", "//", self.source)


def is_camera(source: Path | str) -> bool:
    """Whether a source is a camera, which is no path."""
    return str(source).startswith(PREFIX)


def find_camera(sources: Iterable[Path | str], options: SourceOptions, endless: bool) -> Sequence | None:
    """The camera that is the only one of `sources`, None if there is no camera among them.

    Raises SourceError for a camera beside other sources, one that is named in no way that can be understood, and any
    if nothing `endless` will do.
    """
    sources = list(sources)
    cameras = [str(source) for source in sources if is_camera(source)]
    if not cameras:
        return None
    camera = Camera(cameras[0].removeprefix(PREFIX), options.every)
    if not endless:
        raise SourceError(f"{camera}: a camera is for tokenize and decode alone; make a video with it, and name that")
    if len(sources) > 1:
        raise SourceError(f"{camera}: a camera is read until it is stopped, with nothing beside it; run one at a time")
    if not (camera.source.isdecimal() or camera.source.startswith("/") or re.match(r"\w+://.", camera.source)):
        slash = "; give an address as text, not as a path" if re.match(r"\w+:/", camera.source) else ""
        raise SourceError(f"{camera}: is no camera; name camera:0, camera:/dev/video0 or camera:rtsp://...{slash}")
    if options.labels or options.topic:
        raise SourceError(f"{camera}: is a camera, which has neither labels nor topics; leave them out")
    if options.begin or options.end is not None:
        raise SourceError(f"{camera}: is a camera, whose frames are not known before; leave out --from and --to")
    return Sequence(camera.name, [], camera.path, camera)


def _grabbed(capture: "cv2.VideoCapture", stopped: Stopped) -> Iterator[int]:
    """After each image that was grabbed: how many damaged ones came before it.

    OpenCV tells a damaged image from the end of all by nothing: that is the end if nothing good comes any more.
    """
    failed, since = 0, time.monotonic()
    while not stopped() and failed < RETRIES and time.monotonic() - since < WAIT:
        if capture.grab():
            yield failed
            failed, since = 0, time.monotonic()
        else:
            failed += 1


@contextmanager
def _opened(camera: Camera) -> Iterator["cv2.VideoCapture"]:
    # Read once, when OpenCV first uses FFmpeg; what FFmpeg writes to stderr is no part of a note of ours.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    import cv2

    if "://" in camera.source:
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 1000 * WAIT, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1000 * WAIT]
        # More threads would decode faster and hold back a frame each.
        capture = cv2.VideoCapture(camera.source, cv2.CAP_FFMPEG, [*limits, cv2.CAP_PROP_N_THREADS, 1])
    else:
        _check_device(camera)
        device: Any = int(camera.source) if camera.source.isdecimal() else camera.source
        capture = cv2.VideoCapture(device, cv2.CAP_ANY if isinstance(device, int) else cv2.CAP_V4L2)
    if not capture.isOpened():
        what = "the address, and whether the camera is on" if "://" in camera.source else "whether a program uses it"
        raise SourceError(f"{camera}: cannot be opened as a camera; check {what}")
    try:
        yield capture
    finally:
        capture.release()


def _check_device(camera: Camera) -> None:
    """Say what is wrong with a device file, where there are such files; OpenCV does not."""
    if sys.platform != "linux":
        return
    path = Path(f"/dev/video{int(camera.source)}" if camera.source.isdecimal() else camera.source)
    if not path.exists():
        there = ", ".join(sorted(map(str, Path("/dev").glob("video*")))) or "none"
        raise SourceError(f"{camera}: there is no {path}; cameras on this machine: {there}")
    if not stat.S_ISCHR(path.stat().st_mode):
        raise SourceError(f"{camera}: is no device; for a file or a folder leave {PREFIX} out")
    if not os.access(path, os.R_OK | os.W_OK):
        raise SourceError(f"{camera}: {path} may not be opened; ask for the permission (on most systems: group video)")
