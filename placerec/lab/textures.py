"""Procedural surfaces: what walls, floors and furniture look like before light falls on them.

A painter draws on a skin of one colour. Positions inside a skin are metres from its left and lower edge, as a carpenter
would measure them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats

Image = NDArray[np.float32]
Colour = tuple[float, float, float]

WHITE: Colour = (0.80, 0.79, 0.76)
STEEL: Colour = (0.52, 0.54, 0.56)
DARK: Colour = (0.06, 0.06, 0.07)
OAK: Colour = (0.46, 0.30, 0.16)
GROUT: Colour = (0.42, 0.42, 0.41)


@dataclass(frozen=True)
class Skin:
    """A surface of width x height metres at `res` pixels per metre.

    albedo: reflectance (h, w, 3) RGB; day, lamp: how much of the sky and of the lamps it shows (h, w).
    """

    width: float
    height: float
    res: float
    albedo: Image
    day: Image
    lamp: Image

    def box(
        self, x0: float, z0: float, x1: float, z1: float, colour: Colour | Floats | float, image: Image | None = None
    ) -> None:
        """Fill a rectangle of `albedo`, or of another `image` of its size."""
        image = self.albedo if image is None else image
        rows = image.shape[0]
        top, bottom = rows - round(z1 * self.res), rows - round(z0 * self.res)
        left, right = round(x0 * self.res), round(x1 * self.res)
        # A line thinner than a pixel stays visible: handles and joints are what makes a door a door.
        image[max(top, 0) : max(bottom, top + 1, 0), max(left, 0) : max(right, left + 1, 0)] = colour

    def mottle(self, rng: np.random.Generator, cell: float, amount: float) -> None:
        """Make `albedo` uneven, with features of `cell` metres."""
        self.albedo[:] *= (1 + amount * clouds(rng, self.day.shape, cell * self.res))[..., None]

    def paste(self, part: "Skin", x: float, z: float) -> None:
        """Put `part` here with its lower left corner at (x, z); what sticks out is cut off."""
        height, width = self.day.shape
        rows, columns = part.day.shape
        left, top = round(x * self.res), height - round(z * self.res) - rows
        r0, r1, c0, c1 = max(top, 0), min(top + rows, height), max(left, 0), min(left + columns, width)
        if r0 >= r1 or c0 >= c1:
            return
        for whole, piece in ((self.albedo, part.albedo), (self.day, part.day), (self.lamp, part.lamp)):
            whole[r0:r1, c0:c1] = piece[r0 - top : r1 - top, c0 - left : c1 - left]


def skin(rng: np.random.Generator, kind: str, width: float, height: float, res: float) -> Skin:
    """Paint a surface of that kind (a key of PAINTERS), width x height metres at `res` pixels per metre."""
    colour, paint = PAINTERS[kind]
    shape = max(2, round(height * res)), max(2, round(width * res))
    albedo = np.full((*shape, 3), colour, np.float32)
    result = Skin(width, height, res, albedo, np.zeros(shape, np.float32), np.zeros(shape, np.float32))
    paint(result, rng)
    return result


def clouds(rng: np.random.Generator, shape: tuple[int, ...], cell: float) -> Image:
    """Smooth noise in about -1..1, with features of `cell` pixels."""
    coarse = rng.uniform(-1, 1, (max(2, round(shape[0] / cell) + 1), max(2, round(shape[1] / cell) + 1)))
    return np.asarray(cv2.resize(coarse.astype(np.float32), (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC))


def _plain(s: Skin, rng: np.random.Generator, cell: float = 0.12, amount: float = 0.04) -> None:
    s.mottle(rng, cell, amount)


def _plaster(s: Skin, rng: np.random.Generator) -> None:
    s.mottle(rng, 0.9, 0.05)
    s.mottle(rng, 0.06, 0.035)
    s.box(0, 0, s.width, 0.09, (0.20, 0.19, 0.18))


def _grid(s: Skin, rng: np.random.Generator, pitch: float, joint: Colour, spread: float) -> None:
    """Square tiles: each its own shade, with joints between."""
    rows, columns = s.day.shape
    step = pitch * s.res
    shades = rng.uniform(1 - spread, 1 + spread, (int(rows / step) + 2, int(columns / step) + 2)).astype(np.float32)
    r, c = np.arange(rows - 1, -1, -1, dtype=np.float32) / step, np.arange(columns, dtype=np.float32) / step
    s.albedo[:] *= shades[r.astype(int)][:, c.astype(int)][..., None]
    line = max(1.0, 0.012 * s.res) / step
    s.albedo[(r % 1 < line)] = joint
    s.albedo[:, (c % 1 < line)] = joint
    s.mottle(rng, 0.05, 0.03)


def _tiled_wall(s: Skin, rng: np.random.Generator, top: float) -> None:
    """White tiles up to `top` with a dark border row, plaster above: toilet and kitchen share them."""
    _plaster(s, rng)
    s.paste(skin(rng, "tiles", s.width, min(top, s.height), s.res), 0, 0)
    s.box(0, top - 0.06, s.width, top, (0.16, 0.24, 0.30))


def _checker(s: Skin, rng: np.random.Generator) -> None:
    rows, columns = (np.arange(n) / (0.4 * s.res) for n in s.day.shape)
    odd = (rows.astype(int)[:, None] + columns.astype(int)) % 2 == 1
    s.albedo[odd] = (0.30, 0.27, 0.23)
    s.mottle(rng, 0.08, 0.06)


def _parquet(s: Skin, rng: np.random.Generator) -> None:
    rows, columns = s.day.shape
    step = max(2, round(0.14 * s.res))
    for start in range(0, columns, step):
        s.albedo[:, start : start + step] *= rng.uniform(0.75, 1.15)
        s.albedo[:, start] *= 0.55
        for joint in np.arange(rng.uniform(0, 1.2), s.height, 1.2):
            s.albedo[min(rows - 1, int(joint * s.res)), start : start + step] *= 0.55
    s.mottle(rng, 0.04, 0.06)


def _lino(s: Skin, rng: np.random.Generator) -> None:
    s.mottle(rng, 0.03, 0.14)
    s.mottle(rng, 0.5, 0.05)
    # Welded seams of the sheets, and a dark border along the walls.
    for x in np.arange(1.0, s.width, 2.0):
        s.box(x, 0, x + 0.02, s.height, (0.20, 0.22, 0.24))
    for z0, z1 in ((0.0, 0.12), (s.height - 0.12, s.height)):
        s.box(0, z0, s.width, z1, (0.13, 0.15, 0.18))


def _panel_lamp(s: Skin, rng: np.random.Generator) -> None:
    rim = max(1, round(0.03 * s.res))
    s.albedo[rim:-rim, rim:-rim] = (0.8, 0.8, 0.78)
    s.lamp[rim:-rim, rim:-rim] = 1


def _wood(s: Skin, rng: np.random.Generator) -> None:
    grain = clouds(rng, (s.day.shape[0], max(4, s.day.shape[1])), 0.03 * s.res)
    s.albedo[:] *= (1 + 0.12 * cv2.blur(grain, (max(1, round(0.5 * s.res)), 1))[:, : s.day.shape[1]])[..., None]


def _door(s: Skin, rng: np.random.Generator) -> None:
    _wood(s, rng)
    s.box(0, 0, s.width, 0.28, STEEL)  # kick plate
    for z0, z1 in ((0.45, 0.95), (1.15, s.height - 0.2)):
        s.box(0.15, z0, s.width - 0.15, z1, (0.36, 0.22, 0.11))
        s.box(0.18, z0 + 0.03, s.width - 0.15, z1, (0.50, 0.33, 0.18))
    s.box(s.width - 0.14, 1.0, s.width - 0.04, 1.05, STEEL)
    s.box(s.width - 0.07, 0.92, s.width - 0.04, 1.13, STEEL)


def _closed_door(s: Skin, rng: np.random.Generator) -> None:
    s.paste(skin(rng, "door", s.width - 0.16, s.height - 0.08, s.res), 0.08, 0)


def _outdoors(rng: np.random.Generator, rows: int, columns: int) -> Image:
    """The sky's brightness through a pane: bright above, roofs and trees below."""
    view = np.linspace(1.0, 0.75, rows, dtype=np.float32)[:, None] * np.ones((1, columns), np.float32)
    skyline = rows * (0.68 + 0.14 * clouds(rng, (1, columns), columns / 7)[0])
    view[np.arange(rows)[:, None] > skyline] = 0.28
    return view * (1 + 0.08 * clouds(rng, view.shape, columns / 6))


