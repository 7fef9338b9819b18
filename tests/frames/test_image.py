"""Every kind of image that is read, and every kind of damage that is named; nothing is written to stderr."""

import os
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.image_files import chunk, encode

from placerec.errors import SourceError
from placerec.frames import read_gray
from placerec.frames.image import opencv_log

GRAY = cv2.resize(np.random.default_rng(1).integers(0, 256, (6, 8), np.uint8), (64, 48), interpolation=cv2.INTER_CUBIC)
COLOUR = np.dstack([GRAY, GRAY[::-1], GRAY[:, ::-1]])


@pytest.fixture(autouse=True)
def _silence(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """The codecs write to the descriptor, past sys.stderr."""
    yield
    out, err = capfd.readouterr()
    # Of a PNG that has nothing but an end OpenCV 4 says this.
    assert (out, err.replace("libpng error: IEND: out of place\n", "")) == ("", "")


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def failure(path: Path) -> str:
    with pytest.raises(SourceError) as error:
        read_gray(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


def exif(orientation: int) -> bytes:
    return b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHIHHI", 0x112, 3, 1, orientation, 0, 0)


def segment(marker: int, data: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".pgm", ".ppm"])
def test_lossless_formats(tmp_path: Path, suffix: str) -> None:
    pixels = COLOUR if suffix == ".ppm" else GRAY
    image = read_gray(write(tmp_path / f"a{suffix}", encode(suffix, pixels)))
    assert image.dtype == np.uint8
    if suffix == ".ppm":
        luma = COLOUR @ np.array([0.114, 0.587, 0.299])
        assert np.abs(image - luma).max() <= 1
    else:
        np.testing.assert_array_equal(image, GRAY)


@pytest.mark.parametrize("suffix", [".jpg", ".webp"])
def test_lossy_formats(tmp_path: Path, suffix: str) -> None:
    image = read_gray(write(tmp_path / f"a{suffix}", encode(suffix, GRAY)))
    assert image.shape == GRAY.shape
    assert np.abs(image.astype(float) - GRAY).mean() < 5


def test_the_path_is_opencvs_gray(tmp_path: Path) -> None:
    path = write(tmp_path / "a.jpeg", encode(".jpg", COLOUR))
    np.testing.assert_array_equal(read_gray(path), cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))


def test_a_path_may_be_a_string(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((8, 9), 7, np.uint8))
    np.testing.assert_array_equal(read_gray(str(tmp_path / "a.png")), read_gray(tmp_path / "a.png"))


def test_suffix_does_not_matter(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read_gray(write(tmp_path / "a.jpeg", encode(".png", GRAY))), GRAY)


@pytest.mark.parametrize("scale", [1, 257])
def test_alpha_is_ignored(tmp_path: Path, scale: int) -> None:
    colour = COLOUR * np.uint16(scale) if scale > 1 else COLOUR
    alpha = np.dstack([colour, colour[..., 2]])
    plain = read_gray(write(tmp_path / "a.png", encode(".png", colour)))
    np.testing.assert_array_equal(read_gray(write(tmp_path / "b.png", encode(".png", alpha))), plain)


