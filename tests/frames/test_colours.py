"""Images in colours from every kind of source, with the very grey levels that are read where nobody wants colours."""

import base64
import json
import zlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.image_files import chunk, encode
from helpers.network_camera import network_camera
from helpers.recordings import (
    START,
    STEP,
    Message,
    compressed,
    find_one,
    jpeg,
    pictures,
    raw,
    read_in_colours,
    write_bag,
    write_video,
)
from numpy.typing import NDArray
from test_av_video import encoded, pieces, stream, turned
from test_mcap import write
from test_video import KINDS

from placerec.errors import SourceError
from placerec.frames import find_sequences, images_at, read_gray
from placerec.frames.av_video import AvVideo
from placerec.frames.camera import Camera
from placerec.frames.image import read_image
from placerec.frames.images import batches, with_images
from placerec.frames.ros_image import RAW, image_of
from placerec.frames.sequence import ColourImage

SHOWN = pictures(6)
GRAY = cv2.cvtColor(SHOWN[0], cv2.COLOR_BGR2GRAY)


def read(path: Path) -> NDArray[np.uint8]:
    """The colours of an image file, whose grey levels are those that are read alone."""
    image = read_image(path, colours=True)
    assert isinstance(image, ColourImage)
    gray = read_image(path)
    assert isinstance(gray, np.ndarray)
    assert (image.gray.dtype, image.gray.tobytes()) == (gray.dtype, gray.tobytes())
    assert (str(image.colours.dtype), image.colours.shape) == ("uint8", (*gray.shape, 3))
    return image.colours


def opened(path: Path, flags: int) -> NDArray[Any]:
    """The pixels that OpenCV reads."""
    pixels = cv2.imread(str(path), flags)
    assert pixels is not None
    return pixels


def off(found: NDArray[Any], expected: NDArray[Any]) -> float:
    assert found.shape == expected.shape
    return float(np.abs(found.astype(float) - expected).mean())


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".ppm"])
def test_files_without_loss(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"a{suffix}").write_bytes(encode(suffix, SHOWN[0]))
    assert np.array_equal(read(tmp_path / f"a{suffix}"), SHOWN[0])


@pytest.mark.parametrize("suffix", [".jpg", ".webp"])
def test_files_with_loss(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(encode(suffix, SHOWN[0]))
    found = read(path)
    assert np.array_equal(found, opened(path, cv2.IMREAD_COLOR))
    assert off(found, SHOWN[0]) < 12


def test_grey_levels_are_not_made_of_the_colours_of_a_jpeg(tmp_path: Path) -> None:
    bright = np.random.default_rng(0).integers(0, 2, (48, 64, 3), np.uint8) * np.uint8(255)
    (tmp_path / "a.jpg").write_bytes(jpeg(bright))
    made = cv2.cvtColor(read(tmp_path / "a.jpg"), cv2.COLOR_BGR2GRAY)
    assert not np.array_equal(made, read_gray(tmp_path / "a.jpg"))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".pgm"])