def _window(s: Skin, rng: np.random.Generator) -> None:
    panes = max(1, round(s.width / 0.75))
    frame, step = 0.06, s.width / panes
    sky = _outdoors(rng, *s.day.shape)
    glass = np.zeros_like(sky)
    for i in range(panes):
        s.box(i * step + frame, frame, (i + 1) * step - frame, s.height * 0.72, 1.0, glass)
        s.box(i * step + frame, s.height * 0.72 + frame, (i + 1) * step - frame, s.height - frame, 1.0, glass)
    s.day[:] = sky * glass
    # At night the panes are black and mirror a little of the room.
    s.albedo[glass > 0] = (0.05, 0.055, 0.065)


def _frosted(s: Skin, rng: np.random.Generator) -> None:
    _window(s, rng)
    s.day[:] = np.where(s.day > 0, 0.75, 0)


def _poster(s: Skin, rng: np.random.Generator) -> None:
    red, green, blue = rng.uniform(0.08, 0.5, 3)
    s.box(0.03, s.height * 0.78, s.width - 0.03, s.height - 0.03, (red, green, blue))
    for z in np.arange(0.06, s.height * 0.72, 0.07):
        half = s.width * rng.uniform(0.4, 0.5)
        s.box(0.05, z, half, z + 0.03, (0.30, 0.30, 0.32))
    s.box(s.width * 0.56, 0.08, s.width - 0.05, s.height * 0.68, (blue, red, green))


