"""Painters of furniture and fittings, and the register of all painters."""

import numpy as np

from placerec.lab.textures import DARK, OAK, STEEL, SURFACES, WHITE, Colour, Painter, Skin, blank, box, mottle, wood


def skin(rng: np.random.Generator, kind: str, width: float, height: float, res: float) -> Skin:
    """Paint a surface of that kind (a key of PAINTERS), width x height metres at `res` pixels per metre."""
    return PAINTERS[kind](rng, width, height, res)


def _radiator(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, WHITE)
    for x in np.arange(0.03, width, 0.09):
        box(result.albedo, res, x, 0.04, x + 0.03, height - 0.04, (0.42, 0.42, 0.41))
    return result


def _mirror(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """The opposite wall, painted on: tiles, their border and a door, darker than the real ones."""
    result = blank(width, height, res, STEEL)
    scene = SURFACES["tiles"](rng, width, height, res)
    box(scene.albedo, res, 0, height * 0.6, width, height, (0.72, 0.70, 0.64))
    box(scene.albedo, res, 0, height * 0.58, width, height * 0.62, (0.16, 0.24, 0.30))
    box(scene.albedo, res, width * 0.55, 0, width * 0.85, height * 0.8, OAK)
    result.albedo[2:-2, 2:-2] = 0.62 * scene.albedo[2:-2, 2:-2]
    return result


def _books(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """Shelves with backs of books and ring binders, some leaning gaps."""
    result = blank(width, height, res, (0.10, 0.07, 0.05))
    levels = max(1, round(height / 0.36))
    step = height / levels
    for level in range(levels):
        x = 0.04
        while x < width - 0.06:
            thick = rng.uniform(0.03, 0.09)
            if rng.random() < 0.9:
                tall, hue = rng.uniform(0.6, 0.9) * step, rng.uniform(0.03, 0.42) * rng.uniform(0.4, 1.0, 3)
                colour: Colour = (hue[0], hue[1], hue[2])
                box(result.albedo, res, x, level * step, min(x + thick, width - 0.04), level * step + tall, colour)
            x += thick + 0.008
        box(result.albedo, res, 0, level * step, width, level * step + 0.03, OAK)
    for x0, x1 in ((0.0, 0.04), (width - 0.04, width)):
        box(result.albedo, res, x0, 0, x1, height, OAK)
    box(result.albedo, res, 0, height - 0.03, width, height, OAK)
    return result


def _paper_rack(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.28, 0.29, 0.31))
    for z in np.arange(0.05, height - 0.2, 0.3):
        for x in np.arange(0.05, width - 0.2, 0.28):
            if rng.random() < 0.85:
                top = z + rng.uniform(0.06, 0.22)
                box(result.albedo, res, x, z, x + 0.23, top, WHITE)
                box(result.albedo, res, x, z, x + 0.23, z + 0.03, (0.15, 0.3, 0.5))
        box(result.albedo, res, 0, z - 0.03, width, z, DARK)
    return result


def _printer(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """A copier's front: paper drawers below, output slot, dark head with a lit panel."""
    result = blank(width, height, res, (0.60, 0.61, 0.60))
    for i in range(3):
        z = 0.08 + i * 0.16
        box(result.albedo, res, 0.02, z, width - 0.02, z + 0.145, (0.52, 0.53, 0.53))
        box(result.albedo, res, width * 0.35, z + 0.09, width * 0.65, z + 0.115, DARK)
    box(result.albedo, res, 0.04, height * 0.58, width - 0.04, height * 0.76, DARK)
    box(result.albedo, res, 0.08, height * 0.58, width * 0.75, height * 0.62, WHITE)
    box(result.albedo, res, 0, height - 0.14, width, height, (0.22, 0.23, 0.25))
    box(result.albedo, res, width * 0.6, height - 0.11, width - 0.05, height - 0.03, (0.2, 0.5, 0.7))
    return result


def _fronts(colour: Colour, pitch: float) -> Painter:
    """Cupboard doors with gaps and handles."""

    def paint(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
        result = blank(width, height, res, colour)
        count = max(1, round(width / pitch))
        step = width / count
        for i in range(count):
            box(result.albedo, res, i * step, 0, i * step + 0.012, height, (0.12, 0.12, 0.12))
            box(result.albedo, res, (i + 0.72) * step, height * 0.7, (i + 0.72) * step + 0.03, height * 0.9, DARK)
        if height > 0.7:
            box(result.albedo, res, 0, 0, width, 0.08, DARK)
            box(result.albedo, res, 0, height - 0.05, width, height, (0.20, 0.19, 0.18))
        mottle(rng, result.albedo, 0.3 * res, 0.03)
        return result

    return paint


def _fridge(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, WHITE)
    box(result.albedo, res, 0, height * 0.36, width, height * 0.36 + 0.025, DARK)
    for z in (height * 0.16, height * 0.45):
        box(result.albedo, res, 0.06, z, 0.10, z + 0.3, STEEL)
    box(result.albedo, res, 0, 0, width, 0.08, DARK)
    for x, z, colour in ((0.3, 1.2, (0.6, 0.1, 0.1)), (0.42, 1.0, (0.1, 0.4, 0.2)), (0.25, 0.95, (0.7, 0.6, 0.1))):
        box(result.albedo, res, x, z, x + 0.09, z + 0.12, colour)
    return result


def _worktop(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """Seen from above: a steel sink at the left third, four hot plates at the right third."""
    result = blank(width, height, res, (0.30, 0.28, 0.25))
    mottle(rng, result.albedo, 0.03 * res, 0.15)
    box(result.albedo, res, width * 0.12, 0.1, width * 0.34, height - 0.1, STEEL)
    box(result.albedo, res, width * 0.14, 0.16, width * 0.24, height - 0.16, (0.2, 0.2, 0.21))
    box(result.albedo, res, width * 0.66, 0.06, width * 0.87, height - 0.06, DARK)
    for x in (0.69, 0.79):
        for z in (0.12, height - 0.26):
            box(result.albedo, res, width * x, z, width * x + 0.16, z + 0.15, (0.2, 0.18, 0.18))
    return result


def _basins(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.36, 0.37, 0.38))
    for x in np.arange(0.15, width - 0.3, 0.62):
        box(result.albedo, res, x, 0.07, x + 0.44, height - 0.08, (0.85, 0.85, 0.85))
        box(result.albedo, res, x + 0.07, 0.13, x + 0.37, height - 0.14, (0.62, 0.63, 0.64))
    return result


def _desktop(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """Seen from above: wood with papers, a keyboard and a cup."""
    result = wood(rng, width, height, res)
    result.albedo[:] *= 1.25
    for _ in range(max(2, round(3 * width * height))):
        x, z = rng.uniform(0.05, max(0.06, width - 0.3)), rng.uniform(0.03, max(0.04, height - 0.25))
        box(result.albedo, res, x, z, x + 0.21, z + 0.2, WHITE)
    box(result.albedo, res, width * 0.42, 0.1, width * 0.42 + 0.44, 0.24, DARK)
    return result


def _screen(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """A monitor that is on by day and by night: it shines with the sky or with the lamps, whichever there is."""
    result = blank(width, height, res, DARK)
    box(result.lamp, res, 0.03, 0.05, width - 0.03, height - 0.03, 0.16)
    box(result.lamp, res, 0.08, 0.12, width - 0.15, height - 0.1, 0.34)
    result.day[:] = 0.7 * result.lamp
    return result


def _cubicle(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    """A row of toilet cubicles: panels, doors, locks."""
    result = blank(width, height, res, (0.22, 0.32, 0.42))
    count = max(1, round(width / 0.95))
    step = width / count
    for i in range(count):
        box(result.albedo, res, i * step + 0.12, 0, (i + 1) * step - 0.12, height - 0.06, (0.42, 0.50, 0.56))
        box(result.albedo, res, i * step + 0.12, 0, i * step + 0.14, height - 0.06, DARK)
        box(result.albedo, res, (i + 1) * step - 0.14, 0, (i + 1) * step - 0.12, height - 0.06, DARK)
        box(result.albedo, res, (i + 1) * step - 0.24, height * 0.45, (i + 1) * step - 0.17, height * 0.5, STEEL)
    return result


def _leaves(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.03, 0.07, 0.03))
    for _ in range(round(260 * width * height)):
        x, z, green = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.1, 0.3)
        box(result.albedo, res, x, z, x + 0.05, z + 0.09, (green * 0.45, green, green * 0.35))
    return result


def _extinguisher(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, (0.74, 0.71, 0.64))
    box(result.albedo, res, width * 0.2, 0, width * 0.8, height * 0.75, (0.55, 0.03, 0.03))
    box(result.albedo, res, width * 0.35, height * 0.75, width * 0.65, height * 0.9, DARK)
    box(result.albedo, res, width * 0.25, height * 0.3, width * 0.75, height * 0.5, WHITE)
    return result


def _switch(rng: np.random.Generator, width: float, height: float, res: float) -> Skin:
    result = blank(width, height, res, WHITE)
    box(result.albedo, res, width * 0.25, height * 0.2, width * 0.75, height * 0.8, (0.55, 0.55, 0.54))
    return result


PAINTERS: dict[str, Painter] = SURFACES | {
    "radiator": _radiator,
    "mirror": _mirror,
    "books": _books,
    "paper rack": _paper_rack,
    "printer": _printer,
    "kitchen fronts": _fronts((0.62, 0.58, 0.48), 0.6),
    "cabinet": _fronts((0.36, 0.38, 0.40), 0.5),
    "cupboard": _fronts(OAK, 0.6),
    "fridge": _fridge,
    "worktop": _worktop,
    "basins": _basins,
    "desktop": _desktop,
    "screen": _screen,
    "cubicle": _cubicle,
    "leaves": _leaves,
    "extinguisher": _extinguisher,
    "switch": _switch,
}
