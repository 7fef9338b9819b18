"""Every row of the tables of layouts and encodings in docs/inputs.md is made here, and read as the row says."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.recordings import grays, pictures, raw

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences, read_gray
from placerec.frames.ros_image import RAW, image_of
from placerec.frames.sequence import gray_levels

PAGE = (Path(__file__).parents[2] / "docs/inputs.md").read_text(encoding="utf-8")
NUMBERED = [f"{i:06d}.png" for i in range(3)]
STAMPS = [1305031102.25, 1305031102.75, 1305031103.25]
STEPS = [0, 0.5, 1]


def rows(heading: str) -> list[list[str]]:
    """The cells of the first table behind a heading."""
    table = re.search(rf"^## {heading}\n.*?\n\|---.*?\n(.*?)\n\n", PAGE, re.M | re.S)
    assert table
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[1].splitlines()]


def lay(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).touch()


def stamped(form: str, unit: int = 1) -> list[str]:
    return [form.format(t if unit == 1 else int(4 * t) * unit // 4) for t in STAMPS]


def cold(root: Path) -> None:
    names = stamped("t{:.6f}_x1_y2_a3.jpeg")
    lay(root / "run/std_cam", names)
    (root / "run/places.lst").write_text("".join(f"{name} hall\n" for name in names))


def idol(root: Path) -> None:
    lay(root / "run/png", stamped("t{:.6f}_rPA_x1_y2_a3.png"))


def vpc(root: Path) -> None:
    lay(root / "Home1/1", [f"{i:08d}.jpg" for i in (1, 2, 3)])
    (root / "Home1/label.txt").write_text("1/\n3\n1 3 hall\n-1 -1 end\n")


def tum(root: Path) -> None:
    lay(root / "run/rgb", NUMBERED)
    lay(root / "run/depth", NUMBERED)
    lines = [f"{t} rgb/{name}\n" for t, name in zip(STAMPS, NUMBERED, strict=True)]
    (root / "run/rgb.txt").write_text("# timestamp filename\n" + "".join(lines))


def kitti(root: Path) -> None:
    for camera in range(4):
        lay(root / f"run/image_{camera}", NUMBERED)
    (root / "run/times.txt").write_text("".join(f"{t:e}\n" for t in STEPS))


def kitti_raw(root: Path) -> None:
    for camera in range(4):
        lay(root / f"run/image_0{camera}/data", NUMBERED)
        lines = [f"2011-09-26 13:02:2{int(t)}.{int(10 * t) % 10}00000000\n" for t in STEPS]
        (root / f"run/image_0{camera}/timestamps.txt").write_text("".join(lines))


def euroc(root: Path) -> None:
    for camera in ("cam0", "cam1"):
        names = stamped("{}.png", 10**9)
        lay(root / f"run/mav0/{camera}/data", names)
        lines = [f"{name[:-4]},{name}\n" for name in names]
        (root / f"run/mav0/{camera}/data.csv").write_text("#timestamp [ns],filename\n" + "".join(lines))


def nclt(root: Path) -> None:
    for camera in range(6):
        lay(root / f"run/lb3/Cam{camera}", stamped("{}.tiff", 10**6))


def robotcar(root: Path) -> None:
    for camera in ("mono_left", "mono_rear", "stereo/left", "stereo/centre", "stereo/right"):
        lay(root / "run" / camera, stamped("{}.png", 10**6))


def seven_scenes(root: Path) -> None:
    lay(root / "run", [f"frame-{i:06d}.{kind}.png" for i in range(3) for kind in ("color", "depth")])


def image_folder(root: Path) -> None:
    for split in ("train", "val", "test"):
        place_folders(root / split)


def place_folders(root: Path) -> None:
    for place in ("hall", "office"):
        lay(root / place, NUMBERED)


# What makes a layout, and the folder of its images.
LAYOUTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "COLD": (cold, "std_cam"),
    "KTH-IDOL2": (idol, "png"),
    "VPC 2009": (vpc, "1"),
    "TUM RGB-D": (tum, "rgb"),
    "KITTI odometry": (kitti, "image_2"),
    "KITTI raw": (kitti_raw, "data"),
    "EuRoC": (euroc, "data"),
    "NCLT": (nclt, "Cam5"),
    "RobotCar": (robotcar, "left"),
    "7-Scenes": (seven_scenes, "run"),
    "ImageFolder": (image_folder, ""),
    "folder per place": (place_folders, ""),
}


@pytest.mark.parametrize("row", rows("Layouts"), ids=lambda row: str(row[0]))
def test_layouts(tmp_path: Path, row: list[str]) -> None:
    name, _, images, times, places = row
    make, folder = LAYOUTS[name]
    make(tmp_path / "data")
    if places == "intervals":
        (tmp_path / "data/run.labels").write_text("0 9 hall\n")
    options = SourceOptions(rate=2, label_clock="start")
    found: list[Sequence] = find_sequences([tmp_path / "data"], options=options)
    whole = {"ImageFolder": 6, "folder per place": 2}.get(name, 1)
    assert len(found) == whole
    for sequence in found:
        assert len(sequence.frames) == 3
        assert {frame.path.parent.name for frame in sequence.frames} == {folder or sequence.source.name}
        assert [round(frame.time - sequence.frames[0].time, 5) for frame in sequence.frames] == STEPS
        assert (sequence.frames[0].time == 0) == ("--rate" in times or name == "KITTI odometry")
    named = {frame.place for sequence in found for frame in sequence.frames}
    assert named == {
        "ImageFolder": {"hall", "office"},
        "folder per place": {"hall", "office"},
        "KTH-IDOL2": {"PA"},
    }.get(name, {"hall"})
    if "*" in images:
        assert all(Path(frame.name).match(images.strip("`")) for frame in found[0].frames)


def test_every_layout_has_a_row() -> None:
    assert [row[0] for row in rows("Layouts")] == list(LAYOUTS)


def cells(where: str, through: str) -> list[str]:
    """The encodings that the page names for a kind of input."""
    text = ", ".join(row[1] for row in rows("Encodings") if row[0] == where and row[2] == through)
    return re.split(r", | and ", text)


def test_encodings_of_files(tmp_path: Path) -> None:
    (gray,) = grays(pictures(1))
    kinds = ", ".join(cells("files", "OpenCV")).partition(";")[0].split(", ")
    assert kinds == ["JPEG", "PNG", "BMP", "WebP", "TIFF", "PGM", "PPM"]
    for kind in kinds:
        path = tmp_path / f"a.{kind.lower()}"
        picture = cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR) if kind == "PPM" else gray
        assert cv2.imwrite(str(path), picture)
        assert np.abs(read_gray(path).astype(float) - gray).mean() < 4
    assert len(find_sequences([tmp_path])[0].frames) == len(kinds)


@pytest.mark.parametrize(
    "encoding", [name for name in cells("`sensor_msgs/Image`", "rosbags") if not name.startswith("bayer")]
)
def test_encodings_of_raw_messages(encoding: str) -> None:
    (colour,), (gray,) = pictures(1), grays(pictures(1))
    deep = gray.astype(np.uint16) * 257
    packed = np.full((*gray.shape, 2), 128, np.uint8)
    packed[..., 1 if encoding in ("yuv422", "uyvy") else 0] = gray
    planes = {"data": np.concatenate([gray.reshape(-1), np.full(gray.size // 2, 128, np.uint8)])}
    opaque = cv2.cvtColor(colour, cv2.COLOR_BGR2BGRA)
    shown: Any = {
        **dict.fromkeys(("mono8", "8UC1", "nv12", "nv21", "yuv420", "i420", "yv12"), gray),
        **dict.fromkeys(("yuv422", "uyvy", "yuv422_yuy2", "yuyv"), packed),
        **dict.fromkeys(("mono16", "16UC1"), deep),
        **{name: cv2.cvtColor(deep, cv2.COLOR_GRAY2BGR) for name in ("rgb16", "bgr16")},
        "rgb8": colour[..., ::-1],
        "rgba8": opaque[..., [2, 1, 0, 3]],
        **dict.fromkeys(("bgr8", "8UC3"), colour),
        **dict.fromkeys(("bgra8", "8UC4"), opaque),
        "32FC1": gray.astype(np.float32) / 255,
    }[encoding]
    fields: dict[str, Any] = planes if encoding in ("nv12", "nv21", "yuv420", "i420", "yv12") else {}
    message = SimpleNamespace(**raw(shown, encoding, **fields).fields)
    assert np.allclose(gray_levels(image_of(message, RAW, "it")), gray, atol=0.02)


@pytest.mark.parametrize(
    "encoding", [name for name in cells("`sensor_msgs/Image`", "rosbags") if name.startswith("bayer")]
)
def test_encodings_of_bayer(encoding: str) -> None:
    level = 100 if encoding.endswith("8") else 100 * 257
    even = np.full((16, 16), level, np.uint8 if encoding.endswith("8") else np.uint16)
    message = SimpleNamespace(**raw(even, encoding).fields)
    bright = gray_levels(image_of(message, RAW, "it"))
    assert bright.shape == (16, 16)
    assert len(np.unique(bright)) == 1


# What is not read: the suffix by which a folder leaves it out, and how its files begin, where others are told by it.
UNREAD = {
    "HEIC": (".heic", b"\0\0\0\x18ftypheic"),
    "AVIF": (".avif", b"\0\0\0\x1cftypavif"),
    "JPEG XL": (".jxl", b"\0\0\0\x0cJXL \r\n\x87\n"),
    "JPEG 2000": (".jp2", b""),
    "raw photographs": (".dng", b""),
}


@pytest.mark.parametrize("kind", UNREAD)
def test_encodings_that_are_not_read_are_told(tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture) -> None:
    suffix, start = UNREAD[kind]
    lay(tmp_path / "run", [*NUMBERED, f"a{suffix}"])
    (sequence,) = find_sequences([tmp_path / "run"])
    assert len(sequence.frames) == 3
    assert f"{tmp_path / 'run'}: not read: 1 *{suffix}; convert them to JPEG" in caplog.text
    if start:
        (tmp_path / "a.jpg").write_bytes(start + bytes(50))
        with pytest.raises(SourceError, match=f"is {kind}, which is not read; convert it to JPEG"):
            read_gray(tmp_path / "a.jpg")


def test_all_that_is_not_read_is_tried() -> None:
    where, listed, _ = rows("Encodings")[-1]
    assert where == "not read"
    assert re.split("[,;] ", listed) == [*UNREAD, "Flatbuffers"]
    # Which is made by another test.
    assert '"flatbuffer"' in (Path(__file__).parent / "test_mcap.py").read_text(encoding="utf-8")


# Tests in other files that make the rest of the rows.
ELSEWHERE = {
    "H.264": ("test_video.py", '("run.mp4", "libx264")'),
    "HEVC": ("test_video.py", '("run.mkv", "libx265")'),
    "AV1": ("test_av_video.py", "def test_av1("),
    "VP8": ("test_video.py", '"VP80"'),
    "VP9": ("test_video.py", '("run.webm", "libvpx-vp9")'),
    "MPEG-4": ("test_video.py", '"mp4v"'),
    "MPEG-2": ("test_video.py", '"MPG2"'),
    "Motion JPEG": ("test_video.py", '"MJPG"'),
    "HEVC without a container": ("test_video.py", '"run.265"'),
    "MPEG-TS": ("test_video.py", '"run.ts"'),
    "moving GIF": ("test_video.py", '"run.gif"'),
    "JPEG": ("test_bag.py", "def test_compressed_images_have_the_levels_of_their_files("),
    "PNG": ("test_bag.py", '".png"'),
    "compressedDepth (if it is named)": ("test_bag.py", "def test_compressed_depth_is_read_only_if_it_is_named("),
    "h264": ("test_av_video.py", '"h264"'),
    "hevc": ("test_av_video.py", '"hevc"'),
    "av1": ("test_av_video.py", '"AV1"'),
    "vp8": ("test_av_video.py", '"vp8"'),
    "vp9": ("test_av_video.py", '"vp9"'),
    "JSON": ("test_mcap.py", "def test_foxglove_in_json("),
    "protobuf": ("test_mcap.py", "def test_foxglove_in_protobuf("),
}


def test_the_other_encodings_are_made_by_other_tests() -> None:
    wanted = {
        encoding
        for where, text, through in rows("Encodings")
        if where not in ("files", "`sensor_msgs/Image`", "not read")
        for encoding in re.split(r", | and ", text)
    }
    assert wanted == set(ELSEWHERE)
    for file, words in ELSEWHERE.values():
        assert words in (Path(__file__).parent / file).read_text(encoding="utf-8"), (file, words)
