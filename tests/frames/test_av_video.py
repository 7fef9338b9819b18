"""Videos through PyAV: AV1, which OpenCV's wheel does not decode, and videos in the messages of bags."""

import pickle
import struct
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.recordings import (
    START,
    STEP,
    Message,
    compressed,
    cut,
    find_one,
    grays,
    grays_of,
    pictures,
    read_images,
    scheduled_as_before,
    write_bag,
    write_video,
)
from numpy.typing import NDArray

from placerec.errors import MissingExtraError, SourceError
from placerec.frames.av_video import AvVideo
from placerec.frames.video import Video

av = pytest.importorskip("av")


@scheduled_as_before()
def encoded(path: Path, codec: str, times: list[int] | None = None) -> Path:
    """A video of 20 pictures, at these tenths of a second."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number, picture in enumerate(pictures()):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts = number if times is None else times[number]
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@scheduled_as_before()
def pieces(codec: str, **options: str) -> list[bytes]:
    """20 pictures as a camera sends them: what is needed to decode one is in it or before it."""
    context = av.CodecContext.create(codec, "w")
    context.width, context.height, context.pix_fmt, context.framerate = 64, 48, "yuv420p", 10
    context.time_base, context.options = Fraction(1, 10), options
    packets = []
    for picture in pictures():
        packets += context.encode(av.VideoFrame.from_ndarray(picture, format="bgr24"))
    packets += context.encode(None)
    return [bytes(packet) for packet in packets]


def off(found: list[Any], expected: list[NDArray[Any]]) -> float:
    assert len(found) == len(expected)
    return max(float(np.abs(np.subtract(a, b, dtype=np.float64)).mean()) for a, b in zip(found, expected, strict=True))


@pytest.mark.parametrize("name", ["run.mp4", "run.mkv", "run.webm"])
def test_av1(tmp_path: Path, name: str) -> None:
    path = encoded(tmp_path / name, "libsvtav1")
    sequence = find_one(path)
    assert isinstance(sequence.recording, AvVideo)
    assert np.allclose([frame.time for frame in sequence.frames], np.arange(20) / 10, atol=1e-3)
    images = read_images(sequence)
    assert off(images, grays(pictures())) < 6
    for every in (3, 19):
        some = find_one(path, every=every)
        assert some.frames == sequence.frames[::every]
        assert all(map(np.array_equal, read_images(some, 1), images[every::every]))
    assert all(map(np.array_equal, read_images(find_one(path, begin=0.5, end=1)), images[5:10]))
    again = pickle.loads(pickle.dumps(sequence))  # noqa: S301
    assert all(map(np.array_equal, read_images(again, 7), images[7:]))


def test_times_are_the_containers_where_the_rate_varies(tmp_path: Path) -> None:
    times = [n + n // 3 for n in range(20)]
    sequence = find_one(encoded(tmp_path / "run.mp4", "libsvtav1", times))
    assert np.allclose([frame.time for frame in sequence.frames], np.array(times) / 10, atol=1e-3)
    assert off(read_images(sequence), grays(pictures())) < 6


def turned(path: Path) -> Path:
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 4 + 40
    struct.pack_into(">9i", data, matrix, 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
    path.write_bytes(bytes(data))
    return path


def test_frames_are_turned_and_made_grey_as_opencv_does(tmp_path: Path) -> None:
    for path in (write_video(tmp_path / "a.mp4"), turned(write_video(tmp_path / "b.mp4"))):
        one = find_one(path).recording
        assert type(one) is Video
        other = AvVideo(one.path, one.every, one.start, one.times, one.listed)
        by_opencv, by_pyav = (grays_of(image for _, image in each.frames()) for each in (one, other))
        for a, b in zip(by_opencv, by_pyav, strict=True):
            assert not isinstance(a, str)
            assert not isinstance(b, str)
            assert np.abs(np.subtract(a, b, dtype=np.float64)).max() <= 2
    path = turned(encoded(tmp_path / "c.mp4", "libsvtav1"))
    assert off(read_images(find_one(path)), [np.rot90(gray, -1) for gray in grays(pictures())]) < 6


def test_a_truncated_or_damaged_video_gives_what_it_has(tmp_path: Path) -> None:
    whole = encoded(tmp_path / "run.mkv", "libsvtav1")
    images = read_images(find_one(whole))
    short = read_images(find_one(cut(whole, 0.9, "short.mkv")))
    assert 0 < len(short) < 20
    assert all(map(np.array_equal, short, images))
    data = bytearray(whole.read_bytes())
    data[len(data) * 9 // 10 : len(data) * 9 // 10 + 30] = b"\xff" * 30
    (tmp_path / "spoilt.mkv").write_bytes(bytes(data))
    spoilt = read_images(find_one(tmp_path / "spoilt.mkv"))
    assert 0 < len(spoilt) <= 20
    assert np.array_equal(spoilt[0], images[0])


def test_without_pyav_it_is_said_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = encoded(tmp_path / "run.mp4", "libsvtav1")
    bag = write_bag(tmp_path / "bag", {"/v": [compressed(b"\0\0\0\1g", START, format="h264")] * 30})
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r"AV01 needs the package PyAV, .*, or convert it to H\.264"):
        find_one(path)
    with pytest.raises(MissingExtraError, match=r"the 30 images on /v are .* \(h264\), which needs the package PyAV"):
        find_one(bag)


def stream(data: list[bytes], format: str) -> list[Message]:
    return [compressed(piece, START + i * STEP, format) for i, piece in enumerate(data)]


@pytest.mark.parametrize("storage", ["ros1", "mcap"])
@pytest.mark.parametrize(
    ("codec", "format", "options"),
    [
        ("libx264", "h264", {"tune": "zerolatency", "g": "5"}),
        ("libx265", "hevc", {"x265-params": "bframes=0:keyint=5:log-level=none"}),
        ("libsvtav1", "AV1", {"svtav1-params": "pred-struct=1"}),
        ("libvpx", "vp8", {"deadline": "realtime", "lag-in-frames": "0"}),
        ("libvpx-vp9", "vp9", {"deadline": "realtime", "lag-in-frames": "0"}),
    ],
)
def test_a_video_in_the_messages_of_a_bag(
    tmp_path: Path, storage: str, codec: str, format: str, options: dict[str, str]
) -> None:
    path = tmp_path / ("run.bag" if storage == "ros1" else "run")
    write_bag(path, {"/v": stream(pieces(codec, **options), format)}, storage)
    sequence = find_one(path)
    assert [frame.time for frame in sequence.frames] == [(START + i * STEP) / 1e9 for i in range(20)]
    images = read_images(sequence)
    assert off(images, grays(pictures())) < 8
    assert all(map(np.array_equal, read_images(sequence, 7), images[7:]))
    assert all(map(np.array_equal, read_images(find_one(path, every=3, begin=0.4)), images[4::3]))
    again = pickle.loads(pickle.dumps(sequence))  # noqa: S301
    assert all(map(np.array_equal, read_images(again), images))


def test_messages_that_are_lost_or_damaged_are_named(tmp_path: Path) -> None:
    data = pieces("libx264", tune="zerolatency", g="5")
    # A recorder that starts between two key frames, an empty message, and one of noise.
    data = data[3:]
    data[5], data[9] = b"", b"\xff" * 40
    path = write_bag(tmp_path / "run", {"/v": stream(data, "h264")})
    images = read_images(find_one(path))
    assert len(images) == 17
    for number in (0, 1, 5, 9):
        assert images[number] == f"{path}: frame {number:06d} of /v cannot be decoded"
    assert sum(not isinstance(image, str) for image in images) >= 12


def test_a_bag_of_noise_has_frames_and_no_images(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "run", {"/v": stream([b"\xff" * 40] * 4, "h264")})
    assert all(isinstance(image, str) for image in read_images(find_one(path)))
    with pytest.raises(SourceError, match="has no topic /w"):
        find_one(path, topic="/w")
