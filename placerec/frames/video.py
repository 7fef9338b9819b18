"""A video file, through OpenCV's FFmpeg: its frames are listed from the packets, and decoded in one pass.

The packets have the exact times of all frames, and to walk them costs no decoding. Frames are found again by their
times, for a decoder leaves out what is damaged.
"""

import logging
import os
import re
from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

from placerec.errors import SourceError
from placerec.frames.image import as_gray, as_image, quiet
from placerec.frames.sequence import Frame, Gray, Image, shown_pixels

SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv", ".flv", ".ogv", ".3gp", ".mts")
# Streams without a container, and without times.
RAW_RATE = 25.0
RAW_SUFFIXES = (".h264", ".264", ".h265", ".265", ".hevc")
# Other files are called so, too; and where a pattern must be found in what they begin with.
_BY_CONTENT = {
    **dict.fromkeys((".ts", ".m2ts"), re.compile(rb"(.{4})?G.{187}(?(1).{4})G", re.DOTALL)),
    **dict.fromkeys(RAW_SUFFIXES, re.compile(rb"\0?\0\0\x01")),
    ".gif": re.compile(rb"GIF8[79]a"),
}
# Seconds within which two times are one.
SAME = 0.0002
# As many packets in a row that cannot be read are the end.
_DAMAGED = 1000
# A seek may lead behind what is looked for, and is tried again so many seconds earlier; or so many frames before it.
_SEEKS, _SOUGHT = (0.0, 1.0, 10.0), 1000
log = logging.getLogger(__name__)


class UndecodableError(SourceError):
    """A video of which OpenCV decodes no frame: its codec, and the times of all frames."""

    def __init__(self, path: Path, codec: str, times: "array[float]") -> None:
        super().__init__(f"{path}: OpenCV can decode no frame of it (codec {codec}); convert it to H.264")
        self.codec, self.times = codec, times


@dataclass(frozen=True)
class Video:
    """Every `every`-th frame of a video file from number `start` on; `listed`: those that are read.

    `times`: of all frames of the file.
    """

    path: Path
    every: int
    start: int = field(repr=False)
    times: "array[float]" = field(repr=False, compare=False)
    listed: tuple[Frame, ...] = field(repr=False, compare=False)
    endless: ClassVar[bool] = False

    def files(self) -> list[Path]:
        return [self.path]

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
        if first >= len(self.listed):
            return
        with _opened(self.path) as capture:
            for position, decoded in _decoded(capture, self.times, late=self.path.suffix.lower() == ".avi"):
                index, between = divmod(position - self.start, self.every)
                if between or index < first:
                    continue
                name = f"{self.path}: frame {self.listed[index].name}"
                if decoded:
                    yield self.listed[index], grabbed_image(capture, name, colours=colours)
                else:
                    yield self.listed[index], f"{name} cannot be decoded"
                if index == len(self.listed) - 1:
                    return

    def picture(self, index: int) -> Gray | str:
        """The frame at `index` for people to look at, (h, w, 3) or (h, w), or why there is none.

        Only where a seek does not lead to it, all frames before it are decoded.
        """
        seconds = self.times[self.start + index * self.every]
        with _opened(self.path) as capture:
            if _sought(capture, seconds, self.times[0], late=self.path.suffix.lower() == ".avi"):
                with quiet():
                    decoded, picture = capture.retrieve()
                if decoded:
                    return as_gray(picture, f"{self.path}: frame {self.listed[index].name}")
        return next(shown_pixels(image) for _, image in self.frames(index, colours=True))


def is_video(path: Path) -> bool:
    """Whether a file is named as a video is, or, where that may be something else, is one by content."""
    suffix = path.suffix.lower()
    pattern = _BY_CONTENT.get(suffix)
    if pattern is None:
        return suffix in SUFFIXES
    try:
        # A pipe would keep the work waiting for good.
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return pattern.match(file.read(400)) is not None
    except OSError:
        return False


def list_times(path: Path) -> "array[float]":
    """The times of all frames of a video in seconds from its start, in order; nothing but the first is decoded.

    Raises SourceError for what is no video, holds no frame, or none that OpenCV can decode; a video that is shorter
    than its header says is told of in a warning.
    """
    _check_readable(path)
    with _opened(path, packets=True) as capture:
        # What comes before the start is there for the decoder's sake: it is cut off by the container.
        walked = array("d", _walked(path, capture))
        times = array("d", sorted(time for time in walked if time > -SAME))
    if path.suffix.lower() in RAW_SUFFIXES and not times:
        # Such a stream has no times, and older OpenCV (4.10) makes up some that are far below 0.
        times = array("d", (number / RAW_RATE for number in range(len(walked))))
    if any(after - before < SAME for before, after in pairwise(times)):
        # MPEG program streams: not every packet has its time.
        with _opened(path) as capture:
            times = _increasing(_walked(path, capture), 1 / (_property(capture, "FPS") or 25))
    with _opened(path) as capture:
        if not times or not any(_grab(capture) for _ in times):
            code = int(_property(capture, "FOURCC")) & 0xFFFFFFFF
            text = code.to_bytes(4, "little").decode("latin-1").strip()
            codec = text if text.isprintable() and text else "unknown"
            raise UndecodableError(path, codec, times)
        _tell_truncated(path, capture, times)
    return times


