"""One sheet of all words: the typical frame of every unit on the lattice of the map, framed in its place's colour."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints
from placerec.evaluation.summary import shorten
from placerec.figures.canvas import (
    MARGIN,
    figure_file,
    letter_colour,
    panel,
    picture_file,
    place_colours,
    place_title,
    write_line,
)
from placerec.frames import SourceOptions
from placerec.frames.sequence import Gray
from placerec.inspection.words import WordTable, look_up, typical_images, word_sentences
from placerec.jobs import Progress
from placerec.vision import DictionarySet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Inches.
_SIDE, _GAP, _ROW = 3.6, 0.5, 0.2
_LEAST_WIDTH = 10.0
# Pixels across a tile in the picture; the rest of a tile's cell, in shares of its width, is frame and bar.
_PIXELS = 128
_FRAME, _BAR = 0.05, 0.09
_UNLABELLED, _EMPTY, _PAPER = (0.62, 0.62, 0.62), (0.93, 0.93, 0.93), (1.0, 1.0, 1.0)
_READING = (
    "Tiles lie as the units do on the map. Blank: the word of no frame here; crossed: hit by no training frame. "
    "U-matrix: the mean distance of a unit to the four around it."
)
# The tile that is explained: its width, and the height of its place beside the lattice, in inches.
_EXAMPLE, _EXAMPLE_HIGH = 1.25, 1.75


@dataclass(frozen=True)
class _Tiles:
    """A lattice of cells, in inches: a cell is `width` x `height`, its picture `inner` x `inner * aspect`."""

    size: int
    width: float
    aspect: float

    @property
    def inner(self) -> float:
        return self.width * (1 - 2 * _FRAME)

    @property
    def height(self) -> float:
        return self.inner * self.aspect + self.width * (2 * _FRAME + _BAR)


def show_words(
    words: Path | str,
    sources: Iterable[Path | str],
    out: Path | str | None = None,
    *,
    name: str = "",
    network: Path | str | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> WordTable:
    """`placerec show-words`: what the words of a words.npz look like among the frames of the sources.

    `out`: the picture to draw, PNG, SVG or PDF by suffix. `name`: which dictionary of several, "" for the first.
    `network`: the file of the image network, for words of one. `matrix`: the frames' descriptors, for a dictionary of
    descriptors that were computed elsewhere; `cache`: where they are kept for other runs (`placerec.vision.describe`
    tells of both). Raises SourceError and VisionError for what cannot be read, OutputError for a picture that cannot be
    written, MissingExtraError without matplotlib.
    """
    with picture_file(out) as picture:
        dictionary = DictionarySet.load(words, network=network).named(name)
        table, sequences = look_up(sources, dictionary, source_options, progress, matrix, cache)
        if picture is not None:
            images = typical_images(table, sequences)
            which = f"{Path(words).name}, dictionary {name}" if name else Path(words).name
            draw_word_sheet(table, images, picture, title=f"The words of {which}")
    return table


def draw_word_sheet(table: WordTable, images: Mapping[int, Gray], path: Path | str, *, title: str) -> None:
    """Draw the words as one picture, PNG, SVG or PDF by suffix; `images`: each unit's typical frame, if it has one.

    Raises OutputError for another suffix or a path that cannot be written, MissingExtraError without matplotlib.
    """
    pictures = [images.get(unit) for unit in range(len(table.words))]
    shapes = [picture.shape for picture in pictures if picture is not None]
    aspect = float(np.clip(np.median([height / width for height, width in shapes]), 0.5, 1.5))
    # Big enough to be recognised, as long as the sheet can be opened at all.
    tiles = _Tiles(table.size, min(1.6, max(0.8, 5 / table.size), 32 / table.size), aspect)
    lattice = tiles.width * table.size, tiles.height * table.size
    width = max(_LEAST_WIDTH, 2 * MARGIN + 0.3 + lattice[0] + _GAP + _SIDE)
    # Letters of 8.5 points, which are half as wide on the average.
    room = int((width - 2 * MARGIN) * 72 / (0.54 * 8.5))
    lines = [line for text in (*word_sentences(table), _READING) for line in textwrap.wrap(text, room)]
    head = 0.62 + 0.17 * len(lines)
    legend = _ROW * (len(table.places) + 2)
    # Below each other where the lattice is high enough for it, else side by side.
    beside = (_SIDE - 0.3) / 2
    example = _example_unit(table) if images else None
    legend_top = head + (0.0 if example is None else _EXAMPLE_HIGH)
    below = min(3.0, (lattice[1] + 0.2 - (legend_top - head) - legend) / 2 - 0.75)
    maps = max(beside, below)
    height = max(head + 0.3 + lattice[1], legend_top + legend + 0.8 + maps) + MARGIN
    with figure_file(path, width, height) as figure:
        write_line(figure, 0.42, shorten(title, int(width * 7.8)), 15)
        for number, line in enumerate(lines):
            write_line(figure, 0.7 + 0.17 * number, line, 8.5, "0.25")
        _lattice(panel(figure, MARGIN + 0.3, head + 0.2, *lattice), table, pictures, tiles)
        side = MARGIN + 0.3 + lattice[0] + _GAP
        if example is not None:
            _example(panel(figure, side, head, _SIDE, _EXAMPLE_HIGH), table, pictures[example], aspect, example)
        _legend(panel(figure, side, legend_top, _SIDE, legend), table)
        top = legend_top + legend + 0.5
        _heat(panel(figure, side, top, maps, maps), table, table.hits, "Blues", "Training frames per unit")
        spot = (side, top + maps + 0.75) if below >= beside else (side + maps + 0.3, top)
        _heat(panel(figure, *spot, maps, maps), table, table.u_matrix, "Greys", "U-matrix")


def _example_unit(table: WordTable) -> int | None:
    """The tile to explain: of those with a frame and a training frame the one whose frames are of most places."""
    shown = (table.typical >= 0) & (table.hits > 0)
    if not shown.any():
        return None
    return int(np.lexsort((table.frames, (table.votes > 0).sum(axis=1), shown))[-1])


def _example(axes: "Axes", table: WordTable, picture: Any, aspect: float, unit: int) -> None:
    """One tile alone, and beside it what its parts are; x and y are inches from the upper left corner."""
    from matplotlib.patches import Rectangle

    tile = _Tiles(1, _EXAMPLE / max(1.0, aspect), aspect)
    top = 0.25
    axes.set(xlim=(0, _SIDE), ylim=(_EXAMPLE_HIGH, 0))
    axes.axis("off")
    axes.text(0, 0.1, f"How to read a tile: {table.words[unit]}", size=8.5, va="center")
    colours = np.vstack([place_colours(table.places), _UNLABELLED])
    place, hits = int(table.place[unit]), int(table.hits[unit])
    pad = tile.width * _FRAME
    box = pad / 2, top + pad / 2, tile.width - pad, tile.height - pad
    axes.add_patch(Rectangle(box[:2], *box[2:], facecolor=tuple(colours[place]), linewidth=0))
    low = top + tile.height - pad - tile.width * _BAR
    for start, share, colour in _bar(table.votes[unit], colours):
        wide = tile.inner * share
        axes.add_patch(Rectangle((pad + tile.inner * start, low), wide, tile.width * _BAR, facecolor=colour))
    extent = pad, pad + tile.inner, top + pad + tile.inner * aspect, top + pad
    axes.imshow(_tile(picture, aspect), cmap="gray", vmin=0, vmax=255, extent=extent, zorder=2)
    axes.set(xlim=(0, _SIDE), ylim=(_EXAMPLE_HIGH, 0), aspect="auto")
    middle, bar = top + pad + tile.inner * aspect / 2, low + tile.width * _BAR / 2
    marks = [(pad * 2, "left", str(place + 1), colours[place])] if place >= 0 else []
    for x, side, text, ground in [*marks, (tile.width - pad * 2, "right", str(hits), np.ones(3))]:
        paint: dict[str, Any] = {"boxstyle": "square,pad=0.18", "linewidth": 0, "facecolor": (*ground, 0.85)}
        axes.text(x, top + 0.14, text, size=8, ha=side, va="center", color=letter_colour(ground), bbox=paint, zorder=4)
    belongs = "frame: no label"
    if place >= 0:
        belongs = f"frame and number: {shorten(table.places[place], 16)},\nwhere most of its frames are"
    notes = [
        (tile.width - pad, top + pad / 2, 0.08, belongs),
        (tile.width - pad, top + 0.14, 0.44, "training frames that hit the unit"),
        (tile.width * 0.8, middle, 0.75, "the frame nearest to the unit"),
        (tile.width * 0.8, bar, 1.06, "its frames by place"),
    ]
    right = tile.width + 0.3
    for x, y, at, note in notes:
        axes.plot((x, right - 0.06), (y, top + at), color="0.45", linewidth=0.7, zorder=5)
        axes.text(right, top + at, note, size=7.5, va="center", color="0.2", linespacing=1.15)


def _lattice(axes: "Axes", table: WordTable, pictures: Sequence[Any], tiles: _Tiles) -> None:
    """The tiles: x and y are inches from the upper left corner."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    size, pad = tiles.size, tiles.width * _FRAME
    axes.set(xlim=(0, size * tiles.width), ylim=(size * tiles.height, 0))
    axes.axis("off")
    colours = np.vstack([place_colours(table.places), _UNLABELLED])
    rectangles, fills = [], []
    for unit, (picture, place) in enumerate(zip(pictures, table.place.tolist(), strict=True)):
        left, top = unit % size * tiles.width, unit // size * tiles.height
        box = left + pad / 2, top + pad / 2, tiles.width - pad, tiles.height - pad
        rectangles.append(Rectangle(box[:2], *box[2:]))
        fills.append(_EMPTY if picture is None else tuple(colours[place]))
        for start, share, colour in _bar(table.votes[unit], colours):
            wide = tiles.inner * share
            low = top + tiles.height - pad - tiles.width * _BAR
            rectangles.append(Rectangle((left + pad + tiles.inner * start, low), wide, tiles.width * _BAR))
            fills.append(colour)
    axes.add_collection(PatchCollection(rectangles, facecolors=fills, linewidths=0, zorder=1))
    for unit, picture in enumerate(pictures):
        if picture is not None:
            left, top = unit % size * tiles.width + pad, unit // size * tiles.height + pad
            extent = left, left + tiles.inner, top + tiles.inner * tiles.aspect, top
            axes.imshow(_tile(picture, tiles.aspect), cmap="gray", vmin=0, vmax=255, extent=extent, zorder=2)
    axes.set(xlim=(0, size * tiles.width), ylim=(size * tiles.height, 0), aspect="auto")
    _marks(axes, table, tiles, colours)


