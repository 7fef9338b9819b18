"""Simulated changes of light: what the same camera might have seen with other lamps, exposures and sensors.

Real recordings of one building in several lights are rare; these stand in for them, and every number that comes of
them is called simulated. An image's levels v of 0..255 are taken as linear light (v / 255)^2.2, changed there, brought
back, rounded, cut to 0..255 and stored as a JPEG of quality 90 again, as a camera would.

dim       a fifth of the light, with shot noise (1,000 electrons at full scale) and read noise of 3 electrons
warm      red x (1 + s/4), green x (1 - 0.08 s), blue x (1 - 0.45 s), with s of 0.7 to 1.3
lamp      from one side: there 1.3 times the light in a colour, 0.7 on the other side, linear between
exposure  x 0.45 or x 2.2

What is drawn (s, the side, the colour, the factor) is drawn once for a sequence; noise is drawn for every frame.
"""

import zlib
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import VisionError

Colours = NDArray[np.uint8]
_GAMMA = 2.2
_LINEAR = ((np.arange(256) / 255) ** _GAMMA).astype(np.float32)
_ELECTRONS, _READ = 1000, 3.0
# Blue, green, red: daylight, a bulb, an old fluorescent tube.
_LAMPS = ((1.6, 0.8, 0.45), (0.6, 1.0, 1.6), (0.8, 1.5, 0.7))
_QUALITY = 90


def relight(image: Colours, light: str, *, seed: int, sequence: str, frame: int) -> Colours:
    """An image (h, w, 3) blue, green, red of 0..255, or grey (h, w), uint8, in another light, one of LIGHTS.

    `seed` and `sequence` decide what is drawn for the whole sequence, the number `frame` the noise. The same arguments
    give the same bytes. Raises VisionError for an unknown light.
    """
    if light not in LIGHTS:
        raise VisionError(f"no simulated light is called {light!r}; choose one of {', '.join(LIGHTS)}")
    key = [seed, zlib.crc32(light.encode()), zlib.crc32(sequence.encode())]
    of_sequence, of_frame = (np.random.Generator(np.random.PCG64(some)) for some in (key, [*key, frame]))
    colours = image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)
    linear = LIGHTS[light](_LINEAR[colours], of_sequence, of_frame)
    levels = np.rint(255 * np.clip(linear, 0, 1) ** (1 / _GAMMA)).astype(np.uint8)
    _, stored = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    flag = cv2.IMREAD_COLOR if image.ndim == 3 else cv2.IMREAD_GRAYSCALE
    return np.asarray(cv2.imdecode(stored, flag), np.uint8)


def _dim(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    seen = of_frame.poisson(linear * 0.2 * _ELECTRONS) + of_frame.normal(0, _READ, linear.shape)
    return (seen / _ELECTRONS).astype(np.float32)


def _warm(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    s = of_sequence.uniform(0.7, 1.3)
    return linear * np.array([1 - 0.45 * s, 1 - 0.08 * s, 1 + 0.25 * s], np.float32)


def _lamp(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    near = np.linspace(0, 1, linear.shape[1], dtype=np.float32)[None, :, None]
    if of_sequence.integers(2):
        near = 1 - near
    colour = np.array(_LAMPS[of_sequence.integers(len(_LAMPS))], np.float32)
    return linear * (0.7 * (1 - near) + 1.3 * near * colour)


def _exposure(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    return linear * np.float32(0.45 if of_sequence.integers(2) else 2.2)


_Change = Callable[[Singles, np.random.Generator, np.random.Generator], Singles]
LIGHTS: dict[str, _Change] = {"dim": _dim, "warm": _warm, "lamp": _lamp, "exposure": _exposure}