def _board(s: Skin, rng: np.random.Generator) -> None:
    s.box(0.03, 0.03, s.width - 0.03, s.height - 0.03, (0.45, 0.33, 0.20))
    for x in np.arange(0.1, s.width - 0.3, 0.3):
        for z in np.arange(0.1, s.height - 0.35, 0.36):
            if rng.random() < 0.75:
                dx, dz = rng.uniform(0, 0.06, 2)
                s.box(x + dx, z + dz, x + dx + 0.2, z + dz + 0.28, WHITE)


def _radiator(s: Skin, rng: np.random.Generator) -> None:
    for x in np.arange(0.03, s.width, 0.09):
        s.box(x, 0.04, x + 0.03, s.height - 0.04, (0.42, 0.42, 0.41))


def _mirror(s: Skin, rng: np.random.Generator) -> None:
    """The opposite wall, painted on: tiles, their border and a door, darker than the real ones."""
    scene = skin(rng, "tiles", s.width, s.height, s.res)
    scene.box(0, s.height * 0.6, s.width, s.height, (0.72, 0.70, 0.64))
    scene.box(0, s.height * 0.58, s.width, s.height * 0.62, (0.16, 0.24, 0.30))
    scene.box(s.width * 0.55, 0, s.width * 0.85, s.height * 0.8, OAK)
    s.albedo[2:-2, 2:-2] = 0.62 * scene.albedo[2:-2, 2:-2]


def _books(s: Skin, rng: np.random.Generator) -> None:
    """Shelves with backs of books and ring binders, some leaning gaps."""
    levels = max(1, round(s.height / 0.36))
    step = s.height / levels
    for level in range(levels):
        x = 0.04
        while x < s.width - 0.06:
            thick = rng.uniform(0.03, 0.09)
            if rng.random() < 0.9:
                tall, hue = rng.uniform(0.6, 0.9) * step, rng.uniform(0.03, 0.42) * rng.uniform(0.4, 1.0, 3)
                s.box(x, level * step, min(x + thick, s.width - 0.04), level * step + tall, hue)
            x += thick + 0.008
        s.box(0, level * step, s.width, level * step + 0.03, OAK)
    for x0, x1 in ((0.0, 0.04), (s.width - 0.04, s.width)):
        s.box(x0, 0, x1, s.height, OAK)
    s.box(0, s.height - 0.03, s.width, s.height, OAK)


def _paper_rack(s: Skin, rng: np.random.Generator) -> None:
    for z in np.arange(0.05, s.height - 0.2, 0.3):
        for x in np.arange(0.05, s.width - 0.2, 0.28):
            if rng.random() < 0.85:
                top = z + rng.uniform(0.06, 0.22)
                s.box(x, z, x + 0.23, top, WHITE)
                s.box(x, z, x + 0.23, z + 0.03, (0.15, 0.3, 0.5))
        s.box(0, z - 0.03, s.width, z, DARK)


def _printer(s: Skin, rng: np.random.Generator) -> None:
    """A copier's front: paper drawers below, output slot, dark head with a lit panel."""
    for i in range(3):
        z = 0.08 + i * 0.16
        s.box(0.02, z, s.width - 0.02, z + 0.145, (0.52, 0.53, 0.53))
        s.box(s.width * 0.35, z + 0.09, s.width * 0.65, z + 0.115, DARK)
    s.box(0.04, s.height * 0.58, s.width - 0.04, s.height * 0.76, DARK)
    s.box(0.08, s.height * 0.58, s.width * 0.75, s.height * 0.62, WHITE)
    s.box(0, s.height - 0.14, s.width, s.height, (0.22, 0.23, 0.25))
    s.box(s.width * 0.6, s.height - 0.11, s.width - 0.05, s.height - 0.03, (0.2, 0.5, 0.7))


