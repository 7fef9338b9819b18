"""Bags opened: ROS 1 (.bag) and ROS 2 (.db3, .mcap) by `rosbags`, other MCAP files by `mcap`; their messages in turn.

Other MCAP files are of ROS 1, or have foxglove.CompressedImage and foxglove.RawImage in JSON or protobuf.
"""

import base64
import json
import logging
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from placerec.errors import PlacerecError, SourceError, check_optional, counted
from placerec.frames.ros_image import COMPRESSED, RAW

_REMEDIES = {
    ".bag": "mend it with `rosbag reindex`, or remove it",
    ".mcap": "mend it with `mcap recover`, or remove it",
}
_TIME = ("sec", "secs", "seconds"), ("nsec", "nanosec", "nsecs", "nanos")
_MAGIC = b"\x89MCAP0\r\n"
_KINDS = {
    "sensor_msgs/Image": RAW,
    "sensor_msgs/CompressedImage": COMPRESSED,
    "foxglove.RawImage": RAW,
    "foxglove.CompressedImage": COMPRESSED,
}
log = logging.getLogger(__name__)


class Codec(NamedTuple):
    """A topic's messages: RAW or COMPRESSED, what parses one, and what gives its stamp in nanoseconds, 0 if none."""

    kind: str
    parse: Callable[[bytes], Any]
    stamp: Callable[[bytes], int]


class Connection(NamedTuple):
    """A topic in an MCAP file: as those of `rosbags`, and how its messages are encoded."""

    topic: str
    msgtype: str
    encoding: str
    schema: Any


class McapReader:
    """An MCAP file of any profile, by `mcap`; it has what a reader of `rosbags` has."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        self.connections: list[Connection] = []

    def open(self) -> None:
        """List the topics."""
        from mcap.reader import make_reader

        try:
            self._reader = make_reader(self._file)
            summary = self._reader.get_summary()
            if summary:
                channels = [(summary.schemas.get(one.schema_id), one) for one in summary.channels.values()]
            else:
                # Without an index every message says on which topic it is.
                channels = [(schema, one) for schema, one, _ in self._reader.iter_messages(log_time_order=False)]
        except BaseException:
            self.close()
            raise
        found = {
            (one.topic, one.message_encoding): Connection(
                one.topic, schema.name if schema else "", one.message_encoding, schema
            )
            for schema, one in channels
        }
        self.connections = list(found.values())

    def messages(
        self, connections: list[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Connection, nanoseconds and data of the messages on these topics, in the order of storing.

        `start`, `stop`: of those only that were stored from here to before there, in nanoseconds.
        """
        known = {(one.topic, one.encoding): one for one in connections}
        topics = [one.topic for one in connections]
        for _, channel, message in self._reader.iter_messages(topics=topics, start_time=start, end_time=stop):
            connection = known.get((channel.topic, channel.message_encoding))
            if connection:
                yield connection, message.log_time, message.data

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A reader of a bag, with `connections` and `messages()`; closed at the end.

    Raises MissingExtraError without rosbags, SourceError for a bag that cannot be read.
    """
    check_optional("rosbags", f"{path}: a bag")
    try:
        reader = _open(path)
    except PlacerecError:
        raise
    except OSError as error:
        raise SourceError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # Of what a damaged file makes the parser raise there is no list.
        remedy = _REMEDIES.get(path.suffix, "mend it with `ros2 bag reindex`, or remove it")
        raise SourceError(f"{path}: cannot be read as a bag ({reason_of(error)}); {remedy}") from error
    try:
        yield reader
    finally:
        reader.close()


def _open(path: Path) -> Any:
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    profile = _mcap_profile(path)
    reader: Any = Reader1(path) if is_ros1(path) else Reader2(path)
    try:
        reader.open()
        return reader
    except Exception as error:
        if profile is None or (profile == "ros2" and not find_spec("mcap")):
            raise
        refused = error
    # One that is whole may be of another profile, or of several.
    check_optional("mcap", f"{path}: an MCAP file of profile {profile!r}")
    reader = McapReader(path)
    try:
        reader.open()
    except Exception as error:
        # Of another profile rosbags says that alone, of what is damaged in it only `mcap` knows.
        raise (refused if profile == "ros2" else error) from None
    return reader


def is_ros1(path: Path) -> bool:
    return path.suffix.lower() == ".bag"


def _mcap_profile(path: Path) -> str | None:
    """The profile that an MCAP file names at the start; None for what is no such file."""
    if path.suffix.lower() != ".mcap" or not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(1 << 10)
    if not head.startswith(_MAGIC) or len(head) < len(_MAGIC) + 13:
        return None
    (length,) = struct.unpack_from("<I", head, len(_MAGIC) + 9)
    return head[len(_MAGIC) + 13 :][:length].decode("utf-8", "replace")


@cache
def _parser(ros1: bool) -> Callable[[bytes, str], Any]:
    """What makes a message of its bytes and type; both types are the same in all releases of ROS 1, and of ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    return store.deserialize_ros1 if ros1 else store.deserialize_cdr


