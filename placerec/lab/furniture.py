"""What stands in the rooms. Chairs, bins and door leaves stand a little differently in every run."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from placerec.lab.world import LINTEL, Panel, Point

Centre = tuple[float, float]
Size = tuple[float, float, float]
Skins = dict[str, str]
Near = Callable[[float, float], Centre]


def block(centre: Centre, size: Size, z: float, skins: Skins, turn: float = 0.0) -> list[Panel]:
    """The visible faces of a box that is in no room yet.

    `size` is width, depth and height, `z` the lower edge, `turn` in radians. `skins` names the skin of "n", "e", "s",
    "w" (before turning), "top" and "bottom"; "" stands for the others.
    """
    half, deep, high = size[0] / 2, size[1] / 2, size[2]
    cos, sin = float(np.cos(turn)), float(np.sin(turn))

    def corner(x: float, y: float, at: float) -> Point:
        return centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y, at

    def face(name: str, a: Point, b: Point, c: Point) -> Panel:
        across, down = (tuple(q - p for p, q in zip(a, end, strict=True)) for end in (b, c))
        kind = skins.get(name, skins[""])
        return Panel(kind, "", a, (across[0], across[1], across[2]), (down[0], down[1], down[2]))

    ground = {"n": (half, deep), "e": (half, -deep), "s": (-half, -deep), "w": (-half, deep)}
    following = {"n": "w", "e": "n", "s": "e", "w": "s"}
    faces = []
    for name, (x, y) in ground.items():
        a, b = corner(x, y, z + high), corner(*ground[following[name]], z + high)
        faces.append(face(name, a, b, (a[0], a[1], z)))
    top = z + high
    faces.append(face("top", corner(-half, deep, top), corner(half, deep, top), corner(-half, -deep, top)))
    if z > 0:
        faces.append(face("bottom", corner(-half, -deep, z), corner(half, -deep, z), corner(-half, deep, z)))
    return faces


def table(centre: Centre, size: Size, top: str) -> list[Panel]:
    """A table on four legs."""
    width, depth, high = size
    panels = block(centre, (width, depth, 0.04), high - 0.04, {"": "wood", "top": top})
    for x in (-1, 1):
        for y in (-1, 1):
            foot = (centre[0] + x * (width / 2 - 0.05), centre[1] + y * (depth / 2 - 0.05))
            panels += block(foot, (0.05, 0.05, high - 0.04), 0, {"": "steel"})
    return panels


def chair(centre: Centre, turn: float, cover: str) -> list[Panel]:
    """A chair whose back is to the north before turning."""
    cos, sin = float(np.cos(turn)), float(np.sin(turn))
    back = (centre[0] - sin * 0.2, centre[1] + cos * 0.2)
    return (
        block(centre, (0.42, 0.42, 0.06), 0.41, {"": cover}, turn)
        + block(back, (0.40, 0.04, 0.42), 0.5, {"": cover}, turn)
        + block(centre, (0.06, 0.06, 0.37), 0.04, {"": "steel"}, turn)
        + block(centre, (0.40, 0.06, 0.04), 0.0, {"": "dark"}, turn)
        + block(centre, (0.06, 0.40, 0.04), 0.0, {"": "dark"}, turn)
    )


def leaf(hinge: Centre, width: float, angle: float) -> list[Panel]:
    """An open door: `angle` is the direction from its hinge, in radians from east."""
    middle = (hinge[0] + np.cos(angle) * width / 2, hinge[1] + np.sin(angle) * width / 2)
    return block(middle, (width, 0.04, LINTEL - 0.05), 0, {"": "door", "e": "steel", "w": "steel"}, angle)


def plant(centre: Centre, high: float) -> list[Panel]:
    """A pot with a bush of three boxes of leaves."""
    panels = block(centre, (0.3, 0.3, 0.3), 0, {"": "red"})
    for size, low, turn in ((0.42, 0.35, 0.2), (0.34, 0.75, 0.9), (0.2, 1.0, 0.5)):
        if low < high - 0.2:
            panels += block(centre, (size, size, min(0.5, high - low)), low, {"": "leaves"}, turn)
    return panels


def furniture(rng: np.random.Generator) -> list[Panel]:
    """All furniture of one run; `rng` shifts and turns what people move."""

    def near(x: float, y: float) -> Centre:
        return x + float(rng.uniform(-0.05, 0.05)), y + float(rng.uniform(-0.05, 0.05))

    def about(low: float, high: float) -> float:
        return float(np.radians(rng.uniform(low, high)))

    rooms = {
        "corridor": _corridor(near),
        "printer": _printer_area(near, about(-20, 20)),
        "washroom": _washroom(near, about(62, 82)),
        "toilet": _toilet(near),
        "kitchen": _kitchen(near, [about(-25, 25) for _ in range(4)], about(155, 172)),
        "office": _office(near, about(60, 120), about(-70, -35)),
    }
    return [replace(panel, room=room) for room, panels in rooms.items() for panel in panels]


def _corridor(near: Near) -> list[Panel]:
    return (
        block((-2.3, 0.83), (1.2, 0.34, 0.85), 0, {"": "wood", "s": "cupboard"})
        + plant(near(6.95, 0.62), 1.3)
        + block(near(3.3, 0.82), (0.26, 0.26, 0.55), 0, {"": "steel", "top": "dark"})
    )


def _printer_area(near: Near, turn: float) -> list[Panel]:
    return (
        block((-6.15, 3.35), (0.75, 0.65, 1.1), 0, {"": "white", "s": "printer"})
        + block((-4.95, 3.45), (0.85, 0.45, 1.8), 0, {"": "grey", "s": "paper rack"})
        + table((-4.83, 2.2), (0.62, 1.3, 0.74), "desktop")
        + block(near(-4.82, 2.45), (0.4, 0.42, 0.3), 0.74, {"": "white", "w": "printer"}, turn)
        + block(near(-6.8, 3.3), (0.3, 0.3, 0.5), 0, {"": "blue panel", "top": "dark"})
    )


def _washroom(near: Near, door: float) -> list[Panel]:
    return (
        block((0.85, 2.2), (0.5, 1.6, 0.12), 0.75, {"": "white", "top": "basins"})
        + block((0.9, 2.2), (0.36, 1.5, 0.75), 0, {"": "cabinet"})
        + block(near(3.0, 2.85), (0.28, 0.28, 0.6), 0, {"": "steel", "top": "dark"})
        + leaf((2.5, 1.22), 0.92, door)
    )


def _toilet(near: Near) -> list[Panel]:
    urinals = [one for y in (3.85, 4.5) for one in block((3.05, y), (0.3, 0.36, 0.65), 0.55, {"": "ceramic"})]
    screens = [one for y in (4.18, 4.82) for one in block((2.98, y), (0.42, 0.03, 1.0), 0.6, {"": "blue panel"})]
    return (
        block((1.9, 5.95), (2.6, 1.1, 1.9), 0.12, {"": "blue panel", "s": "cubicle"})
        + urinals
        + screens
        + block(near(0.8, 5.1), (0.25, 0.25, 0.4), 0, {"": "white", "top": "dark"})
        + block((0.72, 4.95), (0.22, 0.3, 0.35), 1.0, {"": "ceramic"})
    )


def _kitchen(near: Near, turns: list[float], door: float) -> list[Panel]:
    seats = ((5.35, 2.42, np.pi), (5.35, 4.18, 0.0), (4.72, 3.3, np.pi / 2), (5.98, 3.3, -np.pi / 2))
    chairs = [chair(near(x, y), way + turn, "red") for (x, y, way), turn in zip(seats, turns, strict=True)]
    return (
        block((5.0, 5.5), (2.8, 0.6, 0.9), 0, {"": "white", "s": "kitchen fronts", "top": "worktop"})
        + block((4.15, 5.62), (1.1, 0.36, 0.65), 1.45, {"": "white", "s": "kitchen fronts"})
        + block((6.05, 5.62), (0.9, 0.36, 0.65), 1.45, {"": "white", "s": "kitchen fronts"})
        + block((6.95, 5.47), (0.65, 0.62, 1.75), 0, {"": "white", "s": "fridge"})
        + block(near(4.0, 5.5), (0.3, 0.22, 0.26), 0.9, {"": "steel", "s": "dark"})
        + table((5.35, 3.3), (1.0, 1.2, 0.74), "wood")
        + [panel for part in chairs for panel in part]
        + leaf((6.1, 1.26), 0.98, np.pi - door)
    )


def _office(near: Near, turn: float, door: float) -> list[Panel]:
    return (
        table((1.88, -3.7), (0.8, 1.8, 0.74), "desktop")
        + block(near(2.02, -3.55), (0.06, 0.55, 0.4), 0.86, {"": "dark", "w": "screen"}, 0.15)
        + block((2.02, -3.55), (0.08, 0.1, 0.12), 0.74, {"": "dark"})
        + block((2.02, -4.4), (0.2, 0.42, 0.4), 0.74, {"": "grey"})
        + chair(near(1.25, -3.7), turn, "fabric")
        + block((-0.72, -3.6), (0.34, 1.9, 1.9), 0, {"": "wood", "e": "books"})
        + block((-0.65, -1.7), (0.45, 0.8, 1.05), 0, {"": "cabinet"})
        + plant(near(-0.5, -5.2), 1.35)
        + block((1.95, -5.3), (0.5, 0.4, 1.05), 0, {"": "cabinet"})
        + leaf((1.25, -1.24), 0.92, door)
    )