def _bar(votes: Ints, colours: Floats) -> list[tuple[float, float, tuple[float, ...]]]:
    """The stretches of a tile's bar: where each starts, how long it is (shares of the bar), and its colour."""
    if not votes.any():
        return []
    shares = votes / votes.sum()
    starts = np.cumsum(shares) - shares
    return [(starts[place], shares[place], tuple(colours[place])) for place in np.flatnonzero(votes)]


def _tile(picture: NDArray[Any], aspect: float) -> NDArray[np.uint8]:
    """The picture, as large as it fits into a tile, on paper white."""
    import cv2

    room = round(_PIXELS * aspect), _PIXELS
    scale = min(room[0] / picture.shape[0], room[1] / picture.shape[1])
    high, wide = (max(1, min(full, round(side * scale))) for side, full in zip(picture.shape, room, strict=True))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    tile = np.full(room, 255, np.uint8)
    top, left = (room[0] - high) // 2, (room[1] - wide) // 2
    tile[top : top + high, left : left + wide] = np.rint(cv2.resize(picture, (wide, high), interpolation=how))
    return tile


def _marks(axes: "Axes", table: WordTable, tiles: _Tiles, colours: Floats) -> None:
    """Numbers on the tiles and at the edges, and crosses; where there is no room for letters, crosses alone."""
    font = min(8.0, 8.5 * tiles.width)
    written = tiles.width >= 0.45
    box: dict[str, Any] = {"boxstyle": "square,pad=0.18", "linewidth": 0}
    inset = 0.09 * tiles.width
    for unit, (place, hits) in enumerate(zip(table.place.tolist(), table.hits.tolist(), strict=True)):
        left, top = unit % tiles.size * tiles.width, unit // tiles.size * tiles.height
        if not hits:
            x, y, arm = left + tiles.width / 2, top + tiles.height / 2, 0.12 * tiles.width
            for turn in (-arm, arm):
                axes.plot((x - arm, x + arm), (y - turn, y + turn), color="0.55", linewidth=1.2, zorder=3)
        elif written:
            paint = {**box, "facecolor": (1, 1, 1, 0.75)}
            spot = left + tiles.width - inset, top + inset
            axes.text(*spot, str(hits), ha="right", va="top", size=font, bbox=paint, zorder=4)
        if place >= 0 and written:
            paint = {**box, "facecolor": tuple(colours[place])}
            spot, ink = (left + inset, top + inset), letter_colour(colours[place])
            axes.text(*spot, str(place + 1), ha="left", va="top", size=font, color=ink, bbox=paint, zorder=4)
    for number in range(tiles.size) if written else []:
        middle = (number + 0.5) * tiles.width, (number + 0.5) * tiles.height
        axes.text(middle[0], -0.06, f"+{number}", ha="center", va="bottom", size=7, color="0.4")
        word = table.words[number * tiles.size].rpartition(".")[2]
        axes.text(-0.06, middle[1], word, ha="right", va="center", size=7, color="0.4")


