"""What the dictionary sees in one image: its descriptor, and the units that are nearest to it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import SourceError
from placerec.evaluation.summary import percent, shorten
from placerec.figures.canvas import MARGIN, figure_file, panel, picture_file, place_title, write_line
from placerec.frames import Sequence, SourceOptions
from placerec.frames.folder import is_image
from placerec.frames.image import read_image
from placerec.frames.sequence import ColourImage, Gray, Image, gray_levels
from placerec.inspection.words import WordTable, look_up, typical_images
from placerec.jobs import Progress
from placerec.vision import DescriptorSpec, Dictionary, DictionarySet, descriptor, fit_image
from placerec.vision.images import fit_pixels
from placerec.vision.onnx import fit_for
from placerec.vision.pca import project

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAREST = 5

# Inches.
_WIDTH, _PANEL, _GAP, _HEAD = 14.0, 2.5, 0.225, 1.1
_SCALES = ("finest", "fine", "coarse", "coarsest")
_TURNS, _BLOCKS = 6, 4
_ROSES = (
    "A rose shows one window: its petals point along the edges there, and are as long as these are strong, each scale "
    "by its own longest. "
)
_BELOW = "Below: the nearest units, the word framed."
# Okabe and Ito's blue and vermilion: told apart by any eye, and on grey.
_ROSE, _MARK = "#0072B2", "#D55E00"


@dataclass(frozen=True, eq=False)
class FrameView:
    """One image and a dictionary: `picture` is the image as it is fitted, `values` its descriptor of kind `spec`.

    The picture is grey (h, w), or red, green, blue (h, w, 3) where only colours are looked at.
    distances: to every unit, float64 (K,). unit: that of its word, which is the nearest of those that may be words.
    nearest: the five nearest units, live or not, and behind them that of the word if it is not among them. table: what
    the words are among some frames, None where no source was given.
    """

    name: str
    spec: DescriptorSpec
    picture: NDArray[Any]
    values: Singles
    words: tuple[str, ...]
    hits: Ints
    unit: int
    distances: Floats
    nearest: tuple[int, ...]
    table: WordTable | None = None

    def to_json(self) -> dict[str, object]:
        """The object that `show-frame --json` prints."""
        return {"image": self.name, "word": self.words[self.unit], "nearest": [self.row(u) for u in self.nearest]}

    def row(self, unit: int) -> dict[str, object]:
        """One unit as plain Python values: with a table, what it says of it; `distance` is that of the image."""
        own = {"distance": round(float(self.distances[unit]), 6), "hits": int(self.hits[unit])}
        if self.table is None:
            return {"unit": unit, "word": self.words[unit], **own}
        known = self.table.row(unit)
        return {**known, "typical_distance": known["distance"], **own}


def show_frame(
    image: Path | str,
    words: Path | str,
    sources: Iterable[Path | str] = (),
    out: Path | str | None = None,
    *,
    name: str = "",
    network: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> FrameView:
    """`placerec show-frame`: what a words.npz sees in an image, and which units are nearest to it.

    `sources`: sequences whose frames tell what the units look like and which places they belong to. `out`: the picture
    to draw, PNG, SVG or PDF by suffix. `name`: which dictionary of several, "" for the first. `network`: the file of
    the image network, for words of one. `cache`: see `placerec.vision.describe`. Raises SourceError and VisionError for
    what cannot be read, OutputError for a picture that cannot be written, MissingExtraError without matplotlib.
    """
    with picture_file(out) as picture:
        dictionary = DictionarySet.load(words, network=network).named(name)
        view = view_frame(image, dictionary)
        sequences: list[Sequence] = []
        if sources := list(sources):
            if second := next((path for path in map(Path, sources) if is_image(path)), None):
                raise SourceError(f"{second}: is a second image; show one at a time (SOURCE is a folder of frames)")
            table, sequences = look_up(sources, dictionary, source_options, progress, cache=cache)
            view = replace(view, table=table)
        if picture is not None:
            typical = {} if view.table is None else typical_images(view.table, sequences, view.nearest)
            draw_frame_sheet(view, typical, picture)
    return view


def view_frame(image: Path | str, dictionary: Dictionary) -> FrameView:
    """Look at one image file with a dictionary. Raises SourceError or VisionError for one that cannot be used."""
    spec = dictionary.spec
    read = read_image(Path(image), colours=spec.colours)
    values = descriptor(read, spec)
    code = project(values[None], dictionary.pca).astype(np.float64)
    distances = np.sqrt(np.square(dictionary.codebook - code).sum(axis=1))
    unit = int(dictionary.words(values[None])[0][0])
    nearest = np.argsort(distances, kind="stable")[:NEAREST].tolist()
    return FrameView(
        Path(image).name,
        spec,
        _seen(read, spec),
        values,
        dictionary.vocabulary,
        dictionary.hits,
        unit,
        distances,
        tuple(nearest if unit in nearest else [*nearest, unit]),
    )


def _seen(image: Image, spec: DescriptorSpec) -> NDArray[Any]:
    """The image as its descriptors get it: grey, or (h, w, 3) red, green, blue if all of them look at colours."""
    if not isinstance(image, ColourImage) or "image_size" in spec.settings:
        return fit_image(gray_levels(image), spec.image_size, spec.fit)
    if spec.network is not None:
        return fit_for(spec.network, image.colours)[..., ::-1]
    return fit_pixels(image.colours, spec.image_size, spec.image_size, spec.fit)[..., ::-1]


def format_frame(view: FrameView) -> str:
    """The word, and a line for each of the nearest units."""
    lines = [f"{view.name}: {view.words[view.unit]}, at a distance of {view.distances[view.unit]:.4g}", ""]
    width = max(8, len(view.words[0])) + 1
    lines.append(f"{'nearest':<{width}}{'distance':>9}{'hits':>7}" + ("  mostly" if view.table is not None else ""))
    for unit in view.nearest:
        note = unit_note(view, unit)
        text = f"{view.words[unit]:<{width}}{view.distances[unit]:>9.4f}{view.hits[unit]:>7}"
        lines.append(f"{text}  {note}".rstrip())
    return "\n".join(lines)


def unit_note(view: FrameView, unit: int) -> str:
    """What is to be said of a unit: that it is dead, or which place it mostly belongs to."""
    if not view.hits[unit]:
        return "hit by no training frame" + ("" if unit == view.unit else ", so no word")
    if view.table is None:
        return ""
    row = view.table.row(unit)
    if row["place"] is None:
        return "no labelled frame given"
    place = int(view.table.place[unit])
    return f"{shorten(place_title(view.table.places[place]), 32)} ({percent(float(view.table.share[unit]))})"


def draw_frame_sheet(view: FrameView, typical: Mapping[int, Gray], path: Path | str) -> None:
    """Draw a view as one picture, PNG, SVG or PDF by suffix; `typical`: the nearest units' typical frames, if any.

    Raises OutputError for another suffix or a path that cannot be written, MissingExtraError without matplotlib.
    """
    pictures = [typical[unit] for unit in view.nearest if unit in typical]
    aspect = next((picture.shape[0] / picture.shape[1] for picture in pictures), 0.75)
    second = _HEAD + _PANEL + 0.7
    height = second + _PANEL + 0.3
    with figure_file(path, _WIDTH, height) as figure:

        def bare(left: float, top: float, wide: float = _PANEL) -> "Axes":
            axes = panel(figure, left, top, wide, _PANEL)
            axes.set(xticks=[], yticks=[])
            return axes

        edges = view.spec.kind == "gist"
        title = f"{shorten(view.name, 70)}: word {view.words[view.unit]}"
        write_line(figure, 0.42, title, 15)
        write_line(figure, 0.7, _ROSES * edges + _BELOW, 8.5, "0.25")
        how = "As the descriptor gets it" + ", in 4 x 4 windows" * edges
        _fitted(bare(MARGIN, _HEAD), view.picture, how, windows=edges)
        step = _PANEL + _GAP
        if edges:
            for scale, energy in enumerate(energies(view.values)):
                _roses(bare(MARGIN + (scale + 1) * step, _HEAD), view.picture, energy, _SCALES[scale])
        else:
            _values(bare(MARGIN + step + 0.3, _HEAD, _WIDTH - 2 * MARGIN - step - 0.3), view.values)
        _map(bare(MARGIN, second), view)
        left, room = MARGIN + step, _WIDTH - 2 * MARGIN - step
        if not pictures:
            _distances(bare(left + 0.8, second, room - 0.8), view)
            return
        wide = (room + 0.15) / len(view.nearest) - 0.15
        for rank, unit in enumerate(view.nearest):
            axes = bare(left + rank * (wide + 0.15), second, wide)
            axes.set_box_aspect(aspect)
            _unit(axes, view, unit, typical.get(unit))


def energies(values: Singles) -> Singles:
    """GIST (384,) as (scale, turn, row, column): how strong edges are in each window of the picture.

    Scales from the finest; turn t: edges at 90 + 30 t degrees, counted as on paper, counter-clockwise from the right.
    """
    return values.reshape(len(_SCALES), _TURNS, _BLOCKS, _BLOCKS).transpose(0, 1, 3, 2)


def _fitted(axes: "Axes", picture: NDArray[Any], title: str, *, windows: bool, paleness: float = 0.0) -> None:
    """The picture, with the lines between its 4 x 4 windows or not; `paleness` 1 is white."""
    side = picture.shape[0]
    shown = picture * (1 - paleness) + 255 * paleness
    if shown.ndim == 3:
        shown = np.rint(shown).astype(np.uint8)
    axes.imshow(shown, cmap="gray", vmin=0, vmax=255, extent=(0, side, side, 0), interpolation="nearest")
    for line in np.arange(1, _BLOCKS) * side / _BLOCKS if windows else []:
        axes.axhline(line, color="0.75", linewidth=0.7)
        axes.axvline(line, color="0.75", linewidth=0.7)
    axes.set(xlim=(0, side), ylim=(side, 0))
    axes.spines[:].set_color("0.7")
    axes.set_title(title, loc="left", fontsize=8.5)


def _roses(axes: "Axes", picture: NDArray[Any], energy: Singles, name: str) -> None:
    """A rose in every window from energies (turn, row, column): petals point along the edges."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Wedge

    _fitted(axes, picture, f"Edges of the {name} scale", windows=True, paleness=0.85)
    cell = picture.shape[0] / _BLOCKS
    largest = float(energy.max()) or 1.0
    petals = []
    for turn, row, column in np.ndindex(*energy.shape):
        centre = (column + 0.5) * cell, (row + 0.5) * cell
        radius = 0.48 * cell * float(energy[turn, row, column]) / largest
        # Rows are counted downwards, and angles therefore clockwise.
        angle = -(90 + 180 / _TURNS * turn)
        for direction in (angle, angle + 180):
            half = 90 / _TURNS
            petals.append(Wedge(centre, radius, direction - half, direction + half))
    axes.add_collection(PatchCollection(petals, facecolor=_ROSE, edgecolor="white", linewidth=0.3, zorder=2))
    text = f"mean energy {energy.mean():.3g}; the longest petal {energy.max():.3g}"
    axes.set_xlabel(text, fontsize=7.5, loc="left", color="0.25")