def _fronts(s: Skin, rng: np.random.Generator, pitch: float) -> None:
    """Cupboard doors with gaps and handles."""
    count = max(1, round(s.width / pitch))
    step = s.width / count
    for i in range(count):
        s.box(i * step, 0, i * step + 0.012, s.height, (0.12, 0.12, 0.12))
        s.box((i + 0.72) * step, s.height * 0.7, (i + 0.72) * step + 0.03, s.height * 0.9, DARK)
    if s.height > 0.7:
        s.box(0, 0, s.width, 0.08, DARK)
        s.box(0, s.height - 0.05, s.width, s.height, (0.20, 0.19, 0.18))
    s.mottle(rng, 0.3, 0.03)


def _fridge(s: Skin, rng: np.random.Generator) -> None:
    s.box(0, s.height * 0.36, s.width, s.height * 0.36 + 0.025, DARK)
    for z in (s.height * 0.16, s.height * 0.45):
        s.box(0.06, z, 0.10, z + 0.3, STEEL)
    s.box(0, 0, s.width, 0.08, DARK)
    for x, z, colour in ((0.3, 1.2, (0.6, 0.1, 0.1)), (0.42, 1.0, (0.1, 0.4, 0.2)), (0.25, 0.95, (0.7, 0.6, 0.1))):
        s.box(x, z, x + 0.09, z + 0.12, colour)


def _worktop(s: Skin, rng: np.random.Generator) -> None:
    """Seen from above: a steel sink at the left third, four hot plates at the right third."""
    s.mottle(rng, 0.03, 0.15)
    s.box(s.width * 0.12, 0.1, s.width * 0.34, s.height - 0.1, STEEL)
    s.box(s.width * 0.14, 0.16, s.width * 0.24, s.height - 0.16, (0.2, 0.2, 0.21))
    s.box(s.width * 0.66, 0.06, s.width * 0.87, s.height - 0.06, DARK)
    for x in (0.69, 0.79):
        for z in (0.12, s.height - 0.26):
            s.box(s.width * x, z, s.width * x + 0.16, z + 0.15, (0.2, 0.18, 0.18))


def _basins(s: Skin, rng: np.random.Generator) -> None:
    for x in np.arange(0.15, s.width - 0.3, 0.62):
        s.box(x, 0.07, x + 0.44, s.height - 0.08, (0.85, 0.85, 0.85))
        s.box(x + 0.07, 0.13, x + 0.37, s.height - 0.14, (0.62, 0.63, 0.64))


def _desktop(s: Skin, rng: np.random.Generator) -> None:
    """Seen from above: wood with papers, a keyboard and a cup."""
    _wood(s, rng)
    s.albedo[:] *= 1.25
    for _ in range(max(2, round(3 * s.width * s.height))):
        x, z = rng.uniform(0.05, max(0.06, s.width - 0.3)), rng.uniform(0.03, max(0.04, s.height - 0.25))
        s.box(x, z, x + 0.21, z + 0.2, WHITE)
    s.box(s.width * 0.42, 0.1, s.width * 0.42 + 0.44, 0.24, DARK)


def _screen(s: Skin, rng: np.random.Generator) -> None:
    """A monitor that is on by day and by night: it shines with the sky or with the lamps, whichever there is."""
    s.box(0.03, 0.05, s.width - 0.03, s.height - 0.03, 0.16, s.lamp)
    s.box(0.08, 0.12, s.width - 0.15, s.height - 0.1, 0.34, s.lamp)
    s.day[:] = 0.7 * s.lamp


def _cubicle(s: Skin, rng: np.random.Generator) -> None:
    """A row of toilet cubicles: panels, doors, locks."""
    count = max(1, round(s.width / 0.95))
    step = s.width / count
    for i in range(count):
        s.box(i * step + 0.12, 0, (i + 1) * step - 0.12, s.height - 0.06, (0.42, 0.50, 0.56))
        s.box(i * step + 0.12, 0, i * step + 0.14, s.height - 0.06, DARK)
        s.box((i + 1) * step - 0.14, 0, (i + 1) * step - 0.12, s.height - 0.06, DARK)
        s.box((i + 1) * step - 0.24, s.height * 0.45, (i + 1) * step - 0.17, s.height * 0.5, STEEL)


