"""Procedural surfaces: what walls, floors and furniture look like before light falls on them.

A painter is a function (rng, width, height, res) -> Skin, with sizes in metres and `res` in pixels per metre.
Positions inside a skin are metres from its left and lower edge, as a carpenter would measure them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Colour = tuple[float, float, float]

WHITE: Colour = (0.80, 0.79, 0.76)
STEEL: Colour = (0.52, 0.54, 0.56)
DARK: Colour = (0.06, 0.06, 0.07)
OAK: Colour = (0.46, 0.30, 0.16)
GROUT: Colour = (0.42, 0.42, 0.41)


@dataclass(frozen=True)
class Skin:
    """One surface: reflectance (h, w, 3) RGB, and how much of the sky (h, w) and of the lamps (h, w) it shows."""

    albedo: Image
    day: Image
    lamp: Image


Painter = Callable[[np.random.Generator, float, float, float], Skin]


def paste(target: Skin, part: Skin, x: float, z: float, res: float) -> None:
    """Put `part` on `target` with its lower left corner at (x, z) metres; what sticks out is cut off."""
    height, width = target.day.shape
    rows, columns = part.day.shape
    left, top = round(x * res), height - round(z * res) - rows
    r0, r1, c0, c1 = max(top, 0), min(top + rows, height), max(left, 0), min(left + columns, width)
    if r0 >= r1 or c0 >= c1:
        return
    for whole, piece in ((target.albedo, part.albedo), (target.day, part.day), (target.lamp, part.lamp)):
        whole[r0:r1, c0:c1] = piece[r0 - top : r1 - top, c0 - left : c1 - left]


def blank(width: float, height: float, res: float, colour: Colour) -> Skin:
    rows, columns = max(2, round(height * res)), max(2, round(width * res))
    albedo = np.empty((rows, columns, 3), np.float32)
    albedo[:] = colour
    return Skin(albedo, np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32))


def box(image: Image, res: float, x0: float, z0: float, x1: float, z1: float, colour: Colour | float) -> None:
    rows = image.shape[0]
    top, bottom = rows - round(z1 * res), rows - round(z0 * res)
    left, right = round(x0 * res), round(x1 * res)
    # A line thinner than a pixel stays visible: handles and joints are what makes a door a door.
    image[max(top, 0) : max(bottom, top + 1, 0), max(left, 0) : max(right, left + 1, 0)] = colour


def clouds(rng: np.random.Generator, shape: tuple[int, ...], cell: float) -> Image:
    """Smooth noise in about -1..1, with features of `cell` pixels."""
    coarse = rng.uniform(-1, 1, (max(2, round(shape[0] / cell) + 1), max(2, round(shape[1] / cell) + 1)))
    return np.asarray(cv2.resize(coarse.astype(np.float32), (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC))


def mottle(rng: np.random.Generator, image: Image, cell: float, amount: float) -> None:
    image[:] *= (1 + amount * clouds(rng, image.shape, cell))[..., None]


def plain(colour: Colour, cell: float = 0.12, amount: float = 0.04) -> Painter:
    def paint(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
        result = blank(width, height, res, colour)
        mottle(rng, result.albedo, cell * res, amount)
        return result

    return paint


def _plaster(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.74, 0.71, 0.64))
    mottle(rng, result.albedo, 0.9 * res, 0.05)
    mottle(rng, result.albedo, 0.06 * res, 0.035)
    box(result.albedo, res, 0, 0, width, 0.09, (0.20, 0.19, 0.18))
    return result


def _grid(pitch: float, colour: Colour, joint: Colour, spread: float) -> Painter:
    """Square tiles: each its own shade, with joints between."""

    def paint(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
        result = blank(width, height, res, colour)
        rows, columns = result.day.shape
        step = pitch * res
        shades = rng.uniform(1 - spread, 1 + spread, (int(rows / step) + 2, int(columns / step) + 2)).astype(np.float32)
        r, c = np.arange(rows - 1, -1, -1, dtype=np.float32) / step, np.arange(columns, dtype=np.float32) / step
        result.albedo[:] *= shades[r.astype(int)][:, c.astype(int)][..., None]
        line = max(1.0, 0.012 * res) / step
        result.albedo[(r % 1 < line)] = joint
        result.albedo[:, (c % 1 < line)] = joint
        mottle(rng, result.albedo, 0.05 * res, 0.03)
        return result

    return paint


_TILES = _grid(0.15, (0.74, 0.76, 0.76), GROUT, 0.06)


def _tiled_wall(top: float) -> Painter:
    """White tiles up to `top` with a dark border row, plaster above: toilet and kitchen share them."""

    def paint(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
        result = _plaster(rng, width, height, res)
        paste(result, _TILES(rng, width, min(top, height), res), 0, 0, res)
        box(result.albedo, res, 0, top - 0.06, width, top, (0.16, 0.24, 0.30))
        return result

    return paint


def _checker(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.50, 0.46, 0.38))
    rows, columns = (np.arange(n) / (0.4 * res) for n in result.day.shape)
    odd = (rows.astype(int)[:, None] + columns.astype(int)) % 2 == 1
    result.albedo[odd] = (0.30, 0.27, 0.23)
    mottle(rng, result.albedo, 0.08 * res, 0.06)
    return result


def _parquet(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, OAK)
    rows, columns = result.day.shape
    step = max(2, round(0.14 * res))
    for start in range(0, columns, step):
        result.albedo[:, start : start + step] *= rng.uniform(0.75, 1.15)
        result.albedo[:, start] *= 0.55
        for joint in np.arange(rng.uniform(0, 1.2), height, 1.2):
            result.albedo[min(rows - 1, int(joint * res)), start : start + step] *= 0.55
    mottle(rng, result.albedo, 0.04 * res, 0.06)
    return result


def _lino(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.30, 0.33, 0.35))
    mottle(rng, result.albedo, 0.03 * res, 0.14)
    mottle(rng, result.albedo, 0.5 * res, 0.05)
    # Welded seams of the sheets, and a dark border along the walls.
    for x in np.arange(1.0, width, 2.0):
        box(result.albedo, res, x, 0, x + 0.02, height, (0.20, 0.22, 0.24))
    for z0, z1 in ((0.0, 0.12), (height - 0.12, height)):
        box(result.albedo, res, 0, z0, width, z1, (0.13, 0.15, 0.18))
    return result


def _ceiling(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    return _grid(0.6, (0.72, 0.72, 0.70), (0.50, 0.50, 0.49), 0.03)(rng, width, height, res)


def _panel_lamp(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, STEEL)
    rim = max(1, round(0.03 * res))
    result.albedo[rim:-rim, rim:-rim] = (0.8, 0.8, 0.78)
    result.lamp[rim:-rim, rim:-rim] = 1
    return result


def wood(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, OAK)
    grain = clouds(rng, (result.day.shape[0], max(4, result.day.shape[1])), 0.03 * res)
    result.albedo[:] *= (1 + 0.12 * cv2.blur(grain, (max(1, round(0.5 * res)), 1))[:, : result.day.shape[1]])[..., None]
    return result


def _door(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = wood(rng, width, height, res)
    box(result.albedo, res, 0, 0, width, 0.28, STEEL)  # kick plate
    for z0, z1 in ((0.45, 0.95), (1.15, height - 0.2)):
        box(result.albedo, res, 0.15, z0, width - 0.15, z1, (0.36, 0.22, 0.11))
        box(result.albedo, res, 0.18, z0 + 0.03, width - 0.15, z1, (0.50, 0.33, 0.18))
    box(result.albedo, res, width - 0.14, 1.0, width - 0.04, 1.05, STEEL)
    box(result.albedo, res, width - 0.07, 0.92, width - 0.04, 1.13, STEEL)
    return result


def _closed_door(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.24, 0.26, 0.29))
    paste(result, _door(rng, width - 0.16, height - 0.08, res), 0.08, 0, res)
    return result


def _outdoors(rng: np.random.Generator, rows: int, columns: int) -> Image:
    """The sky's brightness through a pane: bright above, roofs and trees below."""
    view = np.linspace(1.0, 0.75, rows, dtype=np.float32)[:, None] * np.ones((1, columns), np.float32)
    skyline = rows * (0.68 + 0.14 * clouds(rng, (1, columns), columns / 7)[0])
    view[np.arange(rows)[:, None] > skyline] = 0.28
    return view * (1 + 0.08 * clouds(rng, view.shape, columns / 6))