def _values(axes: "Axes", values: Singles) -> None:
    """A descriptor whose values have no place in the picture, as bars."""
    axes.stairs(values, fill=True, color=_ROSE)
    axes.set_xlim(0, len(values))
    axes.set_title(f"The {len(values)} values of the descriptor", loc="left", fontsize=8.5)
    axes.set_yticks([0.0, float(values.max())], labels=["0", f"{values.max():.3g}"], fontsize=7)
    axes.spines[:].set_color("0.7")


def _map(axes: "Axes", view: FrameView) -> None:
    """How far every unit is, dark for near, and the word."""
    size = round(len(view.words) ** 0.5)
    axes.imshow(view.distances.reshape(size, size), cmap="Greys_r", interpolation="nearest")
    dead = np.argwhere(view.hits.reshape(size, size) == 0)
    axes.plot(dead[:, 1], dead[:, 0], "x", color="0.5", markersize=min(5.0, 60 / size), markeredgewidth=0.8)
    row, column = divmod(view.unit, size)
    marker = max(6.0, 150 / size)
    axes.plot(column, row, "s", markersize=marker, color="none", markeredgecolor=_MARK, markeredgewidth=2)
    axes.set_title("The units of the map, dark for near", loc="left", fontsize=8.5)
    axes.set_xlabel("square: the word; crosses: hit by no training frame", fontsize=7.5, loc="left", color="0.25")
    axes.spines[:].set_color("0.7")


