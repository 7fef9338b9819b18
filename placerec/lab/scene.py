"""One run's scene, ready for the camera: panels as arrays, and an atlas of their lit surfaces in one picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.lab.furniture import furniture
from placerec.lab.light import Illumination, irradiance
from placerec.lab.textures import Skin, skin
from placerec.lab.world import CEILING, ROOMS, Panel, walls

Array = NDArray[np.float32]

# The atlas holds radiance as 255 * sqrt(radiance / BRIGHTEST): eight bits with room for windows and the sun.
BRIGHTEST = 4.0
ATLAS_WIDTH = 2048
# Edge pixels repeated around every surface, so that interpolation never mixes neighbours of the atlas.
BORDER = 2


@dataclass(frozen=True)
class Paint:
    """Every panel's skin and its upper left corner (x, y) in the atlas; the same for all runs of a laboratory."""

    res: float
    skins: tuple[Skin, ...]
    spots: tuple[tuple[int, int], ...]
    rows: int


@dataclass(frozen=True)
class Panels:
    """n panels as arrays: corner, across, down (n, 3), metres, and their corner in the atlas (n, 2), pixels."""

    corner: Array
    across: Array
    down: Array
    spot: Array


@dataclass(frozen=True)
class Scene:
    """What the camera looks at: the lit atlas (h, w, 3) uint8 RGB, upright and level panels.

    `closed` (n,) marks the upright panels from floor to ceiling, behind which nothing is seen.
    """

    res: float
    atlas: NDArray[np.uint8]
    upright: Panels
    level: Panels
    closed: NDArray[np.bool_]


def panels_of_run(seed: int, rng: np.random.Generator) -> list[Panel]:
    """All panels of a run in a fixed order: walls as the seed builds them, furniture as `rng` leaves it."""
    return walls(np.random.default_rng([seed, 1])) + _surfaces() + furniture(rng)


def paint(panels: Sequence[Panel], seed: int, res: float) -> Paint:
    """Paint all panels' skins at `res` pixels per metre and give each its place in the atlas."""
    skins = tuple(_skin(panel, np.random.default_rng([seed, 2, i]), res) for i, panel in enumerate(panels))
    # Shelf packing, tallest first: rows of the atlas fill from the left.
    spots = [(0, 0)] * len(skins)
    x = y = tall = 0
    for i in sorted(range(len(skins)), key=lambda i: -skins[i].day.shape[0]):
        rows, columns = (n + 2 * BORDER for n in skins[i].day.shape)
        if x + columns > ATLAS_WIDTH and x > 0:
            x, y, tall = 0, y + tall, 0
        spots[i] = (x + BORDER, y + BORDER)
        x, tall = x + columns, max(tall, rows)
    return Paint(res, skins, tuple(spots), y + tall)


def light_up(panels: Sequence[Panel], painted: Paint, light: Illumination) -> Scene:
    """Light the painted panels of one run."""
    widest = max(s.day.shape[1] for s in painted.skins) + 2 * BORDER
    atlas = np.zeros((painted.rows, max(ATLAS_WIDTH, widest), 3), np.uint8)
    received = irradiance(panels, light)
    for panel, look, (x, y), amount in zip(panels, painted.skins, painted.spots, received, strict=True):
        rows, columns = look.day.shape
        lit = np.asarray(cv2.resize(amount, (columns, rows)), np.float32)
        lit *= look.albedo
        lit += (light.sky * look.day + 2.5 * look.lamp * min(1.0, light.lamps.get(panel.room, 0.1)))[..., None]
        coded = np.sqrt(np.minimum(lit * np.float32(255.0**2 / BRIGHTEST), np.float32(255.0**2))).astype(np.uint8)
        tile = cv2.copyMakeBorder(coded, BORDER, BORDER, BORDER, BORDER, cv2.BORDER_REPLICATE)
        atlas[y - BORDER : y + rows + BORDER, x - BORDER : x + columns + BORDER] = tile
    upright = np.array([p.down[2] != 0 for p in panels])
    standing = _arrays(panels, painted, upright)
    closed = (standing.corner[:, 2] > CEILING - 0.01) & (standing.corner[:, 2] + standing.down[:, 2] < 0.01)
    return Scene(painted.res, atlas, standing, _arrays(panels, painted, ~upright), closed)


def _arrays(panels: Sequence[Panel], painted: Paint, chosen: NDArray[np.bool_]) -> Panels:
    pairs = [(p, s) for p, s, c in zip(panels, painted.spots, chosen, strict=True) if c]
    edges = [(p.corner, p.across, p.down) for p, _ in pairs]
    corner, across, down = np.moveaxis(np.array(edges, np.float32), 1, 0)
    return Panels(corner, across, down, np.array([s for _, s in pairs], np.float32))


def _surfaces() -> list[Panel]:
    """Floor and ceiling of each room, reaching half a wall into its doorways."""
    panels = []
    for r in ROOMS:
        y0, y1 = r.y0 - 0.1, r.y1 + 0.1
        wide, deep = r.x1 - r.x0, y1 - y0
        panels.append(Panel(r.floor, r.name, (r.x0, y1, 0.0), (wide, 0.0, 0.0), (0.0, -deep, 0.0)))
        # A panel faces where across x -down points, so a ceiling starts in the south.
        lamps = tuple(("panel lamp", x - r.x0 - 0.6, y1 - y - 0.15, 1.2, 0.3) for x, y in r.lamps)
        panels.append(Panel("ceiling", r.name, (r.x0, y0, CEILING), (wide, 0.0, 0.0), (0.0, deep, 0.0), parts=lamps))
    return panels


def _skin(panel: Panel, rng: np.random.Generator, res: float) -> Skin:
    base = skin(rng, panel.skin, *panel.size, res)
    for kind, x, z, width, height in panel.parts:
        base.paste(skin(rng, kind, width, height, res), x, z)
    return base
