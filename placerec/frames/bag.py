"""Recordings of ROS 1 (.bag), ROS 2 (folders with metadata.yaml, .db3, .mcap), read by `rosbags` without ROS."""

import logging
import re
import struct
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Singles
from placerec.errors import PlacerecError, SourceError, check_optional
from placerec.frames.image import as_gray, decode_gray
from placerec.frames.sequence import EPOCH, Frame, Gray

SUFFIXES = (".bag", ".db3", ".mcap")
METADATA = "metadata.yaml"
# Nanoseconds by which a message may be older than one that is stored before it; a clock that was set goes further back.
_LATE = 10**9
_REMEDIES = {
    ".bag": "mend it with `rosbag reindex`, or remove it",
    ".mcap": "mend it with `mcap recover`, or remove it",
}
RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

_PLANAR = ("nv12", "nv21", "yuv420", "i420", "yv12")
# encoding -> channels, bytes a channel, OpenCV's conversion to grey ("" where the one channel is grey already).
_ENCODINGS = {
    "mono8": (1, 1, ""),
    "8UC1": (1, 1, ""),
    "mono16": (1, 2, ""),
    "16UC1": (1, 2, ""),
    "rgb8": (3, 1, "RGB2GRAY"),
    "bgr8": (3, 1, "BGR2GRAY"),
    "8UC3": (3, 1, "BGR2GRAY"),
    "rgba8": (4, 1, "RGBA2GRAY"),
    "bgra8": (4, 1, "BGRA2GRAY"),
    "8UC4": (4, 1, "BGRA2GRAY"),
    "rgb16": (3, 2, "RGB2GRAY"),
    "bgr16": (3, 2, "BGR2GRAY"),
    "yuv422": (2, 1, "YUV2GRAY_UYVY"),
    "uyvy": (2, 1, "YUV2GRAY_UYVY"),
    "yuv422_yuy2": (2, 1, "YUV2GRAY_YUY2"),
    "yuyv": (2, 1, "YUV2GRAY_YUY2"),
    # The grey levels come first, and half as many bytes of colour behind them.
    **dict.fromkeys(_PLANAR, (1, 1, "")),
    **{
        f"bayer_{order}{8 * size}": (1, size, f"Bayer{order.upper()}2GRAY")
        for order in ("rggb", "bggr", "gbrg", "grbg")
        for size in (1, 2)
    },
}
# A topic of compressed depth is called so, and its messages' format, whose data begin with as many bytes of their own.
_DEPTH, _DEPTH_HEADER = "compressedDepth", 12
_VIDEO = re.compile(r"(?i)\b(h\.?264|h\.?265|avc1?|hevc|av1|vp[89])\b")
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Bag:
    """Every `every`-th image of a topic from number `start` on, in order of time; `listed`: those that are read.

    `ranks`: the place in that order of each stored message.
    """

    path: Path
    topic: str
    every: int
    start: int = field(repr=False)
    ranks: "array[int]" = field(repr=False, compare=False)
    listed: tuple[Frame, ...] = field(repr=False, compare=False)
    endless: ClassVar[bool] = False

    def files(self) -> list[Path]:
        return sorted(path for path in self.path.iterdir() if path.is_file()) if self.path.is_dir() else [self.path]

    def frames(self, first: int = 0) -> Iterator[tuple[Frame, Gray | str]]:
        waiting: dict[int, tuple[str, bytes]] = {}
        number = first
        with _opened(self.path) as reader:
            for rank, (kind, _, data) in zip(self.ranks, _messages(reader, self.path, self.topic), strict=False):
                index, between = divmod(rank - self.start, self.every)
                if not between and first <= index < len(self.listed):
                    waiting[index] = kind, data
                while number in waiting:
                    yield self.listed[number], self._gray(self.listed[number], *waiting.pop(number))
                    number += 1
                if number == len(self.listed):
                    return
        for frame in self.listed[number:]:
            yield frame, f"{self.path}: frame {frame.name} cannot be read again"

    def _gray(self, frame: Frame, kind: str, data: bytes) -> Gray | str:
        name = f"{self.path}: frame {frame.name} of {self.topic}"
        try:
            return gray_of(_parser(_is_ros1(self.path))(data, kind), kind, name)
        except PlacerecError as error:
            return str(error)
        except Exception as error:  # Of what a damaged message makes the parser raise there is no list.
            return f"{name} cannot be read ({_reason(error)})"


