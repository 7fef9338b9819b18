"""MCAP files of every profile, written by `mcap`: ROS 2's short names, ROS 1, and Foxglove's images."""

import base64
import json
import pickle
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.recordings import START, STEP, cut, find_one, grays, jpeg, pictures, read_images

from placerec.errors import MissingExtraError, SourceError
from placerec.frames import read_gray

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
SHOWN = pictures(6)
FILES = [jpeg(picture) for picture in SHOWN]


def write(
    path: Path, profile: str, schema: tuple[str, str, bytes], encoding: str, messages: list[bytes], topic: str = "/c"
) -> Path:
    """An MCAP file of messages, ten a second; `schema`: name, encoding, data."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start(profile=profile, library="a test")
        name, kind, data = schema
        channel = writer.register_channel(topic, encoding, writer.register_schema(name, kind, data))
        for i, message in enumerate(messages):
            time = START + i * STEP + 3
            writer.add_message(channel, log_time=time, data=message, publish_time=time)
        writer.finish()
    return path


def failure(path: Path) -> str:
    with pytest.raises(SourceError) as error:
        find_one(path)
    return str(error.value)


def expected(tmp_path: Path) -> list[Any]:
    found = []
    for i, data in enumerate(FILES):
        (tmp_path / f"{i}.jpg").write_bytes(data)
        found.append(read_gray(tmp_path / f"{i}.jpg"))
    return found


def check(path: Path, levels: list[Any]) -> None:
    sequence = find_one(path)
    assert [frame.time for frame in sequence.frames] == [(START + i * STEP) / 1e9 for i in range(6)]
    assert all(map(np.array_equal, read_images(sequence), levels))
    assert all(map(np.array_equal, read_images(pickle.loads(pickle.dumps(sequence)), 2), levels[2:]))  # noqa: S301


def ros(compressed: bool, ros1: bool, *, little: bool = True) -> list[bytes]:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    kind = "sensor_msgs/msg/CompressedImage" if compressed else "sensor_msgs/msg/Image"
    made = []
    for i, (shown, data) in enumerate(zip(SHOWN, FILES, strict=True)):
        seconds, rest = divmod(START + i * STEP, 10**9)
        stamp = store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
        header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": 0} if ros1 else {}))
        fields: dict[str, Any] = {"format": "jpeg", "data": np.frombuffer(data, np.uint8)}
        if not compressed:
            fields = {"height": 48, "width": 64, "encoding": "bgr8", "is_bigendian": 0, "step": 192}
            fields["data"] = shown.reshape(-1)
        message = store.types[kind](header=header, **fields)
        cdr = partial(store.serialize_cdr, little_endian=little)
        made.append(bytes((store.serialize_ros1 if ros1 else cdr)(message, kind)))
    return made


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize(
    ("profile", "ros1"), [("ros2", False), ("ros1", True), ("", False), ("", True)], ids=["ros2", "ros1", "cdr", "1"]
)
def test_short_names_of_ros_under_any_profile(tmp_path: Path, compressed: bool, profile: str, ros1: bool) -> None:
    name = "sensor_msgs/CompressedImage" if compressed else "sensor_msgs/Image"
    schema = (name, "ros1msg" if ros1 else "ros2msg", b"std_msgs/Header header\n")
    path = write(tmp_path / "run.mcap", profile, schema, "ros1" if ros1 else "cdr", ros(compressed, ros1))
    check(path, expected(tmp_path) if compressed else grays(SHOWN))


def test_messages_of_a_machine_with_the_other_order_of_bytes(tmp_path: Path) -> None:
    schema = ("sensor_msgs/msg/CompressedImage", "ros2msg", b"std_msgs/Header header\n")
    for profile in ("ros2", ""):
        path = write(tmp_path / "run.mcap", profile, schema, "cdr", ros(True, False, little=False))
        check(path, expected(tmp_path))


def as_json(i: int) -> bytes:
    seconds, rest = divmod(START + i * STEP, 10**9)
    data = base64.b64encode(FILES[i]).decode()
    stamp = {"sec": seconds, "nsec": rest}
    return json.dumps({"timestamp": stamp, "frame_id": "c", "data": data, "format": "jpeg"}).encode()


def raw_json(i: int) -> bytes:
    seconds, rest = divmod(START + i * STEP, 10**9)
    data = base64.b64encode(SHOWN[i].tobytes()).decode()
    size = {"width": 64, "height": 48, "encoding": "bgr8", "step": 192}
    return json.dumps({"timestamp": {"sec": seconds, "nsec": rest}, **size, "data": data}).encode()


def test_foxglove_in_json(tmp_path: Path) -> None:
    schema = ("foxglove.CompressedImage", "jsonschema", b"{}")
    messages = [as_json(i) for i in range(6)]
    check(write(tmp_path / "a.mcap", "", schema, "json", messages), expected(tmp_path))
    schema = ("foxglove.RawImage", "jsonschema", b"{}")
    check(write(tmp_path / "b.mcap", "", schema, "json", [raw_json(i) for i in range(6)]), grays(SHOWN))


def protobuf(name: str, fields: dict[str, tuple[int, int]]) -> tuple[bytes, Callable[..., bytes]]:
    """The schema of a message of foxglove with these fields (number, type), and what makes such a message."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    time = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(time)
    file = descriptor_pb2.FileDescriptorProto(name="image.proto", package="foxglove", syntax="proto3")
    file.dependency.append(time.name)
    message = file.message_type.add(name=name)
    message.field.add(name="timestamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    for field, (number, kind) in fields.items():
        message.field.add(name=field, number=number, type=kind, label=1)
    pool = descriptor_pool.DescriptorPool()
    for one in (time, file):
        pool.Add(one)
    made = message_factory.GetMessageClass(pool.FindMessageTypeByName(f"foxglove.{name}"))

    def make(stamp: int, **values: Any) -> bytes:
        one: Any = made(**values)
        one.timestamp.seconds, one.timestamp.nanos = divmod(stamp, 10**9)
        return bytes(one.SerializeToString())

    return descriptor_pb2.FileDescriptorSet(file=[time, file]).SerializeToString(), make


def test_foxglove_in_protobuf(tmp_path: Path) -> None:
    pytest.importorskip("mcap_protobuf")
    schema, make = protobuf("CompressedImage", {"data": (2, 12), "format": (3, 9), "frame_id": (4, 9)})
    messages = [make(START + i * STEP, data=data, format="jpeg") for i, data in enumerate(FILES)]
    path = tmp_path / "a.mcap"
    check(write(path, "", ("foxglove.CompressedImage", "protobuf", schema), "protobuf", messages), expected(tmp_path))
    sides = {"width": (2, 7), "height": (3, 7), "encoding": (4, 9), "step": (5, 7), "data": (6, 12)}
    schema, make = protobuf("RawImage", sides)
    given = {"width": 64, "height": 48, "encoding": "bgr8", "step": 192}
    messages = [make(START + i * STEP, **given, data=one.tobytes()) for i, one in enumerate(SHOWN)]
    path = tmp_path / "b.mcap"
    check(write(path, "", ("foxglove.RawImage", "protobuf", schema), "protobuf", messages), grays(SHOWN))


def test_a_message_that_is_damaged_is_skipped(tmp_path: Path) -> None:
    messages = [as_json(i) for i in range(6)]
    messages[2] = b'{"data": 7'
    path = write(tmp_path / "run.mcap", "", ("foxglove.CompressedImage", "jsonschema", b"{}"), "json", messages)
    levels = read_images(find_one(path))
    assert [isinstance(gray, str) for gray in levels] == [False, False, True, False, False, False]
    assert str(levels[2]).startswith(f"{path}: frame 000002 of /c cannot be read (")


def test_what_is_not_read_is_said_with_what_it_is(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", "", ("foxglove.CompressedImage", "flatbuffer", b""), "flatbuffer", [b"x"] * 3)
    topics = "its topics are: /c (foxglove.CompressedImage in flatbuffer)"
    assert failure(path) == f"{path}: has no topic of images; {topics}"


def test_a_whole_file_is_never_to_be_recovered(tmp_path: Path) -> None:
    schema = ("foxglove.CompressedImage", "jsonschema", b"{}")
    path = write(tmp_path / "run.mcap", "", schema, "json", [as_json(i) for i in range(6)])
    for name, profile in (("a.mcap", ""), ("b.mcap", "ros2")):
        short = cut(write(path, profile, schema, "json", [as_json(i) for i in range(6)]), 0.6, name)
        assert failure(short).endswith("; mend it with `mcap recover`, or remove it")
        assert "rofile" not in failure(short)
    # Of profile ros2, with what ROS 2 has not.
    check(write(path, "ros2", schema, "json", [as_json(i) for i in range(6)]), expected(tmp_path))


def test_a_file_without_an_index_is_read(tmp_path: Path) -> None:
    from mcap.writer import IndexType, Writer

    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer: Any = Writer(
            file,
            index_types=IndexType.NONE,
            use_statistics=False,
            use_summary_offsets=False,
            repeat_schemas=False,
            repeat_channels=False,
        )
        writer.start()
        channel = writer.register_channel(
            "/c", "json", writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        )
        for i in range(6):
            writer.add_message(channel, log_time=START + i, data=as_json(i), publish_time=START)
        writer.finish()
    check(path, expected(tmp_path))


def test_without_mcap_it_is_said_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "run.mcap", "", ("foxglove.CompressedImage", "jsonschema", b"{}"), "json", [as_json(0)])
    schema = ("sensor_msgs/msg/CompressedImage", "ros2msg", b"std_msgs/Header header\n")
    whole = write(tmp_path / "whole.mcap", "ros2", schema, "cdr", ros(True, False))
    for name in [name for name in sys.modules if name.split(".")[0] == "mcap"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(MissingExtraError, match="an MCAP file of profile '' needs the package mcap,"):
        find_one(path)
    # What is damaged needs no other reader.
    short = cut(whole, 0.6, "short.mcap")
    assert failure(short).endswith("; mend it with `mcap recover`, or remove it")
