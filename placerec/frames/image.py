"""An encoded image -> grey levels, and colours if they are wanted.

Damage is looked for before decoding: OpenCV gives half a picture and no error.
"""

import re
import stat
import struct
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.frames.sequence import ColourImage, Colours, Gray, Image, gray_levels

# cv2 is imported where it is used: listing frames must not cost its import.

MIN_SIDE = 8
MAX_PIXELS = 1 << 26
_REMEDY = "copy it again or remove it"
_JPEG = b"\xff\xd8\xff"
_PNG = b"\x89PNG\r\n\x1a\n"
# What is whole, and no image that OpenCV decodes.
_OTHERS = {
    "AVIF": re.compile(rb"....ftypavi[fs]", re.DOTALL),
    "HEIC": re.compile(rb"....ftyp(hei|hev|mif1|msf1)", re.DOTALL),
    "a video": re.compile(rb"....ftyp", re.DOTALL),
    "JPEG XL": re.compile(rb"\xff\n|\0\0\0\x0cJXL "),
    "GIF": re.compile(rb"GIF8"),
    "PDF": re.compile(rb"%PDF"),
}
# Within a scan FF is followed by 00 (a stuffed byte), D0-D7 (a restart) or FF (filling); anything else ends it.
_SCAN_END = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
# C4, C8 and CC are tables and extensions.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_DEPTHS = (8, 10, 12, 14, 16)


def read_gray(path: Path | str) -> Gray:
    """The grey levels 0..255 of an image file, (h, w): uint8, or float32 for 16 bits a channel.

    Raises SourceError naming the file and the reason: missing, unreadable, a pipe, and what `decode_image` refuses.
    """
    return gray_levels(read_image(path))


def read_image(path: Path | str, *, colours: bool = False) -> Image:
    """What `decode_image` makes of an image file; raises what `read_gray` raises."""
    return decode_image(_bytes_of(Path(path)), str(path), colours=colours)


def read_colours(path: Path | str, height: int) -> Gray:
    """An image file for people to look at: (h, w, 3) blue, green, red uint8, about `height` high or more.

    A JPEG that is far larger is made smaller as it is decoded, which is quicker. Raises what `read_gray` raises.
    """
    import cv2

    name = str(path)
    data = _checked(_bytes_of(Path(path)), name)
    flags = cv2.IMREAD_COLOR
    if data.startswith(_JPEG) and (frame := _jpeg_frame(data)):
        least = min(struct.unpack_from(">HH", data, frame + 5))
        for factor in (2, 4, 8):
            if least >= factor * height:
                flags = getattr(cv2, f"IMREAD_REDUCED_COLOR_{factor}")
    return _decode(name, data, flags)


def _bytes_of(path: Path) -> bytes:
    try:
        # A pipe would keep the work waiting for good.
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise SourceError(f"{path}: is no regular file; remove it")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise SourceError(f"{path}: no such file") from error
    except OSError as error:
        raise SourceError(f"{path}: cannot be read: {error.strerror}") from error


def decode_image(data: bytes, name: str, *, colours: bool = False) -> Image:
    """The grey levels 0..255 of an encoded image (JPEG, PNG...), (h, w): uint8, or float32 for 16 bits a channel.

    OpenCV's grey decoding is the one path (its luma differs by up to 11 levels from a conversion of the decoded
    colours); alpha and colour profiles are ignored, EXIF orientation is applied. 16 bits: the depth in use is the
    least of 8, 10, 12, 14, 16 bits that holds the brightest pixel, and its top becomes 255 (full 16 bits: value / 257).
    `colours`: a `ColourImage`, for which the colours are decoded apart; those of 16 bits are scaled as grey levels are,
    by the depth that holds their own greatest value, and rounded; a grey image has three equal channels.
    Raises SourceError that begins with `name`: empty, truncated, damaged, no image, pixels of another type, a side
    below 8 pixels, more than MAX_PIXELS of them (PNG and JPEG).
    """
    import cv2

    data = _checked(data, name)
    # ANYDEPTH: without it 16 bits are cut to the upper 8, which leaves 12-bit cameras a black picture.
    gray = as_gray(_decode(name, data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH), name)
    if not colours:
        return gray
    # Grey levels made of the colours would be others.
    pixels = _decode(name, data, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    return ColourImage(gray, as_colours(pixels, name))


def _checked(data: bytes, name: str) -> bytes:
    """What is given to the decoder; SourceError for what is known not to be whole, or too large."""
    if not data:
        raise SourceError(f"{name}: is empty; {_REMEDY}")
    if data.startswith(_JPEG):
        _check_jpeg(name, data)
    elif data.startswith(_PNG):
        data = _plain_png(name, data)
    _check_size(name, data)
    return data


def as_gray(pixels: NDArray[Any], name: str) -> Gray:
    """Decoded grey levels (h, w) as 0..255; SourceError for a side below 8 pixels, or not 8 or 16 bits."""
    height, width = pixels.shape[:2]
    if min(height, width) < MIN_SIDE:
        raise SourceError(f"{name}: is {width}x{height} pixels, and {MIN_SIDE} a side are needed; remove it")
    if pixels.dtype == np.uint16:
        peak = int(pixels.max())
        depth = next(bits for bits in _DEPTHS if peak < 1 << bits)
        return pixels * np.float32(255 / ((1 << depth) - 1))
    if pixels.dtype != np.uint8:
        raise SourceError(f"{name}: has pixels of type {pixels.dtype}; save it with 8 or 16 bits a channel")
    return pixels


def as_colours(pixels: NDArray[Any], name: str) -> Colours:
    """Decoded pixels, grey (h, w) or blue, green, red (h, w, 3), as (h, w, 3) of 0..255; SourceError as `as_gray`."""
    import cv2

    levels: NDArray[Any] = pixels if pixels.dtype == np.float32 else as_gray(pixels, name)
    if levels.dtype != np.uint8:
        levels = np.rint(levels).clip(0, 255).astype(np.uint8)
    return levels if levels.ndim == 3 else np.asarray(cv2.cvtColor(levels, cv2.COLOR_GRAY2BGR), np.uint8)


def as_image(pixels: NDArray[Any], name: str, *, colours: bool = False) -> Image:
    """Decoded pixels, grey (h, w) or blue, green, red (h, w, 3), as grey levels; with `colours` a `ColourImage`.

    Raises SourceError as `as_gray` does.
    """
    import cv2

    gray = as_gray(pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), name)
    return ColourImage(gray, as_colours(pixels, name)) if colours else gray