def _window(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.78, 0.78, 0.77))
    panes = max(1, round(width / 0.75))
    frame, step = 0.06, width / panes
    sky = _outdoors(rng, *result.day.shape)
    glass = np.zeros_like(sky)
    for i in range(panes):
        box(glass, res, i * step + frame, frame, (i + 1) * step - frame, height * 0.72, 1.0)
        box(glass, res, i * step + frame, height * 0.72 + frame, (i + 1) * step - frame, height - frame, 1.0)
    result.day[:] = sky * glass
    # At night the panes are black and mirror a little of the room.
    result.albedo[glass > 0] = (0.05, 0.055, 0.065)
    return result


def _frosted(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = _window(rng, width, height, res)
    result.day[:] = np.where(result.day > 0, 0.75, 0)
    return result


def _poster(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.70, 0.70, 0.68))
    hue = tuple(rng.uniform(0.08, 0.5, 3))
    box(result.albedo, res, 0.03, height * 0.78, width - 0.03, height - 0.03, (hue[0], hue[1], hue[2]))
    for z in np.arange(0.06, height * 0.72, 0.07):
        half = width * rng.uniform(0.4, 0.5)
        box(result.albedo, res, 0.05, z, half, z + 0.03, (0.30, 0.30, 0.32))
    box(result.albedo, res, width * 0.56, 0.08, width - 0.05, height * 0.68, (hue[2], hue[0], hue[1]))
    return result