def codec_of(connection: Any, ros1: bool) -> Codec | None:
    """What is known of the messages on a topic; None if they are no images, or encoded in a way that is not read."""
    kind = _KINDS.get(connection.msgtype.replace("/msg/", "/"))
    encoding = "ros1" if ros1 else getattr(connection, "encoding", "cdr")
    if kind is None or encoding not in ("ros1", "cdr", "json", "protobuf"):
        return None
    if encoding in ("ros1", "cdr"):
        parse = _parser(encoding == "ros1")
        return Codec(kind, lambda data: parse(data, kind), lambda data: _stamp(data, encoding == "ros1"))
    decode = _read_json if encoding == "json" else _read_protobuf(connection)
    return Codec(kind, decode, lambda data: decode(data).stamp)


def _read_json(data: bytes) -> SimpleNamespace:
    fields = json.loads(data)
    time = fields.pop("timestamp", None) or fields.get("header", {}).get("stamp", {})
    seconds, rest = (next((int(time[name]) for name in names if name in time), 0) for names in _TIME)
    fields["data"] = np.frombuffer(base64.b64decode(fields["data"]), np.uint8)
    return SimpleNamespace(**{"is_bigendian": 0, **fields, "stamp": seconds * 10**9 + rest})


def _read_protobuf(connection: Connection) -> Callable[[bytes], SimpleNamespace]:
    check_optional("mcap_protobuf", f"topic {connection.topic}: messages in protobuf")
    from mcap_protobuf.decoder import DecoderFactory

    decode: Any = DecoderFactory().decoder_for("protobuf", connection.schema)

    def read(data: bytes) -> SimpleNamespace:
        message = decode(data)
        fields = {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields}
        fields["data"] = np.frombuffer(message.data, np.uint8)
        stamp = message.timestamp.seconds * 10**9 + message.timestamp.nanos
        return SimpleNamespace(**{"is_bigendian": 0, **fields, "stamp": stamp})

    return read


def stored_messages(reader: Any, path: Path, topic: str, when: int | None = None) -> Iterator[tuple[Codec, int, bytes]]:
    """Codec, nanoseconds and data of the messages on a topic, as long as they can be read.

    `when`: of those only that were stored at this nanosecond.
    """
    found = [(one, codec_of(one, is_ros1(path))) for one in reader.connections if one.topic == topic]
    codecs = {one.msgtype: codec for one, codec in found if codec}
    part = {} if when is None else {"start": when, "stop": when + 1}
    messages = iter(reader.messages(connections=[one for one, codec in found if codec], **part))
    count = 0
    while True:
        try:
            connection, when, data = next(messages)
        except StopIteration:
            return
        except Exception as error:  # Of what a damaged file makes the parser raise there is no list.
            log.warning(
                "%s: is damaged behind %s (%s); the rest is not read", path, counted(count, "image"), reason_of(error)
            )
            return
        yield codecs[connection.msgtype], when, data
        count += 1


def _stamp(data: bytes, ros1: bool) -> int:
    """The header's stamp in nanoseconds, 0 if there is none: both types of message begin with their header."""
    # ROS 1 has a counter before it, ROS 2 the note of CDR, whose second byte tells the order of bytes.
    order = "<" if ros1 or (len(data) > 1 and data[1] & 1) else ">"
    if len(data) < 12:
        return 0
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
    return int(seconds) * 10**9 + int(nanoseconds)


def reason_of(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