def is_bag(path: Path) -> bool:
    """Whether a path is named or laid out as a bag is."""
    if path.is_dir():
        return (path / METADATA).is_file() and any(any(path.glob(name)) for name in ("*.db3*", "*.mcap*"))
    return path.suffix.lower() in SUFFIXES


def list_bag(path: Path, topic: str | None) -> tuple[str, "array[int]", list[float]]:
    """The topic of images in a bag, the rank of each of its messages in order of time, and the times in that order.

    Times are the header's stamps in seconds; or, with a warning, all are when messages were stored: if some stamps are
    0 or by another clock, and if they go back by more than a second. Raises MissingExtraError without rosbags,
    SourceError for a bag that cannot be read or without such a topic; what a damaged bag still gives is kept, and the
    rest told of in a warning.
    """
    stamps, stored, reason = array("q"), array("q"), ""
    with _opened(path) as reader:
        topic = _choose(path, reader, topic)
        for kind, when, data in _messages(reader, path, topic):
            if not stored:
                reason = _unreadable(kind, data, _is_ros1(path))
            stamps.append(_stamp(data, _is_ros1(path)))
            stored.append(when)
    if not stored:
        raise SourceError(f"{path}: holds no image on {topic}; name another topic, or remove it")
    if reason:
        raise SourceError(f"{path}: the {len(stored)} images on {topic} {reason}")
    times = np.array(stamps, np.int64)
    if reason := _unusable(times):
        if times.any():
            log.warning("%s: the stamps on %s %s; the times are those at which images were stored", path, topic, reason)
        times = np.array(stored, np.int64)
    order = np.argsort(times, kind="stable")
    ranks = np.empty(len(order), np.int64)
    ranks[order] = np.arange(len(order))
    return topic, array("q", ranks.tolist()), (times[order] / 1e9).tolist()


def _unusable(stamps: Ints) -> str:
    """Why stamps in nanoseconds, in the order of storing, are no times of one sequence; "" if they are."""
    if not stamps.all():
        return "are 0 in part"
    early = stamps < EPOCH * 10**9
    if early.any() and not early.all():
        return "are by two clocks"
    return "jump" if (np.maximum.accumulate(stamps) - stamps).max() > _LATE else ""


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    check_optional("rosbags", f"{path}: a bag")
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    try:
        reader = Reader1(path) if _is_ros1(path) else Reader2(path)
        reader.open()
    except OSError as error:
        raise SourceError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # Of what a damaged file makes the parser raise there is no list.
        remedy = _REMEDIES.get(path.suffix, "mend it with `ros2 bag reindex`, or remove it")
        raise SourceError(f"{path}: cannot be read as a bag ({_reason(error)}); {remedy}") from error
    try:
        yield reader
    finally:
        reader.close()


def _is_ros1(path: Path) -> bool:
    return path.suffix.lower() == ".bag"


