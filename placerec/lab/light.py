"""How light falls: three illuminations, lamps and windows of each room, and the patches of the sun."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from placerec.lab.world import CEILING, ROOMS, WINDOW_KINDS, Panel, Room

Array = NDArray[np.float32]

# Furthest sample of the light from its neighbours on a panel, in metres: light is smooth, patches of sun are not.
GRAIN = 0.06


@dataclass(frozen=True)
class Illumination:
    """Radiance of the sky through a pane, of the sun on what it hits, and of lamps per room that are on.

    `sun` is the direction to the sun; `exposure` and `noise` (grey levels) are the camera's.
    """

    sky: float
    sunlight: float
    sun: tuple[float, float, float]
    lamps: dict[str, float]
    tint: tuple[float, float, float]
    exposure: float
    noise: float


def _sun(azimuth: float, elevation: float) -> tuple[float, float, float]:
    a, e = np.radians(azimuth), np.radians(elevation)
    return float(np.cos(e) * np.cos(a)), float(np.cos(e) * np.sin(a)), float(np.sin(e))


INDOORS = {"corridor": 0.8, "washroom": 1.0, "toilet": 0.7}
ALL_ON = {"corridor": 0.75, "washroom": 1.0, "toilet": 0.9, "printer": 0.8, "kitchen": 0.9, "office": 0.8}

ILLUMINATIONS = {
    "cloudy": Illumination(1.5, 0.0, _sun(235, 35), INDOORS, (1.0, 1.0, 1.0), 1.0, 2.0),
    "night": Illumination(0.01, 0.0, _sun(235, 35), ALL_ON, (1.06, 1.0, 0.84), 0.72, 3.2),
    "sunny": Illumination(2.8, 6.0, _sun(232, 33), INDOORS, (1.03, 1.0, 0.95), 1.15, 1.8),
}


def illumination(weather: str, rng: np.random.Generator) -> Illumination:
    """The light of one run: the hour moves the sun, clouds and people with light switches change the rest."""
    base = ILLUMINATIONS[weather]
    lamps = {name: value * float(rng.uniform(0.9, 1.1)) for name, value in base.lamps.items()}
    if weather != "night" and rng.random() < 0.35:
        lamps["printer"] = 0.5
    return replace(
        base,
        sky=base.sky * float(rng.uniform(0.85, 1.15)),
        sun=_sun(float(rng.uniform(225, 243)), float(rng.uniform(28, 38))),
        lamps=lamps,
        exposure=base.exposure * float(rng.uniform(0.95, 1.05)),
    )


@dataclass(frozen=True)
class Opening:
    """A window as a source of light: corner, edges, unit normal into its room; frosted glass scatters the sun."""

    corner: Array
    across: Array
    down: Array
    normal: Array
    clear: bool

    @property
    def area(self) -> float:
        return float(np.linalg.norm(self.across) * np.linalg.norm(self.down))


def openings(panels: Sequence[Panel]) -> dict[str, list[Opening]]:
    """The windows of each room, found among the parts of its walls."""
    found: dict[str, list[Opening]] = {r.name: [] for r in ROOMS}
    for panel in panels:
        corner, across, down = (np.array(v, np.float32) for v in (panel.corner, panel.across, panel.down))
        length, height = panel.size
        for kind, x, z, wide, high in panel.parts:
            if kind in WINDOW_KINDS and x >= 0 and x + wide <= length:
                unit = across / length
                start = corner + unit * x + down * (1 - (z + high) / height)
                normal = np.array([unit[1], -unit[0], 0], np.float32)
                edge = np.array([0, 0, -high], np.float32)
                found[panel.room].append(Opening(start, unit * wide, edge, normal, kind == "window"))
    return found


def irradiance(panels: Sequence[Panel], light: Illumination) -> list[Array]:
    """What reaches each panel, on a coarse grid (rows, columns, 3): lamps, sky and sun of its own room."""
    windows = openings(panels)
    result: list[Array] = [np.empty(0, np.float32)] * len(panels)
    for r in ROOMS:
        # A room at a time: there are hundreds of small panels, and one call for all their points is quick.
        mine = [i for i, panel in enumerate(panels) if panel.room == r.name]
        grids = [_grid(panels[i]) for i in mine]
        points = np.concatenate([g.reshape(-1, 3) for g, _ in grids])
        normals = np.concatenate([np.broadcast_to(n, (g.size // 3, 3)) for g, n in grids])
        amount = _received(points, normals, r, windows[r.name], light)
        cuts = np.cumsum([g.size // 3 for g, _ in grids])[:-1]
        for i, (grid, _), part in zip(mine, grids, np.split(amount, cuts), strict=True):
            result[i] = part.reshape(grid.shape[:2])[..., None] * np.array(light.tint, np.float32)
    return result


def _received(points: Array, normals: Array, room: Room, windows: list[Opening], light: Illumination) -> Array:
    total = np.zeros(len(points), np.float32)
    lamp = light.lamps.get(room.name, 0.0)
    for x, y in room.lamps if lamp else ():
        total += 1.9 * lamp * _falloff(points, normals, np.array([x, y, CEILING - 0.02]), np.array([0, 0, -1]))
    for w in windows:
        total += 1.5 * light.sky * w.area * _falloff(points, normals, w.corner + (w.across + w.down) / 2, w.normal)
    # Light that bounces between the walls: in proportion to what comes in, over the room's surface.
    floor = (room.x1 - room.x0) * (room.y1 - room.y0)
    total += (1.3 * lamp * len(room.lamps) + 1.1 * light.sky * sum(w.area for w in windows)) / (floor + 4)
    # Doors let in a little of the neighbours' light.
    total += 0.03 + 0.04 * min(light.sky, 1.5)
    total *= _corners(points, normals, room)
    if light.sunlight:
        for w in (w for w in windows if w.clear):
            total += light.sunlight * _patch(points, normals, w, light.sun)
    return total


def _grid(panel: Panel) -> tuple[Array, Array]:
    """Points on a panel (rows, columns, 3) and its unit normal."""
    corner, across, down = (np.array(v, np.float32) for v in (panel.corner, panel.across, panel.down))
    width, height = panel.size
    columns, rows = max(2, round(width / GRAIN)), max(2, round(height / GRAIN))
    u, v = (np.arange(columns, dtype=np.float32) + 0.5) / columns, (np.arange(rows, dtype=np.float32) + 0.5) / rows
    points = np.asarray(corner + u[None, :, None] * across + v[:, None, None] * down, np.float32)
    (a, b, c), (d, e, f) = panel.across, panel.down
    normal = np.array([c * e - b * f, a * f - c * d, b * d - a * e], np.float32)
    return points, np.asarray(normal / (width * height), np.float32)


def _dot(a: Array, b: Array) -> Array:
    """Scalar products along the last axis: not BLAS, whose rounding may depend on its number of threads."""
    return np.asarray(a[:, 0] * b[..., 0] + a[:, 1] * b[..., 1] + a[:, 2] * b[..., 2], np.float32)


def _falloff(points: Array, normals: Array, source: NDArray[np.floating], facing: NDArray[np.floating]) -> Array:
    way = source.astype(np.float32) - points
    square = _dot(way, way)
    leaving = -_dot(way, facing.astype(np.float32))
    arriving = _dot(way, normals)
    # Fabric and plaster scatter: a surface turned away from the source still gets a part.
    cosines = np.maximum(leaving, 0) * np.maximum(arriving + 0.15 * np.sqrt(square), 0)
    return np.asarray(cosines / (square * (square + 0.6)), np.float32)


def _corners(points: Array, normals: Array, room: Room) -> Array:
    """Corners are darker: 1 in the open, 0.7 where two surfaces meet."""
    shade = np.ones(len(points), np.float32)
    for axis, low, high in ((0, room.x0, room.x1), (1, room.y0, room.y1), (2, 0.0, CEILING)):
        gap = np.minimum(np.abs(points[:, axis] - low), np.abs(points[:, axis] - high))
        # What lies in a wall or faces it is not its corner.
        shade *= np.where(np.abs(normals[:, axis]) > 0.9, 1, 1 - 0.3 * np.exp(-gap / 0.18))
    return shade


def _patch(points: Array, normals: Array, window: Opening, sun: tuple[float, float, float]) -> Array:
    """How much of the sun comes through the window to each point: 0 in the shadow."""
    towards = np.array(sun, np.float32)
    through = float(window.normal @ towards)
    if through >= 0:
        return np.zeros(len(points), np.float32)
    way = _dot(window.corner - points, window.normal) / through
    hit = points + way[:, None] * towards - window.corner
    across, down = float(window.across @ window.across), float(window.down @ window.down)
    u, v = _dot(hit, window.across) / across, _dot(hit, window.down) / down
    panes = max(1, round(across**0.5 / 0.75))
    # Distances in metres to the glass's border and to the bars; the sun is no point, so edges are a little soft.
    border = np.minimum(np.minimum(u, 1 - u) * across**0.5, np.minimum(v, 1 - v) * down**0.5)
    bars = np.minimum(np.abs(u * panes - np.round(u * panes)) * across**0.5 / panes, np.abs(v - 0.28) * down**0.5)
    glass = np.clip(np.minimum(border, bars) / 0.08 - 0.3, 0, 1)
    return np.asarray(np.where(way > 0, glass * np.maximum(_dot(normals, towards), 0), 0), np.float32)