@contextmanager
def _opened(path: Path, *, packets: bool = False) -> Iterator[Any]:
    import cv2

    # FFmpeg writes to stderr unless it is told not to before its first use: what matters is found out and said here.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # One thread: what several make of damaged H.264 is another picture from run to run.
    how = [cv2.CAP_PROP_FORMAT, -1] if packets else [cv2.CAP_PROP_N_THREADS, 1]
    with quiet():
        # Absolute: FFmpeg takes a name with a colon for an address.
        capture = cv2.VideoCapture(os.path.abspath(path), cv2.CAP_FFMPEG, how)
    try:
        if not capture.isOpened():
            raise SourceError(f"{path}: is no video that OpenCV can read, or has lost its index; remove it")
        yield capture
    finally:
        capture.release()


def _walked(path: Path, capture: Any) -> Iterator[float]:
    """The times of all packets or frames that can be read, in the order of the file."""
    lost = failures = 0
    while failures < _DAMAGED:
        if _grab(capture):
            lost, failures = lost + failures, 0
            yield round(_property(capture, "POS_MSEC") / 1000, 6)
        else:
            # At a damaged packet as well as at the end.
            failures += 1
    if lost:
        log.warning("%s: is damaged: %d packets are passed over", path, lost)


def _sought(capture: Any, seconds: float, first: float, *, late: bool) -> bool:
    """Whether the frame at `seconds` was found and grabbed; `first`: the time of the first one."""
    import cv2

    if not _grab(capture):
        return False
    lag = _property(capture, "POS_MSEC") / 1000 - first if late else 0.0
    for before in _SEEKS:
        target = seconds + lag - before
        with quiet():
            capture.set(cv2.CAP_PROP_POS_MSEC, 1000 * max(target, 0.0))
        for number in range(_SOUGHT):
            if not _grab(capture):
                break
            found = _property(capture, "POS_MSEC") / 1000
            if abs(found - seconds - lag) <= SAME:
                return True
            if found > seconds + lag:
                # One that comes right after an earlier one is not there.
                if number:
                    return False
                break
    return False


def _increasing(found: Iterable[float], step: float) -> "array[float]":
    """The times of decoded frames, where one that does not come after the one before it is a step after that."""
    times = array("d")
    for time in found:
        times.append(time if not times or time > times[-1] + SAME else round(times[-1] + step, 6))
    return times


def _decoded(capture: Any, times: "array[float]", *, late: bool) -> Iterator[tuple[int, bool]]:
    """The position of every listed frame in order, and whether the decoder has it: it is the last one grabbed.

    `late`: the container (AVI) has times of decoding alone, which B-frames are later than by a constant.
    """
    done, failures, before, lag = 0, 0, -1.0, None
    while done < len(times) and failures <= len(times) - done:
        if not _grab(capture):
            failures += 1
            continue
        failures, seconds = 0, _property(capture, "POS_MSEC") / 1000
        if lag is None:
            lag = seconds - times[0] if late else 0.0
        found = bisect_left(times, seconds - lag - SAME)
        if not (done <= found < len(times) and times[found] - (seconds - lag) <= SAME):
            if before < seconds < times[done] + lag:
                continue  # a frame that is not listed, for its packet is damaged
            # A time that makes no sense, as of the last B-frame in MPEG files.
            found = done
        before = seconds
        yield from ((missing, False) for missing in range(done, found))
        yield found, True
        done = found + 1
    yield from ((missing, False) for missing in range(done, len(times)))


def grabbed_image(capture: Any, name: str, *, colours: bool = False) -> Image | str:
    """The frame that was grabbed last, grey or in colours, or why there is none, beginning with `name`."""
    with quiet():
        decoded, picture = capture.retrieve()
    if not decoded:
        return f"{name} cannot be decoded"
    try:
        return as_image(picture, name, colours=colours)
    except SourceError as error:
        return str(error)


def _grab(capture: Any) -> bool:
    with quiet():
        return bool(capture.grab())


def _property(capture: Any, name: str) -> float:
    import cv2

    return float(capture.get(getattr(cv2, f"CAP_PROP_{name}")))


def _check_readable(path: Path) -> None:
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise SourceError(f"{path}: is empty; copy it again or remove it")
    except OSError as error:
        raise SourceError(f"{path}: cannot be read: {error.strerror}") from error


def _tell_truncated(path: Path, capture: Any, times: "array[float]") -> None:
    """Warn if the header speaks of clearly more frames and of a later end; a guess from the file's size may be off."""
    count, rate = _property(capture, "FRAME_COUNT"), _property(capture, "FPS")
    if rate > 0 and len(times) < 0.95 * count - 2 and times[-1] < 0.95 * count / rate:
        log.warning(
            "%s: is truncated or damaged: %d frames up to second %.1f are there, of about %.0f up to second %.1f",
            path,
            len(times),
            times[-1],
            count,
            count / rate,
        )