@cache
def _parser(ros1: bool) -> Callable[[bytes, str], Any]:
    """What makes a message of its bytes and type; both types are the same in all releases of ROS 1, and of ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    return store.deserialize_ros1 if ros1 else store.deserialize_cdr


def _choose(path: Path, reader: Any, topic: str | None) -> str:
    """The topic that is asked for, or the only one of images."""
    kinds = {connection.topic: connection.msgtype for connection in reader.connections}
    images: list[str] = sorted(name for name, kind in kinds.items() if kind in (RAW, COMPRESSED))
    if topic is not None:
        topic = next((name for name in (topic, f"/{topic}") if name in kinds), topic)
        if topic in images:
            return topic
        what = f"{topic} is of {kinds[topic]}, not of images" if topic in kinds else f"has no topic {topic}"
        raise SourceError(f"{path}: {what}; its topics of images are: {_listed(images)}")
    pictures = [name for name in images if not name.endswith(_DEPTH)]
    if len(pictures) == 1:
        return pictures[0]
    if images and not pictures:
        raise SourceError(f"{path}: has compressed depth alone ({_listed(images)}); to read it, name it (--topic)")
    if images:
        raise SourceError(f"{path}: has several topics of images: {_listed(images)}; choose one (--topic)")
    others = _listed([f"{name} ({kind})" for name, kind in sorted(kinds.items())])
    raise SourceError(f"{path}: has no topic of images; its topics are: {others}")


def _messages(reader: Any, path: Path, topic: str) -> Iterator[tuple[str, int, bytes]]:
    """Type, nanoseconds and data of the messages on a topic, as long as they can be read."""
    connections = [one for one in reader.connections if one.topic == topic and one.msgtype in (RAW, COMPRESSED)]
    messages = iter(reader.messages(connections=connections))
    count = 0
    while True:
        try:
            connection, when, data = next(messages)
        except StopIteration:
            return
        except Exception as error:  # Of what a damaged file makes the parser raise there is no list.
            log.warning("%s: is damaged behind %d images (%s); the rest is not read", path, count, _reason(error))
            return
        yield connection.msgtype, when, data
        count += 1


def _unreadable(kind: str, data: bytes, ros1: bool) -> str:
    """Why no message that is like the first one on a topic can be read; "" if some may be."""
    try:
        message = _parser(ros1)(data, kind)
    except Exception:  # Each message that is damaged is told of where it is read.
        return ""
    if kind == COMPRESSED:
        video = _VIDEO.search(message.format)
        return f"are a video in pieces ({video[1]}), which is not read; make a video file of them" if video else ""
    known = message.encoding in (*_ENCODINGS, "32FC1")
    return "" if known else f"have {_unknown_encoding(message.encoding)}"


def _unknown_encoding(encoding: str) -> str:
    return f"the encoding {encoding!r}, which is not read; known are {', '.join([*_ENCODINGS, '32FC1'])}"


def _stamp(data: bytes, ros1: bool) -> int:
    """The header's stamp in nanoseconds, 0 if there is none: both types of message begin with their header."""
    # ROS 1 has a counter before it, ROS 2 the note of CDR, whose second byte tells the order of bytes.
    order = "<" if ros1 or (len(data) > 1 and data[1] & 1) else ">"
    if len(data) < 12:
        return 0
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
    return int(seconds) * 10**9 + int(nanoseconds)


def _listed(names: list[str]) -> str:
    return ", ".join(names[:10]) + (f" and {len(names) - 10} more" if len(names) > 10 else "") if names else "none"


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def gray_of(message: Any, kind: str, name: str) -> Gray:
    """The grey levels 0..255 of a message of type `kind`.

    16 bits as in `decode_gray`; 32FC1: what is no positive number is 0, and 1, or the greatest value if that is more,
    becomes 255. Raises SourceError that begins with `name` for an encoding that is not read and for missing data.
    """
    data = np.asarray(message.data)
    if kind == COMPRESSED:
        return decode_gray(data.tobytes()[_DEPTH_HEADER if _DEPTH in message.format else 0 :], name)
    if message.encoding == "32FC1":
        return _of_floats(_pixels(message, data, 1, "f4", name)[..., 0], name)
    if message.encoding not in _ENCODINGS:
        raise SourceError(f"{name} has {_unknown_encoding(message.encoding)}")
    import cv2

    channels, size, conversion = _ENCODINGS[message.encoding]
    pixels = _pixels(message, data, channels, f"u{size}", name)
    if not conversion:
        return as_gray(pixels[..., 0], name)
    if min(pixels.shape[:2]) > 1:
        pixels = cv2.cvtColor(pixels[..., 0] if channels == 1 else pixels, getattr(cv2, f"COLOR_{conversion}"))
    return as_gray(pixels, name)


def _pixels(message: Any, data: NDArray[np.uint8], channels: int, kind: str, name: str) -> NDArray[Any]:
    """The message's data as (height, width, channels), without the padding of its rows and in this machine's order."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    if message.encoding in _PLANAR and len(data) < height * step * 3 // 2:
        # Some drivers count the rows of colour, too.
        height = height * 2 // 3
    item = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = width * channels * item.itemsize
    if not row or step < row or len(data) < height * step or not height:
        what = f"{width}x{height} pixels in rows of {step} bytes need more than its {len(data)} bytes of data"
        raise SourceError(f"{name} is damaged: {what}")
    rows = data[: height * step].reshape(height, step)[:, :row]
    return np.ascontiguousarray(rows).view(item).astype(kind).reshape(height, width, channels)


def _of_floats(values: Singles, name: str) -> Gray:
    values = np.where(np.isfinite(values) & (values > 0), values, np.float32(0)).astype(np.float32)
    scaled = values * np.float32(255 / max(1.0, float(values.max())))
    # Checked as any other picture is; its levels stay fractions.
    as_gray(scaled.astype(np.uint8), name)
    return scaled