def _board(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.30, 0.32, 0.34))
    box(result.albedo, res, 0.03, 0.03, width - 0.03, height - 0.03, (0.45, 0.33, 0.20))
    for x in np.arange(0.1, width - 0.3, 0.3):
        for z in np.arange(0.1, height - 0.35, 0.36):
            if rng.random() < 0.75:
                dx, dz = rng.uniform(0, 0.06, 2)
                box(result.albedo, res, x + dx, z + dz, x + dx + 0.2, z + dz + 0.28, WHITE)
    return result


SURFACES: dict[str, Painter] = {
    "plaster": _plaster,
    "tiles": _TILES,
    "tiled": _tiled_wall(1.9),
    "half tiled": _tiled_wall(1.5),
    "floor tiles": _grid(0.3, (0.27, 0.28, 0.29), (0.12, 0.12, 0.12), 0.12),
    "checker": _checker,
    "parquet": _parquet,
    "carpet": plain((0.24, 0.25, 0.29), 0.03, 0.18),
    "lino": _lino,
    "ceiling": _ceiling,
    "panel lamp": _panel_lamp,
    "wood": wood,
    "door": _door,
    "closed door": _closed_door,
    "jamb": plain((0.24, 0.26, 0.29)),
    "window": _window,
    "frosted": _frosted,
    "poster": _poster,
    "board": _board,
    "white": plain(WHITE, 0.2, 0.03),
    "ceramic": plain((0.82, 0.83, 0.82), 0.2, 0.03),
    "grey": plain((0.34, 0.35, 0.37)),
    "steel": plain(STEEL, 0.1, 0.05),
    "dark": plain(DARK),
    "fabric": plain((0.09, 0.14, 0.26), 0.04, 0.15),
    "red": plain((0.55, 0.05, 0.04)),
    "blue panel": plain((0.22, 0.32, 0.42), 0.3, 0.03),
}
