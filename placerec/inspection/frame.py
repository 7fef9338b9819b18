"""What the dictionary sees in one image: its descriptor, and the units that are nearest to it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from placerec.evaluation.summary import percent, shorten
from placerec.frames import read_gray
from placerec.frames.sequence import Gray
from placerec.inspection.words import WordTable
from placerec.vision import DescriptorSpec, Dictionary, descriptor, fit_image
from placerec.vision.pca import project

NEAREST = 5


@dataclass(frozen=True, eq=False)
class FrameView:
    """One image and a dictionary: `picture` is the image as it is fitted, `values` its descriptor of kind `spec`.

    distances: to every unit, float64 (K,). unit: that of its word, which is the nearest of those that may be words.
    nearest: the five nearest units, live or not, and behind them that of the word if it is not among them. table: what
    the words are among some frames, None where no source was given.
    """

    name: str
    spec: DescriptorSpec
    picture: Gray
    values: NDArray[np.float32]
    words: tuple[str, ...]
    hits: NDArray[np.int64]
    unit: int
    distances: NDArray[np.float64]
    nearest: tuple[int, ...]
    table: WordTable | None

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


def view_frame(image: Path | str, dictionary: Dictionary, table: WordTable | None = None) -> FrameView:
    """Look at one image file with a dictionary. Raises SourceError or VisionError for one that cannot be used."""
    spec = dictionary.spec
    gray = read_gray(Path(image))
    values = descriptor(gray, spec)
    code = project(values[None], dictionary.pca).astype(np.float64)
    distances = np.sqrt(np.square(dictionary.codebook - code).sum(axis=1))
    unit = int(dictionary.words(values[None])[0][0])
    nearest = np.argsort(distances, kind="stable")[:NEAREST].tolist()
    return FrameView(
        Path(image).name,
        spec,
        fit_image(gray, spec.image_size, spec.fit),
        values,
        dictionary.vocabulary,
        dictionary.hits,
        unit,
        distances,
        tuple(nearest if unit in nearest else [*nearest, unit]),
        table,
    )


def format_frame(view: FrameView) -> str:
    """The word, and a line for each of the nearest units."""
    lines = [f"{view.name}: {view.words[view.unit]}, at a distance of {view.distances[view.unit]:.4g}", ""]
    lines.append(f"{'nearest':<9}{'distance':>9}{'hits':>7}" + ("  mostly" if view.table is not None else ""))
    for unit in view.nearest:
        note = unit_note(view, unit)
        text = f"{view.words[unit]:<9}{view.distances[unit]:>9.4f}{view.hits[unit]:>7}"
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
    return f"{shorten(view.table.places[place], 32)} ({percent(float(view.table.share[unit]))})"
