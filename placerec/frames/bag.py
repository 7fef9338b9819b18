"""Recordings of ROS 1 (.bag), ROS 2 (folders with metadata.yaml, .db3, .mcap), and other MCAP files, without ROS."""

import logging
from array import array
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from placerec.arrays import Ints
from placerec.errors import PlacerecError, SourceError, check_optional
from placerec.frames.av_video import Decoded, decode_pieces
from placerec.frames.bag_reader import Codec, codec_of, is_ros1, opened, reason_of, stored_messages
from placerec.frames.ros_image import DEPTH, codec_in, image_of, unreadable
from placerec.frames.sequence import EPOCH, Frame, Gray, Image, shown_pixels

SUFFIXES = (".bag", ".db3", ".mcap")
METADATA = "metadata.yaml"
# Nanoseconds by which a message may be older than one that is stored before it; a clock that was set goes further back.
_LATE = 10**9
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Bag:
    """Every `every`-th image of a topic from number `start` on, in order of time; `listed`: those that are read.

    `ranks`: the place in that order of each stored message, `stored`: the nanoseconds at which it was. `codec`: of the
    video that messages are pieces of, "" for images.
    """

    path: Path
    topic: str
    every: int
    start: int = field(repr=False)
    codec: str = field(repr=False, compare=False)
    ranks: "array[int]" = field(repr=False, compare=False)
    stored: "array[int]" = field(repr=False, compare=False)
    listed: tuple[Frame, ...] = field(repr=False, compare=False)
    endless: ClassVar[bool] = False

    def files(self) -> list[Path]:
        return sorted(path for path in self.path.iterdir() if path.is_file()) if self.path.is_dir() else [self.path]

    def frames(self, first: int = 0, *, colours: bool = False) -> Iterator[tuple[Frame, Image | str]]:
        waiting: dict[int, Decoded] = {}
        number = first
        with opened(self.path) as reader:
            messages = islice(stored_messages(reader, self.path, self.topic), len(self.ranks))
            for place, decoded in self._decoded(messages):
                index, between = divmod(self.ranks[place] - self.start, self.every)
                if not between and first <= index < len(self.listed):
                    waiting[index] = decoded
                while number in waiting:
                    frame = self.listed[number]
                    yield frame, waiting.pop(number)(f"{self.path}: frame {frame.name} of {self.topic}", colours)
                    number += 1
                if number == len(self.listed):
                    return
        for frame in self.listed[number:]:
            yield frame, f"{self.path}: frame {frame.name} cannot be read again"

    def picture(self, index: int) -> Gray | str:
        """The frame at `index`, or why there is none; of images nothing before it is read."""
        if self.codec:
            return next(shown_pixels(image) for _, image in self.frames(index, colours=True))
        place = self.ranks.index(self.start + index * self.every)
        when = self.stored[place]
        # Messages that were stored at one nanosecond are told by their order.
        before = place - self.stored.index(when)
        name = f"{self.path}: frame {self.listed[index].name} of {self.topic}"
        with opened(self.path) as reader:
            for codec, _, data in islice(stored_messages(reader, self.path, self.topic, when), before, None):
                return shown_pixels(_image(codec, data, name, True))
        return f"{name} cannot be read again"

    def _decoded(self, messages: Iterator[tuple[Codec, int, bytes]]) -> Iterator[tuple[int, Decoded]]:
        """What gives the image of each message, in the order of storing."""
        if not self.codec:
            return enumerate(partial(_image, codec, data) for codec, _, data in messages)
        return decode_pieces(self.codec, (_piece(codec, data) for codec, _, data in messages))


def _image(codec: Codec, data: bytes, name: str, colours: bool) -> Image | str:
    try:
        return image_of(codec.parse(data), codec.kind, name, colours=colours)
    except PlacerecError as error:
        return str(error)
    except Exception as error:  # Of what a damaged message makes the parser raise there is no list.
        return f"{name} cannot be read ({reason_of(error)})"


def _piece(codec: Codec, data: bytes) -> bytes:
    try:
        return bytes(np.asarray(codec.parse(data).data).tobytes())
    except Exception:  # Of what a damaged message makes the parser raise there is no list.
        return b""