def test_gray_with_alpha(tmp_path: Path) -> None:
    pixels = np.full((10, 9, 2), (200, 0), np.uint8)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    header = struct.pack(">IIBBBBB", 9, 10, 8, 4, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    np.testing.assert_array_equal(read_gray(write(tmp_path / "a.png", data)), np.full((10, 9), 200))


def png(depth: int, kind: int, rows: list[bytes], *between: bytes) -> bytes:
    """A PNG 8 pixels wide."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 8, len(rows), depth, kind, 0, 0, 0))
    data = chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows)))
    return b"\x89PNG\r\n\x1a\n" + header + b"".join(between) + data + chunk(b"IEND", b"")


def test_palette(tmp_path: Path) -> None:
    colours = bytes([0, 0, 0, 255, 0, 0, 0, 0, 255])
    image = read_gray(
        write(tmp_path / "a.png", png(8, 3, [bytes([0, 1, 2, 0, 1, 2, 0, 1])] * 9, chunk(b"PLTE", colours)))
    )
    assert np.abs(image.astype(int) - [0, 76, 29, 0, 76, 29, 0, 76]).max() <= 1


def test_one_bit(tmp_path: Path) -> None:
    image = read_gray(write(tmp_path / "a.png", png(1, 0, [b"\xa1"] * 8)))
    np.testing.assert_array_equal(image, [[255, 0, 255, 0, 0, 0, 0, 255]] * 8)


def test_the_first_picture_of_a_gif(tmp_path: Path) -> None:
    if not cv2.haveImageWriter("a.gif"):
        pytest.skip("this OpenCV writes no GIF")
    pixels = np.zeros((9, 8, 3), np.uint8)
    pixels[:4] = 255
    image = read_gray(write(tmp_path / "a.gif", encode(".gif", pixels)))
    assert np.abs(image.astype(int) - pixels[..., 0]).max() < 60  # its writer dithers


def test_cmyk_jpeg(tmp_path: Path) -> None:
    # 16 x 8 pixels, the left half (200, 40, 90) in RGB, the right (20, 180, 220).
    data = bytes.fromhex(
        "ffd8ffee000e41646f626500640000000000ffdb0043000302020302020303030304030304050805050404050a070706080c0a0c0c0b0a"
        "0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffc000140800080010044311004d11005911004b1100ff"
        "c40017000101010100000000000000000000000009080007ffc40014100100000000000000000000000000000000ffda000e0443004d00"
        "59004b00003f00b010a38d15303e5d8ad33fffd9"
    )
    image = read_gray(write(tmp_path / "a.jpeg", data)).astype(int)
    assert np.abs(image[:, :8] - 94).max() <= 2
    assert np.abs(image[:, 8:] - 137).max() <= 2


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_sixteen_bits_of_any_depth(tmp_path: Path, suffix: str, bits: int) -> None:
    top = 2**bits - 1
    pixels = np.round(GRAY * (top / 255)).astype(np.uint16)
    pixels[0, 0] = top
    image = read_gray(write(tmp_path / f"a{suffix}", encode(suffix, pixels)))
    assert image.dtype == np.float32
    np.testing.assert_allclose(image, pixels * (255 / top), rtol=1e-6)
    assert image.max() == 255


@pytest.mark.parametrize(("peak", "top"), [(255, 255), (256, 1023), (1023, 1023), (1024, 4095), (16384, 65535)])
def test_depth_is_the_least_that_holds_the_peak(tmp_path: Path, peak: int, top: int) -> None:
    image = read_gray(write(tmp_path / "a.png", encode(".png", np.full((8, 8), peak, np.uint16))))
    np.testing.assert_allclose(image, peak * 255 / top, rtol=1e-6)


def test_sixteen_bits_of_black(tmp_path: Path) -> None:
    image = read_gray(write(tmp_path / "a.png", encode(".png", np.zeros((8, 8), np.uint16))))
    np.testing.assert_array_equal(image, np.zeros((8, 8)))


@pytest.mark.parametrize("kind", ["jpeg", "png"])
def test_orientation_is_applied(tmp_path: Path, kind: str) -> None:
    data = encode(".jpg" if kind == "jpeg" else ".png", GRAY)
    if kind == "jpeg":
        turned = data[:2] + segment(0xE1, b"Exif\0\0" + exif(6)) + data[2:]
    else:
        turned = data[:33] + chunk(b"eXIf", exif(6)) + data[33:]
    plain = read_gray(write(tmp_path / "a", data))
    np.testing.assert_array_equal(read_gray(write(tmp_path / "b", turned)), np.rot90(plain, -1))


@pytest.mark.parametrize(
    "tag", [chunk(b"gAMA", struct.pack(">I", 45455)), chunk(b"sRGB", b"\0"), chunk(b"iCCP", b"x\0\0?")]
)
def test_colour_tags_of_png_change_nothing(tmp_path: Path, tag: bytes) -> None:
    data = encode(".png", COLOUR)
    plain = read_gray(write(tmp_path / "a.png", data))
    np.testing.assert_array_equal(read_gray(write(tmp_path / "b.png", data[:33] + tag + data[33:])), plain)


@pytest.mark.parametrize("trailer", [b"\0" * 4096, b"\xff" * 16, b"\r\n", b"\xff\xd8\xff\xe1 a second picture"])
def test_jpeg_may_be_padded(tmp_path: Path, trailer: bytes) -> None:
    data = encode(".jpg", COLOUR)
    plain = read_gray(write(tmp_path / "a.jpg", data))
    np.testing.assert_array_equal(read_gray(write(tmp_path / "b.jpg", data + trailer)), plain)


@pytest.mark.parametrize("options", [(cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 2)])
def test_jpeg_of_several_scans_and_restarts(tmp_path: Path, options: tuple[int, int]) -> None:
    data = encode(".jpg", COLOUR, *options)
    assert data.count(b"\xff\xda") > 1 or b"\xff\xd0" in data
    assert read_gray(write(tmp_path / "a.jpg", data)).shape == GRAY.shape
    assert "truncated" in failure(write(tmp_path / "b.jpg", data[:-2]))


def test_jpeg_with_filling_or_garbage_before_a_marker(tmp_path: Path) -> None:
    data = encode(".jpg", COLOUR)
    plain = read_gray(write(tmp_path / "a.jpg", data))
    np.testing.assert_array_equal(read_gray(write(tmp_path / "b.jpg", data[:2] + b"\xff\xff\xff" + data[2:])), plain)
    table = data.index(b"\xff\xdb")
    message = failure(write(tmp_path / "c.jpg", data[:table] + bytes(7) + data[table:]))
    assert message == "JPEG is truncated or damaged (no end marker); copy it again or remove it"


def test_truncated_jpeg_of_any_length(tmp_path: Path) -> None:
    data = encode(".jpg", COLOUR)
    thumbnail = data[:2] + segment(0xE1, b"Exif\0\0" + encode(".jpg", GRAY)) + data[2:]
    for whole in (data, thumbnail):
        for length in range(4, len(whole) - 1, 41):
            message = failure(write(tmp_path / "a.jpeg", whole[:length]))
            assert message == "JPEG is truncated or damaged (no end marker); copy it again or remove it"


def test_truncated_png_of_any_length(tmp_path: Path) -> None:
    data = encode(".png", COLOUR)
    for length in [*range(8, len(data) - 12, 101), len(data) - 12, len(data) - 1]:
        message = failure(write(tmp_path / "a.png", data[:length]))
        assert message == "PNG is truncated (no IEND); copy it again or remove it"


def test_damaged_png(tmp_path: Path) -> None:
    data = bytearray(encode(".png", COLOUR))
    data[len(data) // 2] ^= 1
    message = failure(write(tmp_path / "a.png", bytes(data)))
    assert message == "PNG is damaged (checksum of IDAT); copy it again or remove it"


@pytest.mark.parametrize("suffix", [".bmp", ".tif", ".pgm", ".webp"])
def test_other_truncated_formats(tmp_path: Path, suffix: str) -> None:
    data = encode(suffix, GRAY)
    message = failure(write(tmp_path / f"a{suffix}", data[: len(data) // 2]))
    assert message == "is no image that OpenCV can decode; copy it again or remove it"


def test_files_that_are_no_images(tmp_path: Path) -> None:
    assert failure(tmp_path / "absent.png") == "no such file"
    (tmp_path / "folder.png").mkdir()
    assert failure(tmp_path / "folder.png") == "cannot be read: Is a directory"
    assert failure(write(tmp_path / "empty.png", b"")) == "is empty; copy it again or remove it"
    undecodable = "is no image that OpenCV can decode; copy it again or remove it"
    assert failure(write(tmp_path / "text.jpeg", b"This is text.\n")) == undecodable
    assert failure(write(tmp_path / "zeros.jpeg", bytes(5000))) == undecodable


@pytest.mark.parametrize(("height", "width"), [(1, 1), (7, 100), (100, 7)])
def test_too_small(tmp_path: Path, height: int, width: int) -> None:
    path = write(tmp_path / "a.png", encode(".png", np.zeros((height, width), np.uint8)))
    assert failure(path) == f"is {width}x{height} pixels, and 8 a side are needed; remove it"


def test_smallest(tmp_path: Path) -> None:
    assert read_gray(write(tmp_path / "a.png", encode(".png", GRAY[:8, :8]))).shape == (8, 8)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int16])
def test_pixels_of_other_types(tmp_path: Path, kind: type[np.number[Any]]) -> None:
    pixels = GRAY.astype(kind)
    if kind is np.float32:
        pixels[0, 0] = np.nan
    name = np.dtype(kind).name
    message = failure(write(tmp_path / "a.tif", encode(".tif", pixels)))
    assert message == f"has pixels of type {name}; save it with 8 or 16 bits a channel"


def test_a_header_that_promises_too_much(tmp_path: Path) -> None:
    data = encode(".png", GRAY)
    header = struct.pack(">II", 100_000, 100_000) + data[24:29]
    message = failure(write(tmp_path / "a.png", data[:8] + chunk(b"IHDR", header) + data[33:]))
    assert message == "is 100000x100000 pixels, and 67108864 in all are read; make it smaller"
    # One row more than OpenCV would be asked for; the same of a JPEG, whose size is behind other segments.
    (tmp_path / "b.png").write_bytes(encode(".png", np.zeros((8193, 8192), np.uint8)))
    assert failure(tmp_path / "b.png").startswith("is 8192x8193 pixels")
    assert failure(write(tmp_path / "c.png", data[:8] + chunk(b"IEND", b""))).startswith("is no image that OpenCV")
    data = encode(".jpg", GRAY)
    frame = data.index(b"\xff\xc0")
    forged = data[: frame + 5] + struct.pack(">HH", 65_000, 65_500) + data[frame + 9 :]
    assert failure(write(tmp_path / "a.jpg", forged)).startswith("is 65500x65000 pixels, and 67108864 in all are read")


@pytest.mark.skipif(sys.platform == "win32", reason="no such pipes there")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.png")
    assert failure(tmp_path / "x.png") == "is no regular file; remove it"


def test_the_log_level_is_restored_by_the_last_of_many_threads(tmp_path: Path) -> None:
    before = opencv_log().getLogLevel()
    path = write(tmp_path / "a.bmp", encode(".bmp", GRAY)[:500])
    threads = [threading.Thread(target=lambda: [failure(path) for _ in range(50)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert opencv_log().getLogLevel() == before != 0


def test_finding_sequences_does_not_import_opencv() -> None:
    code = "import sys, placerec.frames; sys.exit('cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC"),
        (b"\0\0\0\x1cftypmif1\0\0\0\0", "HEIC"),
        (b"\0\0\0\x18ftypmp42\0\0\0\0", "a video"),
        (b"\xff\n\xfa\x1f", "JPEG XL"),
        (b"%PDF-1.7 ", "PDF"),
    ],
)
def test_what_is_whole_and_of_another_kind_is_to_be_converted(tmp_path: Path, data: bytes, kind: str) -> None:
    path = write(tmp_path / "a.jpg", data + bytes(64))
    with pytest.raises(SourceError) as error:
        read_gray(path)
    assert str(error.value) == f"{path}: is {kind}, which is not read; convert it to JPEG"
