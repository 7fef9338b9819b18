"""Messages of images, as ROS has them, as grey levels and colours: raw ones of every encoding, and compressed ones."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import SourceError
from placerec.frames.image import as_colours, as_gray, decode_image
from placerec.frames.sequence import ColourImage, Colours, Gray, Image

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

# OpenCV's conversions to blue, green, red.
_PLANAR = {
    "nv12": "YUV2BGR_NV12",
    "nv21": "YUV2BGR_NV21",
    "yuv420": "YUV2BGR_I420",
    "i420": "YUV2BGR_I420",
    "yv12": "YUV2BGR_YV12",
}
# encoding -> channels, bytes a channel, OpenCV's conversion to grey ("" where the one channel is grey already).
_ENCODINGS = {
    "mono8": (1, 1, ""),
    "8UC1": (1, 1, ""),
    "mono16": (1, 2, ""),
    "16UC1": (1, 2, ""),
    "rgb8": (3, 1, "RGB2GRAY"),
    "bgr8": (3, 1, "BGR2GRAY"),
    "8UC3": (3, 1, "BGR2GRAY"),
    "rgba8": (4, 1, "RGBA2GRAY"),
    "bgra8": (4, 1, "BGRA2GRAY"),
    "8UC4": (4, 1, "BGRA2GRAY"),
    "rgb16": (3, 2, "RGB2GRAY"),
    "bgr16": (3, 2, "BGR2GRAY"),
    "yuv422": (2, 1, "YUV2GRAY_UYVY"),
    "uyvy": (2, 1, "YUV2GRAY_UYVY"),
    "yuv422_yuy2": (2, 1, "YUV2GRAY_YUY2"),
    "yuyv": (2, 1, "YUV2GRAY_YUY2"),
    # The grey levels come first, and half as many bytes of colour behind them.
    **dict.fromkeys(_PLANAR, (1, 1, "")),
    **{
        f"bayer_{order}{8 * size}": (1, size, f"Bayer{order.upper()}2GRAY")
        for order in ("rggb", "bggr", "gbrg", "grbg")
        for size in (1, 2)
    },
}
# A topic of compressed depth is called so, and its messages' format, whose data begin with as many bytes of their own.
DEPTH, _DEPTH_HEADER = "compressedDepth", 12
# FFmpeg's name of a codec, and how formats of messages call it.
_CODECS = {
    "h264": re.compile(r"(?i)h\.?264|avc1?"),
    "hevc": re.compile(r"(?i)h\.?265|hevc"),
    "av1": re.compile(r"(?i)av1"),
    "vp8": re.compile(r"(?i)vp8"),
    "vp9": re.compile(r"(?i)vp9"),
}
_VIDEO = re.compile(r"(?i)\b(h\.?26[45]|avc1?|hevc|av1|vp[89])\b")


def image_of(message: Any, kind: str, name: str, *, colours: bool = False) -> Image:
    """The grey levels 0..255 of a message of type `kind`; with `colours` a `ColourImage`.

    16 bits as in `decode_image`; 32FC1: what is no positive number is 0, and 1, or the greatest value if that is more,
    becomes 255. Raises SourceError that begins with `name` for an encoding that is not read and for missing data.
    """
    data = np.asarray(message.data)
    if kind == COMPRESSED:
        encoded = data.tobytes()[_DEPTH_HEADER if DEPTH in message.format else 0 :]
        return decode_image(encoded, name, colours=colours)
    if message.encoding == "32FC1":
        levels = _of_floats(_pixels(message, data, 1, "f4", name)[..., 0], name)
        return ColourImage(levels, as_colours(levels, name)) if colours else levels
    if message.encoding not in _ENCODINGS:
        raise SourceError(f"{name} has {_unknown_encoding(message.encoding)}")
    channels, size, conversion = _ENCODINGS[message.encoding]
    pixels = _pixels(message, data, channels, f"u{size}", name)
    gray = as_gray(_converted(pixels, conversion), name)
    if not colours:
        return gray
    if message.encoding in _PLANAR:
        return ColourImage(gray, _of_planes(message, data, pixels[..., 0], name))
    # What a camera writes as blue, green, red is that already.
    coloured = "" if conversion == "BGR2GRAY" else conversion.replace("GRAY", "BGR")
    return ColourImage(gray, as_colours(_converted(pixels, coloured), name))


def _converted(pixels: NDArray[Any], conversion: str) -> NDArray[Any]:
    """The pixels (h, w, channels) after OpenCV's conversion, if there is one and they are enough for it."""
    import cv2

    found = pixels[..., 0] if pixels.shape[2] == 1 else pixels
    if not conversion or min(found.shape[:2]) < 2:
        return found
    return cv2.cvtColor(found, getattr(cv2, f"COLOR_{conversion}"))