def test_files_of_grey_levels_alone_have_three_equal_channels(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(encode(suffix, GRAY))
    found = read(path)
    assert all(np.array_equal(found[..., channel], read_gray(path)) for channel in range(3))


def test_alpha_is_ignored_and_a_palette_is_looked_up(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(encode(".png", np.dstack([SHOWN[0], GRAY])))
    assert np.array_equal(read(tmp_path / "a.png"), SHOWN[0])
    header = chunk(b"IHDR", bytes([0, 0, 0, 8, 0, 0, 0, 9, 8, 3, 0, 0, 0]))
    palette = chunk(b"PLTE", bytes([0, 0, 0, 255, 0, 0, 0, 0, 255]))
    rows = chunk(b"IDAT", zlib.compress(b"".join(b"\0" + bytes([0, 1, 2, 0, 1, 2, 0, 1]) for _ in range(9))))
    (tmp_path / "b.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header + palette + rows + chunk(b"IEND", b""))
    assert read(tmp_path / "b.png")[4, :3].tolist() == [[0, 0, 0], [0, 0, 255], [255, 0, 0]]


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_what_exif_says_turns_the_colours_too(tmp_path: Path, orientation: int) -> None:
    exif = b"II*\0\x08\0\0\0\x01\0" + bytes([0x12, 1, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0])
    data = encode(".png", SHOWN[0])
    (tmp_path / "a.png").write_bytes(data[:33] + chunk(b"eXIf", exif + bytes(4)) + data[33:])
    turns = {3: 2, 6: 3, 8: 1}[orientation]
    assert np.array_equal(read(tmp_path / "a.png"), np.rot90(SHOWN[0], turns))


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("depth", [12, 16])
def test_sixteen_bits_are_scaled_by_the_depth_in_use(tmp_path: Path, suffix: str, depth: int) -> None:
    top = (1 << depth) - 1
    deep = np.rint(SHOWN[0] / 255 * top).astype(np.uint16)
    deep[0, 0] = top
    (tmp_path / f"a{suffix}").write_bytes(encode(suffix, deep))
    assert np.array_equal(read(tmp_path / f"a{suffix}"), np.rint(deep / top * 255))


def test_a_damaged_file_is_refused_as_it_is_in_grey(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(jpeg(SHOWN[0])[:-300])
    for colours in (False, True):
        with pytest.raises(SourceError, match="JPEG is truncated or damaged"):
            read_image(path, colours=colours)


def test_a_folder_of_images(tmp_path: Path) -> None:
    for i, picture in enumerate(SHOWN):
        cv2.imwrite(str(tmp_path / f"{i}.png"), picture)
    (tmp_path / "3.png").write_bytes(b"no picture")
    (sequence,) = find_sequences([tmp_path])
    found = list(images_at(sequence, [0, 3, 5], colours=True))
    assert [type(image) for image in found] == [ColourImage, str, ColourImage]
    (listed,) = batches([sequence], colours=True)
    assert listed[1].images is None


@pytest.mark.parametrize(("name", "codec"), KINDS)
def test_videos(tmp_path: Path, name: str, codec: str) -> None:
    path = write_video(tmp_path / name, codec)
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    found = read_in_colours(find_one(path))
    assert all(np.array_equal(image.colours, capture.read()[1]) for image in found)
    assert np.array_equal(read_in_colours(find_one(path, every=4), 1)[0].colours, found[4].colours)


def test_a_turned_video(tmp_path: Path) -> None:
    upright = read_in_colours(find_one(write_video(tmp_path / "a.mp4")))
    for image, before in zip(read_in_colours(find_one(turned(write_video(tmp_path / "b.mp4")))), upright, strict=True):
        assert np.array_equal(image.colours, np.rot90(before.colours, -1))


def test_videos_through_pyav(tmp_path: Path) -> None:
    path = turned(encoded(tmp_path / "c.mp4", "libsvtav1"))
    sequence = find_one(path)
    assert isinstance(sequence.recording, AvVideo)
    for image, shown in zip(read_in_colours(sequence), pictures(), strict=True):
        assert off(image.colours, np.rot90(shown, -1)) < 12


@pytest.mark.parametrize("storage", ["ros1", "sqlite3", "mcap"])
def test_bags(tmp_path: Path, storage: str) -> None:
    files = [compressed(jpeg(picture), START + i * STEP) for i, picture in enumerate(SHOWN)]
    raws = [raw(picture, "bgr8", START + i * STEP) for i, picture in enumerate(SHOWN)]
    path = tmp_path / ("run.bag" if storage == "ros1" else "run")
    write_bag(path, {"/raw": raws, "/compressed": files}, storage)
    found = read_in_colours(find_one(path, topic="/raw"))
    assert all(np.array_equal(image.colours, shown) for image, shown in zip(found, SHOWN, strict=True))
    for image, shown in zip(read_in_colours(find_one(path, topic="/compressed")), SHOWN, strict=True):
        (tmp_path / "one.jpg").write_bytes(jpeg(shown))
        assert np.array_equal(image.colours, opened(tmp_path / "one.jpg", cv2.IMREAD_COLOR))


def test_videos_in_the_messages_of_a_bag(tmp_path: Path) -> None:
    messages: list[Message] = stream(pieces("libx264", tune="zerolatency"), "h264")
    path = write_bag(tmp_path / "run", {"/v": messages})
    for image, shown in zip(read_in_colours(find_one(path)), pictures(), strict=True):
        assert off(image.colours, shown) < 20


def test_mcap_of_foxglove(tmp_path: Path) -> None:
    def made(i: int) -> bytes:
        seconds, rest = divmod(START + i * STEP, 10**9)
        stamp = {"sec": seconds, "nsec": rest}
        data = base64.b64encode(SHOWN[i].tobytes()).decode()
        shape = {"width": 64, "height": 48, "encoding": "bgr8", "step": 192}
        return json.dumps({"timestamp": stamp, "frame_id": "", "data": data, **shape}).encode()

    schema = ("foxglove.RawImage", "jsonschema", b"{}")
    path = write(tmp_path / "run.mcap", "", schema, "json", [made(i) for i in range(6)])
    found = read_in_colours(find_one(path))
    assert all(np.array_equal(image.colours, shown) for image, shown in zip(found, SHOWN, strict=True))


def test_a_camera(tmp_path: Path) -> None:
    sent = [jpeg(picture) for picture in SHOWN]
    with network_camera(sent) as address:
        found = [image for _, image in Camera(address).frames(colours=True)]
    with network_camera(sent) as address:
        grays = [image for _, image in Camera(address).frames()]
    assert len(found) == len(grays) == 6
    for image, gray, shown in zip(found, grays, SHOWN, strict=True):
        assert isinstance(image, ColourImage)
        assert isinstance(gray, np.ndarray)
        assert np.array_equal(image.gray, gray)
        assert off(image.colours, shown) < 15


def test_batches_of_a_recording_carry_the_colours(tmp_path: Path) -> None:
    sequence = find_one(write_video(tmp_path / "run.mp4"))
    listed = batches([sequence], colours=True)
    (batch,) = with_images(listed, lambda image: image, colours=True)
    assert batch.images is not None
    assert [type(image) for image in batch.images] == [ColourImage] * 20


def message(picture: NDArray[Any], encoding: str, **fields: Any) -> ColourImage:
    """A raw message in colours, whose grey levels are those that are read alone."""
    made = SimpleNamespace(**raw(picture, encoding, **fields).fields)
    image, gray = image_of(made, RAW, "it", colours=True), image_of(made, RAW, "it")
    assert isinstance(image, ColourImage)
    assert isinstance(gray, np.ndarray)
    assert (image.gray.dtype, image.gray.tobytes()) == (gray.dtype, gray.tobytes())
    assert (str(image.colours.dtype), image.colours.shape) == ("uint8", (*gray.shape, 3))
    return image


def test_raw_messages() -> None:
    opaque = cv2.cvtColor(SHOWN[0], cv2.COLOR_BGR2BGRA)
    for encoding, picture in (
        ("bgr8", SHOWN[0]),
        ("8UC3", SHOWN[0]),
        ("rgb8", SHOWN[0][..., ::-1]),
        ("bgra8", opaque),
        ("8UC4", opaque),
        ("rgba8", opaque[..., [2, 1, 0, 3]]),
        ("bgr16", SHOWN[0].astype(np.uint16) * 257),
        ("rgb16", SHOWN[0][..., ::-1].astype(np.uint16) * 257),
    ):
        assert off(message(picture, encoding).colours, SHOWN[0]) < 0.6, encoding
    grays = np.dstack([GRAY] * 3)
    assert np.array_equal(message(GRAY, "mono8").colours, grays)
    assert off(message(GRAY.astype(np.uint16) * 257, "mono16").colours, grays) < 0.6
    assert off(message(GRAY.astype(np.float32) / 255, "32FC1").colours, grays) < 0.6


@pytest.mark.parametrize(("encoding", "luma"), [("yuv422", 1), ("uyvy", 1), ("yuv422_yuy2", 0), ("yuyv", 0)])
def test_colours_of_packed_yuv(encoding: str, luma: int) -> None:
    blue = np.empty((8, 8, 2), np.uint8)
    blue[..., luma], blue[:, ::2, 1 - luma], blue[:, 1::2, 1 - luma] = 60, 220, 110
    assert message(blue, encoding).colours[4, 4].argmax() == 0
    red = blue.copy()
    red[:, ::2, 1 - luma], red[:, 1::2, 1 - luma] = 110, 220
    assert message(red, encoding).colours[4, 4].argmax() == 2


@pytest.mark.parametrize("encoding", ["nv12", "nv21", "yuv420", "i420", "yv12"])
@pytest.mark.parametrize("padding", [0, 16])
def test_colours_of_planes(encoding: str, padding: int) -> None:
    yuv = cv2.cvtColor(SHOWN[0], cv2.COLOR_BGR2YUV_I420)
    levels, first, second = yuv[:48], yuv[48:60].reshape(24, 32), yuv[60:].reshape(24, 32)
    if encoding in ("nv21", "yv12"):
        first, second = second, first
    step = 64 + padding
    data = np.zeros(48 * step * 3 // 2, np.uint8)
    data[: 48 * step].reshape(48, step)[:, :64] = levels
    behind = data[48 * step :]
    if encoding.startswith("nv"):
        behind.reshape(24, step)[:, :64] = np.dstack([first, second]).reshape(24, 64)
    else:
        behind.reshape(48, step // 2)[:, :32] = np.concatenate([first, second])
    shown = message(levels, encoding, step=step, data=data).colours
    assert off(shown, cv2.cvtColor(yuv, cv2.COLOR_YUV2BGR_I420)) == 0
    assert off(shown, SHOWN[0]) < 8


def test_planes_without_colours_are_damaged_where_colours_are_wanted() -> None:
    levels = GRAY[:45]
    odd = SimpleNamespace(**raw(levels, "nv12", data=np.resize(levels, 45 * 64 * 3 // 2)).fields)
    gray = image_of(odd, RAW, "it")
    assert isinstance(gray, np.ndarray)
    assert np.array_equal(gray, levels)
    with pytest.raises(SourceError, match="it is damaged: 64x45 pixels in rows of 64 bytes have no whole colours"):
        image_of(odd, RAW, "it", colours=True)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_colours_of_bayer(pattern: str) -> None:
    for colour, channel in (("R", 2), ("G", 1), ("B", 0)):
        tile = np.array([200 if letter == colour else 0 for letter in pattern.upper()], np.uint8).reshape(2, 2)
        seen = np.tile(tile, (8, 8))
        expected = np.zeros(3)
        expected[channel] = 200
        assert np.allclose(message(seen, f"bayer_{pattern}8").colours[2:-2, 2:-2], expected, atol=1)
        deep = message(seen.astype(np.uint16) * 257, f"bayer_{pattern}16").colours
        assert (deep[2:-2, 2:-2].argmax(axis=2) == channel).all()
