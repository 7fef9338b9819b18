"""Image files byte by byte, for tests of what is whole and what is not."""

import struct
import zlib
from typing import Any

import cv2
from numpy.typing import NDArray


def encode(suffix: str, pixels: NDArray[Any], *options: int) -> bytes:
    """The file that OpenCV makes of the pixels."""
    ok, data = cv2.imencode(suffix, pixels, options)
    assert ok
    return data.tobytes()


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