def _decode(name: str, data: bytes, flags: int) -> NDArray[Any]:
    import cv2

    try:
        with quiet():
            pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise SourceError(f"{name}: OpenCV refuses it ({' '.join(error.err.split())}); {_REMEDY}") from error
    if pixels is None:
        kind = next((kind for kind, pattern in _OTHERS.items() if pattern.match(data)), "")
        what = (
            f"is {kind}, which is not read; convert it to JPEG"
            if kind
            else f"is no image that OpenCV can decode; {_REMEDY}"
        )
        raise SourceError(f"{name}: {what}")
    return pixels


def _check_size(name: str, data: bytes) -> None:
    """Raise SourceError for a PNG or JPEG whose header promises more than MAX_PIXELS: a few bytes can be gigabytes."""
    if data.startswith(_PNG) and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
    elif data.startswith(_JPEG) and (frame := _jpeg_frame(data)):
        height, width = struct.unpack_from(">HH", data, frame + 5)
    else:
        return
    if width * height > MAX_PIXELS:
        raise SourceError(f"{name}: is {width}x{height} pixels, and {MAX_PIXELS} in all are read; make it smaller")


def _jpeg_frame(data: bytes) -> int:
    """Where the frame's header (SOF) begins in a JPEG, 0 if there is none before the first scan."""
    place = 2
    while place + 9 <= len(data) and data[place] == 0xFF and data[place + 1] != 0xDA:
        if data[place + 1] in _FRAMES:
            return place
        place += 1 if data[place + 1] == 0xFF else 2 + struct.unpack_from(">H", data, place + 2)[0]
    return 0


def _check_jpeg(name: str, data: bytes) -> None:
    """Raise SourceError if the end marker cannot be reached; what follows it (padding, a picture) is no concern.

    The segments are walked, for a thumbnail within one has an end marker of its own.
    """
    place = 2
    while place + 4 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker == 0xD9:
            return
        if marker == 0xFF:
            place += 1
            continue
        place += 2 + struct.unpack_from(">H", data, place + 2)[0]
        if marker == 0xDA:
            end = _SCAN_END.search(data, place)
            place = end.start() if end else len(data)
    if data[place : place + 2] != b"\xff\xd9":
        raise SourceError(f"{name}: JPEG is truncated or damaged (no end marker); {_REMEDY}")


def _plain_png(name: str, data: bytes) -> bytes:
    """The same picture without colour profile and comments; SourceError if it is truncated or a checksum is wrong.

    With a gamma or sRGB tag libpng weighs the colours otherwise (up to 65 grey levels), and it writes to stderr about
    tags that it dislikes: tags other than the orientation are not handed to it.
    """
    kept = [_PNG]
    place = len(_PNG)
    while place + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + length
        if end > len(data):
            break
        if kind == b"eXIf" or not kind[0] & 0x20:
            if zlib.crc32(data[place + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
                raise SourceError(f"{name}: PNG is damaged (checksum of {kind.decode('latin-1')}); {_REMEDY}")
            kept.append(data[place:end])
        if kind == b"IEND":
            return b"".join(kept)
        place = end
    raise SourceError(f"{name}: PNG is truncated (no IEND); {_REMEDY}")


_SILENT = 0  # the least of OpenCV's log levels, which has no name before 4.13
_lock = threading.Lock()
_decoding = 0
_level = 0


@contextmanager
def quiet() -> Iterator[None]:
    """OpenCV's log is silent within: the error that is raised says what it would say, and names the file.

    The level is one for the process: the first thread to enter keeps it, the last to leave restores it.
    """
    global _decoding, _level
    log = opencv_log()
    with _lock:
        if _decoding == 0:
            _level = log.setLogLevel(_SILENT)
        _decoding += 1
    try:
        yield
    finally:
        with _lock:
            _decoding -= 1
            if _decoding == 0:
                log.setLogLevel(_level)


def opencv_log() -> Any:
    """Where OpenCV has `getLogLevel` and `setLogLevel`: a module of their own since 4.13, cv2 itself before."""
    import cv2

    return getattr(cv2.utils, "logging", cv2)
