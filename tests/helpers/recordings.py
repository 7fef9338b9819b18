"""Real recordings for tests: videos written by OpenCV, bags written by rosbags."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.frames import Sequence as FrameSequence, SourceOptions, all_images, find_sequences
from placerec.frames.sequence import ColourImage, Gray, Image, gray_levels

Picture = NDArray[np.uint8]
START = 1_700_000_000 * 10**9
STEP = 10**8


def pictures(count: int = 20, height: int = 48, width: int = 64) -> list[Picture]:
    """Colour pictures (BGR) of a camera that moves along a wall."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (height, width + 4 * count, 3), dtype=np.uint8), (0, 0), 4)
    wall = cv2.normalize(wall, np.empty_like(wall), 0, 255, cv2.NORM_MINMAX)
    return [np.ascontiguousarray(wall[:, 4 * i : 4 * i + width]) for i in range(count)]


@contextmanager
def scheduled_as_before() -> Iterator[None]:
    """The AV1 encoder makes its caller a real-time thread, where it may: all that comes after would starve others."""
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, priority)


def grays(found: Sequence[Picture]) -> list[NDArray[Any]]:
    return [cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) for picture in found]


def find_one(path: Path, **options: Any) -> FrameSequence:
    """The only sequence in a recording, read with these `SourceOptions`."""
    (sequence,) = find_sequences([path], options=SourceOptions(**options))
    return sequence


def read_images(sequence: FrameSequence, first: int = 0) -> list[Gray | str]:
    """The grey levels of a recording's frames from one on, which must be those that the sequence lists."""
    assert sequence.recording is not None
    images = list(sequence.recording.frames(first))
    assert [frame for frame, _ in images] == list(sequence.frames[first:])
    return grays_of(image for _, image in images)


def grays_of(images: Iterable[Image | str]) -> list[Gray | str]:
    """Grey levels, or the reasons why there are none."""
    return [image if isinstance(image, str) else gray_levels(image) for image in images]


def read_in_colours(sequence: FrameSequence, first: int = 0) -> list[ColourImage]:
    """All frames from one on in colours, with the grey levels that are read without them, byte for byte."""
    with_colours = list(all_images(sequence, colours=True))[first:]
    plain = list(all_images(sequence))[first:]
    assert len(with_colours) == len(plain) == len(sequence.frames) - first
    found = []
    for (frame, image), (same, gray) in zip(with_colours, plain, strict=True):
        assert frame == same
        assert isinstance(image, ColourImage), image
        assert isinstance(gray, np.ndarray)
        assert image.gray.dtype == gray.dtype
        assert np.array_equal(image.gray, gray)
        assert image.colours.dtype == np.uint8
        assert image.colours.shape == (*gray.shape, 3)
        found.append(image)
    return found


def write_video(path: Path, codec: str = "mp4v", frames: Sequence[Picture] | None = None, rate: float = 10) -> Path:
    """A video of `pictures`, at 10 frames a second."""
    frames = pictures() if frames is None else frames
    path.parent.mkdir(parents=True, exist_ok=True)
    size = frames[0].shape[1], frames[0].shape[0]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), rate, size)
    assert writer.isOpened()
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


def decoded(path: Path) -> list[NDArray[Any]]:
    """Every frame that OpenCV decodes, in grey, in the plainest way."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    found = []
    while capture.grab():
        found.append(cv2.cvtColor(capture.retrieve()[1], cv2.COLOR_BGR2GRAY))
    return found


def cut(path: Path, share: float, name: str) -> Path:
    """A copy beside a file of which the end is missing."""
    data = path.read_bytes()
    short = path.with_name(name)
    short.write_bytes(data[: int(len(data) * share)])
    return short


class Message:
    """What a bag is made of: a type, its fields without the header, and the two times in nanoseconds."""

    def __init__(self, kind: str, fields: dict[str, Any], stamp: int, stored: int | None = None) -> None:
        self.kind, self.fields, self.stamp = kind, fields, stamp
        self.stored = stamp if stored is None else stored


def raw(picture: NDArray[Any], encoding: str, stamp: int = START, **fields: Any) -> Message:
    """A sensor_msgs/Image of an array whose bytes are those that the encoding wants."""
    height, width = picture.shape[:2]
    data = np.ascontiguousarray(picture).view(np.uint8).reshape(-1)
    given = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0, "step": data.size // height}
    return Message("sensor_msgs/msg/Image", given | {"data": data} | fields, stamp)


def compressed(data: bytes, stamp: int = START, format: str = "jpeg") -> Message:
    return Message("sensor_msgs/msg/CompressedImage", {"format": format, "data": np.frombuffer(data, np.uint8)}, stamp)


def jpeg(picture: Picture) -> bytes:
    return cv2.imencode(".jpg", picture)[1].tobytes()


def stream(count: int = 20) -> list[Message]:
    """Raw colour pictures, ten a second."""
    return [raw(picture, "bgr8", START + i * STEP) for i, picture in enumerate(pictures(count))]


def write_bag(path: Path, topics: dict[str, list[Message]], storage: str = "mcap", **options: Any) -> Path:
    """A bag of these messages: `storage` "ros1" is a file, "sqlite3" and "mcap" are folders of ROS 2."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    path.parent.mkdir(parents=True, exist_ok=True)
    ros1 = storage == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=plugin)
    for name, arguments in options.items():
        getattr(writer, name)(*arguments)
    with writer:
        for topic, messages in topics.items():
            kind = messages[0].kind if messages else "sensor_msgs/msg/Image"
            link = writer.add_connection(topic, kind, typestore=store)
            for message in messages:
                writer.write(link, message.stored, serialize(_made(store, message, ros1), message.kind))
    return path


def _made(store: Any, message: Message, ros1: bool) -> Any:
    types = store.types
    if message.kind == "std_msgs/msg/String":
        return types[message.kind](**message.fields)
    seconds, nanoseconds = divmod(message.stamp, 10**9)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **({"seq": 0} if ros1 else {}))
    return types[message.kind](header=header, **message.fields)
