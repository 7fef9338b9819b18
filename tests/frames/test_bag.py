"""Bags of ROS 1 and ROS 2, written by rosbags: which messages are frames, at what times, and what their levels are."""

import logging
import pickle
import shutil
import sys
from pathlib import Path

import cv2
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
    jpeg,
    pictures,
    raw,
    read_images,
    stream,
    write_bag,
)

from placerec.errors import MissingExtraError, SourceError
from placerec.frames import find_sequences, images_at, read_gray

pytest.importorskip("rosbags")
TOPIC = "/camera/image_raw"


def shown_at(stamps: list[int], stored: list[int]) -> list[Message]:
    """Pictures with these stamps, stored at these times."""
    shown = zip(pictures(len(stamps)), stamps, stored, strict=True)
    return [Message("sensor_msgs/msg/Image", raw(one, "bgr8").fields, stamp, when) for one, stamp, when in shown]


def failure(path: Path, topic: str | None = None) -> str:
    with pytest.raises(SourceError) as error:
        find_one(path, topic=topic)
    return str(error.value)


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_every_kind_of_bag(tmp_path: Path, storage: str) -> None:
    path = write_bag(tmp_path / ("run.bag" if storage == "ros1" else "run"), {TOPIC: stream()}, storage)
    sequence = find_one(path)
    assert (sequence.name, sequence.source) == ("run", path)
    assert [frame.name for frame in sequence.frames] == [f"{i:06d}" for i in range(20)]
    assert [frame.time for frame in sequence.frames] == [(START + i * STEP) / 1e9 for i in range(20)]
    expected = grays(pictures())
    assert all(map(np.array_equal, read_images(sequence), expected))
    assert all(map(np.array_equal, read_images(sequence, 13), expected[13:]))
    assert all(map(np.array_equal, grays_of(images_at(sequence, [3, 4, 17])), [expected[i] for i in (3, 4, 17)]))
    some = find_one(path, every=6)
    assert some.frames == sequence.frames[::6]
    assert all(map(np.array_equal, read_images(some, 1), expected[6::6]))
    assert read_images(sequence, 20) == []
    assert repr(some.recording) == f"Bag(path={path!r}, topic={TOPIC!r}, every=6)"
    again = pickle.loads(pickle.dumps(some))  # noqa: S301
    assert again == some
    assert len(read_images(again)) == 4
    if storage != "ros1":
        (file,) = [file for file in path.iterdir() if file.suffix in (".db3", ".mcap")]
        assert all(map(np.array_equal, read_images(find_one(file)), expected))
        assert again.recording.files() == sorted(path.iterdir())
    else:
        assert again.recording.files() == [path]


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_compressed_images_have_the_levels_of_their_files(tmp_path: Path, storage: str) -> None:
    files = [jpeg(picture) for picture in pictures(3)]
    files.append(cv2.imencode(".png", pictures(1)[0])[1].tobytes())
    deep = (np.arange(64 * 48, dtype=np.uint16) % 4000).reshape(48, 64)
    files.append(cv2.imencode(".png", deep)[1].tobytes())
    files += [files[0][:-300], b"", b"no picture"]
    path = tmp_path / ("run.bag" if storage == "ros1" else "run")
    write_bag(path, {"/c": [compressed(data, START + i * STEP) for i, data in enumerate(files)]}, storage)
    levels = read_images(find_one(path))
    for data, gray in zip(files[:5], levels, strict=False):
        (tmp_path / "one").write_bytes(data)
        assert np.array_equal(gray, read_gray(tmp_path / "one"))
    where = f"{path}: frame 0000{{}} of /c: "
    assert levels[5:] == [
        where.format("05") + "JPEG is truncated or damaged (no end marker); copy it again or remove it",
        where.format("06") + "is empty; copy it again or remove it",
        where.format("07") + "is no image that OpenCV can decode; copy it again or remove it",
    ]