def _of_planes(message: Any, data: NDArray[np.uint8], levels: NDArray[np.uint8], name: str) -> Colours:
    """The colours of a picture whose grey levels (h, w) come first, and behind them those of every 2 x 2 pixels."""
    import cv2

    height, width = levels.shape
    step, conversion = int(message.step), _PLANAR[message.encoding]
    # Two values a row of one plane; or a plane for each, whose rows are half as long.
    rows, row = (height // 2, width) if conversion.startswith("NV", 8) else (height, width // 2)
    behind = data[height * step :]
    if height % 2 or width % 2 or step % 2 or len(behind) < height * step // 2:
        raise SourceError(f"{name} is damaged: {width}x{height} pixels in rows of {step} bytes have no whole colours")
    chroma = behind[: height * step // 2].reshape(rows, -1)[:, :row]
    planes = np.concatenate([levels.reshape(-1), chroma.reshape(-1)]).reshape(height * 3 // 2, width)
    return as_colours(cv2.cvtColor(planes, getattr(cv2, f"COLOR_{conversion}")), name)


def _pixels(message: Any, data: NDArray[np.uint8], channels: int, kind: str, name: str) -> NDArray[Any]:
    """The message's data as (height, width, channels), without the padding of its rows and in this machine's order."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    if message.encoding in _PLANAR and len(data) < height * step * 3 // 2:
        # Some drivers count the rows of colour, too.
        height = height * 2 // 3
    item = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = width * channels * item.itemsize
    if not row or step < row or len(data) < height * step or not height:
        what = f"{width}x{height} pixels in rows of {step} bytes need more than its {len(data)} bytes of data"
        raise SourceError(f"{name} is damaged: {what}")
    rows = data[: height * step].reshape(height, step)[:, :row]
    return np.ascontiguousarray(rows).view(item).astype(kind).reshape(height, width, channels)


def _of_floats(values: Singles, name: str) -> Gray:
    values = np.where(np.isfinite(values) & (values > 0), values, np.float32(0)).astype(np.float32)
    scaled = values * np.float32(255 / max(1.0, float(values.max())))
    # Checked as any other picture is; its levels stay fractions.
    as_gray(scaled.astype(np.uint8), name)
    return scaled


def codec_in(message: Any, kind: str) -> str:
    """The codec of the video that a message of type `kind` is a piece of, by FFmpeg's name; "" if it is an image."""
    found = _VIDEO.search(message.format) if kind == COMPRESSED else None
    return next(name for name, pattern in _CODECS.items() if pattern.fullmatch(found[1])) if found else ""


def unreadable(message: Any, kind: str) -> str:
    """Why no message of type `kind` that is like this one can be read; "" if some may be."""
    if kind == COMPRESSED:
        return ""
    known = message.encoding in (*_ENCODINGS, "32FC1")
    return "" if known else f"have {_unknown_encoding(message.encoding)}"


def _unknown_encoding(encoding: str) -> str:
    return f"the encoding {encoding!r}, which is not read; known are {', '.join([*_ENCODINGS, '32FC1'])}"