def _legend(axes: "Axes", table: WordTable) -> None:
    """A line per place: its number and colour, its name, its words and its frames."""
    from matplotlib.patches import Rectangle

    rows = len(table.places) + 2
    axes.set(xlim=(0, _SIDE), ylim=(rows, 0))
    axes.axis("off")
    for x, text in ((_SIDE - 0.65, "words"), (_SIDE, "frames")):
        axes.text(x, 0.5, text, size=7.5, ha="right", va="center", color="0.4")
    unlabelled = int(table.frames.sum() - table.votes.sum())
    lines = [
        (str(number + 1), colour, place, int((table.place == number).sum()), int(table.votes[:, number].sum()))
        for number, (place, colour) in enumerate(zip(table.places, place_colours(table.places), strict=True))
    ]
    nowhere = int(((table.place < 0) & (table.frames > 0)).sum())
    if unlabelled or not lines:
        lines.append(("", np.array(_UNLABELLED), "(no label)", nowhere, unlabelled))
    for row, (number, colour, place, words, frames) in enumerate(lines, start=1):
        axes.add_patch(Rectangle((0, row + 0.08), 0.3, 0.84, facecolor=tuple(colour), linewidth=0))
        axes.text(0.15, row + 0.53, number, size=7.5, ha="center", va="center", color=letter_colour(colour))
        axes.text(0.42, row + 0.53, shorten(place_title(place), 32), size=8.5, va="center")
        axes.text(_SIDE - 0.65, row + 0.53, str(words), size=8.5, ha="right", va="center")
        axes.text(_SIDE, row + 0.53, str(frames), size=8.5, ha="right", va="center")


def _heat(axes: "Axes", table: WordTable, values: NDArray[Any], cmap: str, title: str) -> None:
    """A map of one number per unit, darker for more; its range is told below."""
    grid = values.reshape(table.size, table.size)
    axes.imshow(grid, cmap=cmap, interpolation="nearest", aspect="equal")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color("0.7")
    axes.set_title(title, loc="left", fontsize=8)
    low, high = (cast(float, f(grid)) for f in (np.min, np.max))
    axes.set_xlabel(f"{low:.3g} (light) to {high:.3g} (dark)", fontsize=7.5, loc="left", color="0.25")
    if values.dtype.kind == "i":
        dead = np.argwhere(grid == 0)
        axes.plot(dead[:, 1], dead[:, 0], "x", color="0.5", markersize=min(5.0, 60 / table.size), markeredgewidth=0.8)