def _distances(axes: "Axes", view: FrameView) -> None:
    """The nearest units where there is no picture of them: how far each is, and what there is to say of it."""
    rows = np.arange(len(view.nearest))
    colours = [_MARK if unit == view.unit else "0.5" for unit in view.nearest]
    distances = [float(view.distances[unit]) for unit in view.nearest]
    axes.barh(rows, distances, 0.55, color=colours)
    axes.set_yticks(rows, labels=[view.words[unit] for unit in view.nearest], fontsize=8.5)
    axes.tick_params(axis="y", length=0)
    axes.spines[:].set_visible(False)
    axes.set(xlim=(0, 1.6 * max(distances)), ylim=(len(rows) - 0.5, -0.5))
    for row, unit in enumerate(view.nearest):
        note = ", ".join(filter(None, (f"{view.distances[unit]:.3g}", unit_note(view, unit))))
        axes.text(distances[row] + 0.01 * max(distances), row, note, fontsize=8, va="center", color="0.25")
    axes.set_title("How far the nearest units are; a SOURCE would show what they look like", loc="left", fontsize=8.5)


def _unit(axes: "Axes", view: FrameView, unit: int, picture: NDArray[Any] | None) -> None:
    """One of the nearest units: its typical frame if there is one, how far it is, and what there is to say of it."""
    chosen = unit == view.unit
    axes.set_anchor("N")
    if picture is None:
        axes.spines[:].set_visible(False)
        axes.text(0, 1, "the word of no frame here", transform=axes.transAxes, va="top", fontsize=8, color="0.4")
    else:
        axes.imshow(picture, cmap="gray", vmin=0, vmax=255, aspect="auto")
        axes.spines[:].set(color=_MARK if chosen else "0.7", linewidth=2.5 if chosen else 0.8)
    axes.set_title(f"{view.words[unit]}, distance {view.distances[unit]:.3g}", loc="left", fontsize=8.5)
    axes.set_xlabel(unit_note(view, unit), fontsize=7.5, loc="left", color="0.25")