def test_compression_of_bags(tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode

    expected = grays(pictures())
    for mode in (CompressionMode.FILE, CompressionMode.MESSAGE):
        path = tmp_path / mode.name
        write_bag(path, {TOPIC: stream()}, "sqlite3", set_compression=(mode, CompressionFormat.ZSTD))
        assert all(map(np.array_equal, read_images(find_one(path)), expected))
    storage = (CompressionMode.STORAGE, CompressionFormat.ZSTD)
    path = write_bag(tmp_path / "m", {TOPIC: stream()}, "mcap", set_compression=storage)
    assert all(map(np.array_equal, read_images(find_one(path)), expected))
    for kind in Writer1.CompressionFormat:
        path = tmp_path / f"{kind.name}.bag"
        write_bag(path, {TOPIC: stream()}, "ros1", set_compression=(kind,))
        assert all(map(np.array_equal, read_images(find_one(path)), expected))


def test_topics(tmp_path: Path) -> None:
    text = [Message("std_msgs/msg/String", {"data": "hello"}, START)]
    few = [compressed(jpeg(pictures(1)[0]))]
    path = write_bag(tmp_path / "both", {"/b": stream(2), "/a": few, "/talk": text})
    assert failure(path) == f"{path}: has several topics of images: /a, /b; choose one (--topic)"
    assert [len(find_one(path, topic=topic).frames) for topic in ("/a", "b", "/b")] == [1, 2, 2]
    assert failure(path, "/c") == f"{path}: has no topic /c; its topics of images are: /a, /b"
    assert failure(path, "/talk") == (
        f"{path}: /talk is of std_msgs/msg/String, not of images; its topics of images are: /a, /b"
    )
    one = write_bag(tmp_path / "one", {"/b": stream(2), "/talk": text})
    assert find_one(one).recording == find_one(one, topic="/b").recording
    none = write_bag(tmp_path / "none", {"/talk": text})
    assert failure(none) == f"{none}: has no topic of images; its topics are: /talk (std_msgs/msg/String)"
    assert failure(none, "/talk").endswith("its topics of images are: none")
    void = write_bag(tmp_path / "void", {"/b": []})
    assert failure(void) == f"{void}: holds no image on /b; name another topic, or remove it"
    many = write_bag(tmp_path / "many", {f"/cam{i:02d}": few for i in range(12)})
    assert "/cam09 and 2 more; choose one" in failure(many)


def test_compressed_depth_is_read_only_if_it_is_named(tmp_path: Path) -> None:
    deep = (np.arange(64 * 48, dtype=np.uint16) % 4000).reshape(48, 64)
    png = cv2.imencode(".png", deep)[1].tobytes()
    depth = [compressed(bytes(12) + png, format="16UC1; compressedDepth png")]
    path = write_bag(
        tmp_path / "both", {"/d/compressedDepth": depth, "/c/compressed": [compressed(jpeg(pictures(1)[0]))]}
    )
    assert repr(find_one(path).recording) == f"Bag(path={path!r}, topic='/c/compressed', every=1)"
    (tmp_path / "deep.png").write_bytes(png)
    (gray,) = read_images(find_one(path, topic="/d/compressedDepth"))
    assert np.array_equal(gray, read_gray(tmp_path / "deep.png"))
    alone = write_bag(tmp_path / "alone", {"/d/compressedDepth": depth})
    said = "has compressed depth alone (/d/compressedDepth); to read it, name it (--topic)"
    assert failure(alone) == f"{alone}: {said}"


def test_a_topic_that_cannot_be_read_is_refused_once(tmp_path: Path) -> None:
    odd = write_bag(tmp_path / "odd", {"/o": [raw(pictures(1)[0], "nv99", START + i) for i in range(7)]})
    assert failure(odd).startswith(f"{odd}: the 7 images on /o have the encoding 'nv99', which is not read; known are")
    # One among others is skipped as a damaged one is.
    some = write_bag(tmp_path / "some", {"/o": [*stream(3), raw(pictures(1)[0], "nv99", START + 10**9)]})
    assert [isinstance(gray, str) for gray in read_images(find_one(some))] == [False] * 3 + [True]


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_frames_are_in_the_order_of_their_stamps(tmp_path: Path, storage: str) -> None:
    """Messages arrive late: the order in which they are stored is not that of the cameras."""
    order = [2, 0, 1, 3, 5, 4, 9, 6, 7, 8]
    shown = pictures(10)
    messages = [
        Message("sensor_msgs/msg/Image", raw(shown[i], "bgr8").fields, START + i * STEP, START + n * STEP + 7)
        for n, i in enumerate(order)
    ]
    path = write_bag(tmp_path / ("run.bag" if storage == "ros1" else "run"), {TOPIC: messages}, storage)
    sequence = find_one(path)
    assert [frame.time for frame in sequence.frames] == [(START + i * STEP) / 1e9 for i in range(10)]
    assert all(map(np.array_equal, read_images(sequence), grays(shown)))
    assert all(map(np.array_equal, read_images(sequence, 2), grays(shown)[2:]))
    assert all(map(np.array_equal, read_images(find_one(path, every=3)), grays(shown)[::3]))


def test_without_stamps_or_with_a_clock_that_was_set_it_counts_when_messages_were_stored(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    stored = [START + i * STEP for i in range(220)]
    fields = raw(pictures(1)[0], "bgr8").fields

    def bag(name: str, stamps: list[int]) -> Path:
        pairs = zip(stamps, stored, strict=True)
        messages = [Message("sensor_msgs/msg/Image", fields, stamp, when) for stamp, when in pairs]
        return write_bag(tmp_path / name, {TOPIC: messages})

    expected = [when / 1e9 for when in stored]
    assert [frame.time for frame in find_one(bag("zero", [0] * 220)).frames] == expected
    back = bag("back", [when if i < 110 else when - 10**15 for i, when in enumerate(stored)])
    assert [frame.time for frame in find_one(back).frames] == expected
    assert f"{back}: the stamps on {TOPIC} jump; the times are those at which images were stored" in caplog.messages


@pytest.mark.parametrize("rate", [0.1, 1, 10, 100])
@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_a_clock_that_was_set_back_is_noticed_at_any_rate(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, storage: str, rate: float
) -> None:
    """Frames would be interleaved, and it does not matter how many there are before or after."""
    stored = [START + round(i * 10**9 / rate) for i in range(60)]
    stamps = [when - (round(20.3 * 10**9) if i >= 30 else 0) for i, when in enumerate(stored)]
    path = write_bag(tmp_path / ("run.bag" if storage == "ros1" else "run"), {"/c": shown_at(stamps, stored)}, storage)
    sequence = find_one(path)
    assert [frame.time for frame in sequence.frames] == [when / 1e9 for when in stored]
    assert f"{path}: the stamps on /c jump; the times are those at which images were stored" in caplog.messages
    assert all(map(np.array_equal, read_images(sequence), grays(pictures(60))))


def test_stamps_that_are_late_by_less_than_a_second_are_kept(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stored = [START + i * STEP for i in range(20)]
    stamps = [when - (9 * STEP if i == 15 else 0) + 7 for i, when in enumerate(stored)]
    path = write_bag(tmp_path / "run", {"/c": shown_at(stamps, stored)})
    assert [frame.time for frame in find_one(path).frames] == [when / 1e9 for when in sorted(stamps)]
    assert not [record for record in caplog.records if record.levelno == logging.WARNING]


@pytest.mark.parametrize(
    ("stamps", "reason"),
    [
        ([0, 0, 0, *(i * STEP for i in range(3, 20))], "are 0 in part"),
        ([0, 0, 0, *(START + i * STEP for i in range(3, 20))], "are 0 in part"),
        ([12 * 10**9 + i * STEP if i < 3 else START + i * STEP for i in range(20)], "are by two clocks"),
    ],
)
def test_two_clocks_are_never_mixed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, stamps: list[int], reason: str
) -> None:
    stored = [START + i * STEP + 5 for i in range(20)]
    path = write_bag(tmp_path / "run", {"/c": shown_at(stamps, stored)})
    assert [frame.time for frame in find_one(path).frames] == [when / 1e9 for when in stored]
    assert f"{path}: the stamps on /c {reason}; the times are those at which images were stored" in caplog.messages


def test_stamps_of_a_simulation_are_times(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stamps = [123 * 10**8 + i * STEP for i in range(20)]
    path = write_bag(tmp_path / "run", {"/c": shown_at(stamps, [START + i for i in range(20)])})
    assert [frame.time for frame in find_one(path).frames] == [when / 1e9 for when in stamps]
    assert not [record for record in caplog.records if record.levelno == logging.WARNING]


@pytest.mark.parametrize(
    ("storage", "name", "remedy"),
    [
        ("ros1", "short.bag", "mend it with `rosbag reindex`, or remove it"),
        ("sqlite3", "short.db3", "mend it with `ros2 bag reindex`, or remove it"),
        ("mcap", "short.mcap", "mend it with `mcap recover`, or remove it"),
    ],
)
def test_damaged_bags(tmp_path: Path, storage: str, name: str, remedy: str) -> None:
    path = write_bag(tmp_path / ("run.bag" if storage == "ros1" else "run"), {TOPIC: stream()}, storage)
    file = path if storage == "ros1" else next(file for file in path.iterdir() if file.suffix == Path(name).suffix)
    for share in (0.6, 0.01, 0.0):
        short = cut(file, share, name)
        said = failure(short)
        assert said.startswith(f"{short}: cannot be read as a bag (")
        assert said.endswith(f"; {remedy}")
        assert "\n" not in said
    text = tmp_path / name
    text.write_text("this is a text\n" * 100)
    assert failure(text).startswith(f"{text}: cannot be read as a bag (")


def test_what_a_bag_damaged_in_the_middle_still_gives(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    from rosbags.rosbag1 import Writer as Writer1

    path = tmp_path / "run.bag"
    write_bag(path, {TOPIC: stream(400)}, "ros1", set_compression=(Writer1.CompressionFormat.BZ2,))
    data = bytearray(path.read_bytes())
    # Within the second of four pieces, and not in its index.
    data[len(data) * 2 // 5 : len(data) // 2] = bytes(len(data) // 2 - len(data) * 2 // 5)
    path.write_bytes(bytes(data))
    sequence = find_one(path)
    count = len(sequence.frames)
    assert 0 < count < 400
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert len(said) == 1
    assert said[0].startswith(f"{path}: is damaged behind {count} images (")
    assert said[0].endswith("); the rest is not read")
    assert all(map(np.array_equal, read_images(sequence), grays(pictures(400))))


def test_a_bag_in_pieces_that_lacks_one(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "run", {TOPIC: stream(3)})
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    assert failure(path).startswith(f"{path}: cannot be read as a bag (Could not load YAML")
    (path / "metadata.yaml").write_text(text.replace("run.mcap", "lost.mcap"))
    assert "lost.mcap" in failure(path)
    (path / "metadata.yaml").unlink()
    # Without it the folder is one of recordings.
    assert [frame.path for frame in find_one(path).frames] == [path / "run.mcap"] * 3


def test_a_message_that_cannot_be_parsed_is_named(tmp_path: Path) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "run", version=9) as writer:
        link = writer.add_connection(TOPIC, "sensor_msgs/msg/Image", typestore=store)
        for data in (b"", b"\0\1\0\0", bytes(30), b"\xff" * 100):
            writer.write(link, START, data)
    levels = read_images(find_one(tmp_path / "run"))
    assert [f"frame 00000{i} of {TOPIC}" in str(gray) for i, gray in enumerate(levels)] == [True] * 4


def test_bags_in_folders(tmp_path: Path) -> None:
    write_bag(tmp_path / "runs/b", {TOPIC: stream(3)})
    write_bag(tmp_path / "runs/a.bag", {TOPIC: stream(3)}, "ros1")
    shutil.copy(tmp_path / "runs/b/b.mcap", tmp_path / "runs/c.mcap")
    assert [sequence.name for sequence in find_sequences([tmp_path / "runs"])] == ["a", "b", "c"]


def test_without_rosbags_it_is_said_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_bag(tmp_path / "run", {TOPIC: stream(3)})
    for name in [name for name in sys.modules if name.startswith("rosbags")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingExtraError, match=r"needs the package rosbags.* -m pip install rosbags mcap"):
        find_one(path)
