"""The laboratory itself: rooms, walls with their doorways, what hangs on them, and where light comes from.

Metres; x to the east along the corridor, y to the north, z up; the layout follows where COLD's robot drove in part B
of Saarbruecken: a corridor, the toilet and the kitchen north of it, the office south, the printer area at its end.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

CEILING = 2.6
LINTEL = 2.1

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Room:
    """A rectangle of floor with its surfaces; `lamps` are ceiling panels (x, y), switched per illumination."""

    name: str
    x0: float
    y0: float
    x1: float
    y1: float
    wall: str
    floor: str
    lamps: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Doorway:
    """An opening between two rooms in the wall strip y0..y1 from x0 to x1, `top` metres high."""

    x0: float
    x1: float
    y0: float
    y1: float
    top: float


@dataclass(frozen=True)
class Fixture:
    """Something flat on a wall: `at` is metres from the wall's left end as seen from inside the room."""

    room: str
    side: str
    kind: str
    at: float
    bottom: float
    width: float
    height: float


@dataclass(frozen=True)
class Panel:
    """A rectangle in space: upper left corner, edge along its width, edge down its height, and its skin's name.

    `room` says whose light falls on it; `parts` are fixtures pasted on its skin as (kind, x, z, width, height).
    """

    skin: str
    room: str
    corner: Point
    across: Point
    down: Point
    parts: tuple[tuple[str, float, float, float, float], ...] = ()

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in metres."""
        return math.hypot(*self.across), math.hypot(*self.down)


ROOMS = (
    Room("corridor", -7.0, -1.0, 7.4, 1.0, "plaster", "lino", tuple((x, 0.0) for x in (-6, -3.5, -1, 1.5, 4, 6.4))),
    Room("printer", -7.0, 1.2, -4.5, 3.7, "plaster", "lino", ((-5.8, 2.5),)),
    Room("washroom", 0.6, 1.2, 3.2, 3.1, "tiled", "floor tiles", ((1.9, 2.1),)),
    Room("toilet", 0.6, 3.3, 3.2, 6.5, "tiled", "floor tiles", ((1.9, 4.3),)),
    Room("kitchen", 3.6, 1.2, 7.4, 5.8, "half tiled", "checker", ((4.6, 2.6), (6.3, 2.6), (4.6, 4.4), (6.3, 4.4))),
    Room("office", -0.9, -5.6, 2.3, -1.2, "plaster", "parquet", ((0.7, -2.5), (0.7, -4.3))),
)

DOORWAYS = (
    Doorway(-6.9, -5.3, 1.0, 1.2, 2.3),
    Doorway(1.55, 2.5, 1.0, 1.2, LINTEL),
    Doorway(1.6, 2.55, 3.1, 3.3, LINTEL),
    Doorway(5.1, 6.1, 1.0, 1.2, LINTEL),
    Doorway(0.3, 1.25, -1.2, -1.0, LINTEL),
)

WINDOW_KINDS = ("window", "frosted")


# Where the builder put doors, windows and what is screwed to the walls.
FIXED = (
    Fixture("corridor", "west", "window", 0.45, 0.9, 1.1, 1.3),
    Fixture("corridor", "east", "window", 0.45, 0.9, 1.1, 1.3),
    Fixture("corridor", "north", "closed door", 3.2, 0.0, 1.06, 2.1),
    Fixture("corridor", "north", "closed door", 5.9, 0.0, 1.06, 2.1),
    Fixture("corridor", "south", "closed door", 2.0, 0.0, 1.06, 2.1),
    Fixture("corridor", "south", "closed door", 9.4, 0.0, 1.06, 2.1),
    Fixture("corridor", "south", "closed door", 12.3, 0.0, 1.06, 2.1),
    Fixture("printer", "west", "window", 0.7, 0.9, 1.2, 1.3),
    Fixture("printer", "west", "radiator", 0.75, 0.12, 1.1, 0.6),
    Fixture("washroom", "west", "mirror", 0.25, 1.05, 1.3, 0.8),
    Fixture("washroom", "east", "white", 0.45, 1.1, 0.3, 0.4),
    Fixture("washroom", "east", "steel", 1.1, 1.15, 0.26, 0.3),
    Fixture("toilet", "west", "frosted", 0.6, 1.35, 0.9, 0.85),
    Fixture("kitchen", "north", "window", 1.15, 1.15, 0.95, 1.0),
    Fixture("kitchen", "east", "window", 1.3, 0.9, 2.2, 1.35),
    Fixture("kitchen", "east", "radiator", 1.7, 0.12, 1.4, 0.6),
    Fixture("office", "south", "window", 0.45, 0.9, 2.25, 1.35),
    Fixture("office", "south", "radiator", 0.7, 0.12, 1.6, 0.6),
    Fixture("corridor", "north", "switch", 8.3, 1.1, 0.09, 0.09),
    Fixture("washroom", "south", "switch", 0.3, 1.1, 0.09, 0.09),
    Fixture("office", "north", "switch", 2.4, 1.1, 0.09, 0.09),
)

# What people hang up: no two laboratories have it in quite the same places.
HUNG = (
    Fixture("corridor", "north", "board", 4.55, 1.0, 1.1, 1.0),
    Fixture("corridor", "north", "poster", 7.5, 1.05, 0.6, 0.85),
    Fixture("corridor", "north", "poster", 10.9, 1.05, 0.7, 1.0),
    Fixture("corridor", "south", "poster", 4.2, 1.05, 0.7, 1.0),
    Fixture("corridor", "south", "board", 7.4, 1.0, 1.3, 1.0),
    Fixture("corridor", "south", "extinguisher", 8.95, 0.9, 0.22, 0.6),
    Fixture("corridor", "south", "poster", 10.9, 1.05, 0.6, 0.85),
    Fixture("printer", "east", "board", 0.5, 1.15, 1.2, 0.9),
    Fixture("printer", "north", "poster", 1.65, 1.25, 0.55, 0.8),
    Fixture("kitchen", "west", "board", 2.2, 1.5, 1.1, 0.8),
    Fixture("kitchen", "west", "poster", 0.6, 1.55, 0.6, 0.8),
    Fixture("kitchen", "south", "poster", 0.25, 1.5, 0.6, 0.8),
    Fixture("office", "west", "poster", 3.4, 1.1, 0.6, 0.85),
    Fixture("office", "east", "board", 1.4, 1.2, 1.2, 0.9),
    Fixture("office", "north", "poster", 0.2, 1.1, 0.6, 0.85),
)


def place(x: float, y: float) -> str:
    """COLD's label of a point on the floor; doorways are split in the middle of the wall, as in COLD's files."""
    if abs(y) <= 1.1:
        return "CR-B"
    if y < 0:
        return "1PO-B"
    return "PA-B" if x < -4.0 else "TL-B" if x < 3.4 else "KT-B"


def walls(rng: np.random.Generator) -> list[Panel]:
    """Every wall of every room, facing inwards and cut by the doorways, with its fixtures; `rng` moves what is hung."""
    hung = FIXED + tuple(replace(f, at=f.at + float(rng.uniform(-0.12, 0.12))) for f in HUNG)
    panels: list[Panel] = []
    for r in ROOMS:
        sides = {
            "north": ((r.x0, r.y1), (r.x1, r.y1)),
            "east": ((r.x1, r.y1), (r.x1, r.y0)),
            "south": ((r.x1, r.y0), (r.x0, r.y0)),
            "west": ((r.x0, r.y0), (r.x0, r.y1)),
        }
        for side, (start, end) in sides.items():
            panels += _wall(r, start, end, [f for f in hung if f.room == r.name and f.side == side])
    return panels + [panel for d in DOORWAYS for panel in _jambs(d)]


def _wall(r: Room, start: tuple[float, float], end: tuple[float, float], hung: list[Fixture]) -> list[Panel]:
    (x0, y0), (x1, y1) = start, end
    length = abs(x1 - x0) + abs(y1 - y0)
    dx, dy = (x1 - x0) / length, (y1 - y0) / length
    doors = [d for d in DOORWAYS if dy == 0 and r.x0 <= d.x0 and d.x1 <= r.x1 and y0 in (d.y0, d.y1)]
    holes = sorted((sorted(((d.x0 - x0) * dx, (d.x1 - x0) * dx)), d.top) for d in doors)
    # From left to right: (from, to, lower edge); above a doorway only the lintel remains.
    strips, reached = [], 0.0
    for (left, right), top in holes:
        strips += [(reached, left, 0.0), (left, right, top)]
        reached = right
    strips.append((reached, length, 0.0))
    panels = []
    for left, right, low in strips:
        parts = tuple((f.kind, f.at - left, f.bottom - low, f.width, f.height) for f in hung)
        corner = (x0 + dx * left, y0 + dy * left, CEILING)
        across = (dx * (right - left), dy * (right - left), 0.0)
        panels.append(Panel(r.wall, r.name, corner, across, (0.0, 0.0, low - CEILING), parts=parts))
    return panels


def _jambs(d: Doorway) -> list[Panel]:
    down = (0.0, 0.0, -d.top)
    deep = d.y1 - d.y0
    return [
        Panel("jamb", "corridor", (d.x0, d.y0, d.top), (0.0, deep, 0.0), down),
        Panel("jamb", "corridor", (d.x1, d.y1, d.top), (0.0, -deep, 0.0), down),
        Panel("jamb", "corridor", (d.x0, d.y0, d.top), (d.x1 - d.x0, 0.0, 0.0), (0.0, deep, 0.0)),
    ]


def outline(panels: list[Panel]) -> NDArray[np.float64]:
    """The upright panels that a robot can bump into, as ground segments (n, 4): x0 y0 x1 y1."""
    low = [p for p in panels if p.down[2] < 0 and p.corner[2] + p.down[2] < 1.3]
    return np.array([(p.corner[0], p.corner[1], p.corner[0] + p.across[0], p.corner[1] + p.across[1]) for p in low])