def is_bag(path: Path) -> bool:
    """Whether a path is named or laid out as a bag is."""
    if path.is_dir():
        return (path / METADATA).is_file() and any(any(path.glob(name)) for name in ("*.db3*", "*.mcap*"))
    return path.suffix.lower() in SUFFIXES


def list_bag(path: Path, topic: str | None) -> tuple[str, str, "array[int]", "array[int]", list[float]]:
    """The topic of images in a bag, the codec of the video that they are pieces of ("" if of none), ranks and times.

    Ranks are the places of messages in the order of time; before the times, which are in that order, stand the
    nanoseconds at which messages were stored, in the order of storing.
    Times are the header's stamps in seconds; or, with a warning, all are when messages were stored: if some stamps are
    0 or by another clock, and if they go back by more than a second. Raises MissingExtraError without rosbags,
    SourceError for a bag that cannot be read or without such a topic; what a damaged bag still gives is kept, and the
    rest told of in a warning.
    """
    stamps, stored, reason, video = array("q"), array("q"), "", ""
    with opened(path) as reader:
        topic = _choose(path, reader, topic)
        for codec, when, data in stored_messages(reader, path, topic):
            # Each message that is damaged is told of where it is read.
            with suppress(Exception):
                if not stored:
                    message = codec.parse(data)
                    reason, video = unreadable(message, codec.kind), codec_in(message, codec.kind)
            stored.append(when)
            stamps.append(_stamp_of(codec, data))
    if not stored:
        raise SourceError(f"{path}: holds no image on {topic}; name another topic, or remove it")
    if reason:
        raise SourceError(f"{path}: the {len(stored)} images on {topic} {reason}")
    if video:
        check_optional("av", f"{path}: the {len(stored)} images on {topic} are a video in pieces ({video}), which")
    times = np.array(stamps, np.int64)
    if reason := _unusable(times):
        if times.any():
            log.warning("%s: the stamps on %s %s; the times are those at which images were stored", path, topic, reason)
        times = np.array(stored, np.int64)
    order = np.argsort(times, kind="stable")
    ranks = np.empty(len(order), np.int64)
    ranks[order] = np.arange(len(order))
    return topic, video, array("q", ranks.tolist()), stored, (times[order] / 1e9).tolist()


def _stamp_of(codec: Codec, data: bytes) -> int:
    try:
        return codec.stamp(data)
    except Exception:  # Of what a damaged message makes the parser raise there is no list.
        return 0


def _unusable(stamps: Ints) -> str:
    """Why stamps in nanoseconds, in the order of storing, are no times of one sequence; "" if they are."""
    if not stamps.all():
        return "are 0 in part"
    early = stamps < EPOCH * 10**9
    if early.any() and not early.all():
        return "are by two clocks"
    return "jump" if (np.maximum.accumulate(stamps) - stamps).max() > _LATE else ""


def _choose(path: Path, reader: Any, topic: str | None) -> str:
    """The topic that is asked for, or the only one of images."""
    kinds = {connection.topic: connection.msgtype for connection in reader.connections}
    images: list[str] = sorted({one.topic for one in reader.connections if codec_of(one, is_ros1(path))})
    if topic is not None:
        topic = next((name for name in (topic, f"/{topic}") if name in kinds), topic)
        if topic in images:
            return topic
        what = f"{topic} is of {kinds[topic]}, not of images" if topic in kinds else f"has no topic {topic}"
        raise SourceError(f"{path}: {what}; its topics of images are: {_listed(images)}")
    pictures = [name for name in images if not name.endswith(DEPTH)]
    if len(pictures) == 1:
        return pictures[0]
    if images and not pictures:
        raise SourceError(f"{path}: has compressed depth alone ({_listed(images)}); to read it, name it (--topic)")
    if images:
        raise SourceError(f"{path}: has several topics of images: {_listed(images)}; choose one (--topic)")
    encodings = {one.topic: f" in {one.encoding}" for one in reader.connections if hasattr(one, "encoding")}
    others = _listed([f"{name} ({kind}{encodings.get(name, '')})" for name, kind in sorted(kinds.items())])
    raise SourceError(f"{path}: has no topic of images; its topics are: {others}")


def _listed(names: list[str]) -> str:
    return ", ".join(names[:10]) + (f" and {len(names) - 10} more" if len(names) > 10 else "") if names else "none"