def _leaves(s: Skin, rng: np.random.Generator) -> None:
    for _ in range(round(260 * s.width * s.height)):
        x, z, green = rng.uniform(0, s.width), rng.uniform(0, s.height), rng.uniform(0.1, 0.3)
        s.box(x, z, x + 0.05, z + 0.09, (green * 0.45, green, green * 0.35))


def _extinguisher(s: Skin, rng: np.random.Generator) -> None:
    s.box(s.width * 0.2, 0, s.width * 0.8, s.height * 0.75, (0.55, 0.03, 0.03))
    s.box(s.width * 0.35, s.height * 0.75, s.width * 0.65, s.height * 0.9, DARK)
    s.box(s.width * 0.25, s.height * 0.3, s.width * 0.75, s.height * 0.5, WHITE)


def _switch(s: Skin, rng: np.random.Generator) -> None:
    s.box(s.width * 0.25, s.height * 0.2, s.width * 0.75, s.height * 0.8, (0.55, 0.55, 0.54))


# What a skin is made of before it is painted, and what paints it.
PAINTERS: dict[str, tuple[Colour, Callable[[Skin, np.random.Generator], None]]] = {
    "plaster": ((0.74, 0.71, 0.64), _plaster),
    "tiles": ((0.74, 0.76, 0.76), partial(_grid, pitch=0.15, joint=GROUT, spread=0.06)),
    "tiled": ((0.74, 0.71, 0.64), partial(_tiled_wall, top=1.9)),
    "half tiled": ((0.74, 0.71, 0.64), partial(_tiled_wall, top=1.5)),
    "floor tiles": ((0.27, 0.28, 0.29), partial(_grid, pitch=0.3, joint=(0.12, 0.12, 0.12), spread=0.12)),
    "checker": ((0.50, 0.46, 0.38), _checker),
    "parquet": (OAK, _parquet),
    "carpet": ((0.24, 0.25, 0.29), partial(_plain, cell=0.03, amount=0.18)),
    "lino": ((0.30, 0.33, 0.35), _lino),
    "ceiling": ((0.72, 0.72, 0.70), partial(_grid, pitch=0.6, joint=(0.50, 0.50, 0.49), spread=0.03)),
    "panel lamp": (STEEL, _panel_lamp),
    "wood": (OAK, _wood),
    "door": (OAK, _door),
    "closed door": ((0.24, 0.26, 0.29), _closed_door),
    "jamb": ((0.24, 0.26, 0.29), _plain),
    "window": ((0.78, 0.78, 0.77), _window),
    "frosted": ((0.78, 0.78, 0.77), _frosted),
    "poster": ((0.70, 0.70, 0.68), _poster),
    "board": ((0.30, 0.32, 0.34), _board),
    "white": (WHITE, partial(_plain, cell=0.2, amount=0.03)),
    "ceramic": ((0.82, 0.83, 0.82), partial(_plain, cell=0.2, amount=0.03)),
    "grey": ((0.34, 0.35, 0.37), _plain),
    "steel": (STEEL, partial(_plain, cell=0.1, amount=0.05)),
    "dark": (DARK, _plain),
    "fabric": ((0.09, 0.14, 0.26), partial(_plain, cell=0.04, amount=0.15)),
    "red": ((0.55, 0.05, 0.04), _plain),
    "blue panel": ((0.22, 0.32, 0.42), partial(_plain, cell=0.3, amount=0.03)),
    "radiator": (WHITE, _radiator),
    "mirror": (STEEL, _mirror),
    "books": ((0.10, 0.07, 0.05), _books),
    "paper rack": ((0.28, 0.29, 0.31), _paper_rack),
    "printer": ((0.60, 0.61, 0.60), _printer),
    "kitchen fronts": ((0.62, 0.58, 0.48), partial(_fronts, pitch=0.6)),
    "cabinet": ((0.36, 0.38, 0.40), partial(_fronts, pitch=0.5)),
    "cupboard": (OAK, partial(_fronts, pitch=0.6)),
    "fridge": (WHITE, _fridge),
    "worktop": ((0.30, 0.28, 0.25), _worktop),
    "basins": ((0.36, 0.37, 0.38), _basins),
    "desktop": (OAK, _desktop),
    "screen": (DARK, _screen),
    "cubicle": ((0.22, 0.32, 0.42), _cubicle),
    "leaves": ((0.03, 0.07, 0.03), _leaves),
    "extinguisher": ((0.74, 0.71, 0.64), _extinguisher),
    "switch": (WHITE, _switch),
}
