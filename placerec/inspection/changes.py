"""What `placerec stability` does to a picture: a camera's small faults, and simulated changes of light."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.frames.image import decode_image
from placerec.frames.sequence import ColourImage, Image
from placerec.vision.light import LIGHTS, relit_jpeg
from placerec.vision.spec import DescriptorSpec

Pixels = NDArray[Any]
SIMULATED = "simulated light"


@dataclass(frozen=True)
class Change:
    """One way to spoil a picture: `apply(pixels, spec, rng)` gives pixels of the same or of the fitted size.

    Pixels are grey (h, w), or blue, green, red (h, w, 3).
    """

    kind: str
    amount: str
    apply: Callable[[Pixels, DescriptorSpec, np.random.Generator], Pixels]


def with_faults(image: Image, spec: DescriptorSpec, rng: np.random.Generator) -> Iterator[Image]:
    """An image after each of CHANGES: its grey levels and, where it has them, its colours."""
    for change in CHANGES:
        if isinstance(image, ColourImage):
            yield ColourImage(change.apply(image.gray, spec, rng), change.apply(image.colours, spec, rng))
        else:
            yield change.apply(image, spec, rng)


def in_lights(image: Image, spec: DescriptorSpec, *, seed: int, sequence: str, frame: int) -> Iterator[Image]:
    """An image, in colours, in each of LIGHTS: what is read of the file that `placerec relight` writes of it.

    `seed`, `sequence` and `frame` decide what is drawn, see `placerec.vision.light.relit`.
    """
    for light in LIGHTS:
        stored = relit_jpeg(image, light, seed=seed, sequence=sequence, frame=frame)
        yield decode_image(stored, f"{sequence}: frame {frame} in the light {light}", colours=spec.colours)


def _like(values: Pixels, pixels: Pixels) -> Pixels:
    """Values cut to 0..255, and to whole numbers where the picture's are."""
    values = values.clip(0, 255)
    return np.rint(values).astype(np.uint8) if pixels.dtype == np.uint8 else values.astype(np.float32)


def _jpeg(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, quality: int) -> Pixels:
    whole = np.rint(pixels).astype(np.uint8)
    _, data = cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE if pixels.ndim == 2 else cv2.IMREAD_COLOR))


def _noise(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, sigma: float) -> Pixels:
    return _like(pixels + sigma * rng.standard_normal(pixels.shape), pixels)


def _brightness(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, factor: float) -> Pixels:
    return _like(pixels * np.float64(factor), pixels)


def _blur(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, sigma: float) -> Pixels:
    return np.asarray(cv2.GaussianBlur(pixels, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))


def _shift(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, right: int, down: int) -> Pixels:
    # What comes in from outside repeats the edge.
    height, width = pixels.shape[:2]
    rows = np.clip(np.arange(height) - down, 0, height - 1)
    columns = np.clip(np.arange(width) - right, 0, width - 1)
    return pixels[np.ix_(rows, columns)]


def _resized(pixels: Pixels, spec: DescriptorSpec, rng: np.random.Generator, *, interpolation: int) -> Pixels:
    """Grey levels fitted to their square as `fit_image` does it, but by another filter."""
    if pixels.ndim == 3:
        return pixels
    height, width = pixels.shape
    side = spec.image_size
    if spec.fit == "squash":
        height, width = side, side
    else:
        scale = max(side / height, side / width)
        height, width = int(scale * height + 0.5), int(scale * width + 0.5)
    top, left = (height - side) // 2, (width - side) // 2
    whole = cv2.resize(pixels, (width, height), interpolation=interpolation)
    return _like(whole[top : top + side, left : left + side], pixels)


CHANGES = (
    *(Change("JPEG", f"quality {q}", partial(_jpeg, quality=q)) for q in (90, 70, 50, 30)),
    *(Change("noise", f"sigma {s}", partial(_noise, sigma=s)) for s in (2, 5, 10)),
    *(Change("brightness", f"{p:+d} %", partial(_brightness, factor=1 + p / 100)) for p in (-30, -10, 10, 30)),
    *(Change("blur", f"sigma {s}", partial(_blur, sigma=s)) for s in (1, 2)),
    *(
        Change("shift by 1 pixel", way, partial(_shift, right=right, down=down))
        for way, right, down in (("left", -1, 0), ("right", 1, 0), ("up", 0, -1), ("down", 0, 1))
    ),
    Change("resize filter", "nearest", partial(_resized, interpolation=cv2.INTER_NEAREST)),
    Change("resize filter", "bicubic", partial(_resized, interpolation=cv2.INTER_CUBIC)),
)
