"""What the words of a dictionary look like and stand for, among the frames of some sequences: a row per unit."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import SourceError, counted
from placerec.evaluation.summary import percent, shorten
from placerec.frames import Sequence, SourceOptions, find_sequences, images_at
from placerec.frames.sequence import Gray, gray_levels
from placerec.frames.table import FrameTable
from placerec.jobs import Progress
from placerec.vision import Descriptors, Dictionary, describe
from placerec.vision.pca import project
from placerec.vision.som import Units, nearest_units

_NAME_WIDTH = 32
# Pixels, the longer side of the typical frame of a unit; a picture shows it with half as many at most.
PREVIEW = 640


@dataclass(frozen=True, eq=False)
class WordTable:
    """K units of a map of size x size, row-major, and the n frames that were looked at.

    hits: frames that trained the unit (K,). frames: those looked at whose word it is (K,). votes: of these, how many
    of each place, (K, P). typical: the nearest of these to the unit, (K,), -1 where there is none; distances: how far
    it is, nan where there is none. u_matrix (K,). to_dead: frames of the n whose nearest unit of all is one that no
    training frame hit, whether or not such units may be words (`units`).
    """

    words: tuple[str, ...]
    size: int
    units: str
    hits: Ints
    frames: Ints
    places: tuple[str, ...]
    votes: Ints
    typical: Ints
    distances: Singles
    u_matrix: Floats
    to_dead: int
    is_training: bool  # the frames look like those that trained the map: as many of them hit each unit
    looked_at: FrameTable  # the n frames

    @property
    def place(self) -> Ints:
        """The place that most frames of a word have, (K,): index in places, -1 where no frame has a label."""
        if not self.places:
            return np.full(len(self.words), -1)
        return np.where(self.votes.any(axis=1), self.votes.argmax(axis=1), -1)

    @property
    def share(self) -> Floats:
        """The share of that place among the word's labelled frames, (K,), nan where no frame has a label."""
        most, labelled = self.votes.max(axis=1, initial=0), self.votes.sum(axis=1)
        share: Floats = np.where(labelled > 0, most / np.maximum(labelled, 1), np.nan)
        return share

    def to_json(self) -> dict[str, object]:
        """The object that `show-words --json` prints: None where there is no frame or no label."""
        labelled = int(self.votes.sum())
        return {
            "frames": len(self.looked_at),
            "sequences": len(self.looked_at.by_sequence()),
            "labelled": labelled,
            "to_dead_units": self.to_dead,
            "in_majority_place": self.agreeing / labelled if labelled else None,
            "places": list(self.places),
            "units": [self.row(unit) for unit in range(len(self.words))],
        }

    def row(self, unit: int) -> dict[str, object]:
        """One unit, as plain Python values."""
        place, frame = int(self.place[unit]), int(self.typical[unit])
        found, labelled = frame >= 0, place >= 0
        return {
            "unit": unit,
            "word": self.words[unit],
            "hits": int(self.hits[unit]),
            "u_matrix": round(float(self.u_matrix[unit]), 6),
            "frames": int(self.frames[unit]),
            "place": self.places[place] if labelled else None,
            "share": round(float(self.share[unit]), 6) if labelled else None,
            "typical_sequence": self.looked_at.sequences[frame] if found else None,
            "typical_frame": self.looked_at.names[frame] if found else None,
            "distance": round(float(self.distances[unit]), 6) if found else None,
        }

    @property
    def agreeing(self) -> int:
        """Labelled frames whose place is the one that their word mostly belongs to."""
        return int(self.votes.max(axis=1, initial=0).sum())


def look_up(
    sources: Iterable[Path | str],
    dictionary: Dictionary,
    source_options: SourceOptions,
    progress: Progress | None,
    matrix: Path | str | None = None,
    cache: Path | str | None = None,
) -> tuple[WordTable, list[Sequence]]:
    """The table of the frames of some sources, and their sequences; SourceError and VisionError for bad sources."""
    sequences = find_sequences(sources, options=source_options)
    found = describe(sequences, dictionary.spec, matrix=matrix, cache=cache, progress=progress)
    return word_table(found, dictionary), sequences


def word_table(descriptors: Descriptors, dictionary: Dictionary) -> WordTable:
    """Look up the word of every frame, and what can be said of every unit."""
    count = len(dictionary.codebook)
    descriptors = descriptors.part(dictionary.spec)
    units, distances = dictionary.words(descriptors.values)
    nearest, _ = nearest_units(project(descriptors.values, dictionary.pca), Units.of(dictionary.codebook))
    places = tuple(sorted(set(descriptors.places) - {""}))
    place = descriptors.table.places.codes(places)
    labelled = place >= 0
    votes = np.bincount(units[labelled] * len(places) + place[labelled], minlength=count * len(places))
    # Sorted by unit and distance, the first row of each unit is its nearest.
    order = np.lexsort((distances, units))
    starts = np.flatnonzero(np.diff(units[order], prepend=-1))
    typical, least = np.full(count, -1), np.full(count, np.nan, np.float32)
    typical[units[order[starts]]] = order[starts]
    least[units[order[starts]]] = distances[order[starts]]
    return WordTable(
        dictionary.vocabulary,
        dictionary.training.size,
        dictionary.training.units,
        dictionary.hits,
        np.bincount(units, minlength=count),
        places,
        votes.reshape(count, len(places)),
        typical,
        least,
        u_matrix(dictionary.codebook).ravel(),
        int((dictionary.hits[nearest] == 0).sum()),
        np.array_equal(np.bincount(nearest, minlength=count), dictionary.hits),
        descriptors.table,
    )


def typical_images(
    table: WordTable, sequences: Iterable[Sequence], units: Iterable[int] | None = None
) -> dict[int, Gray]:
    """Unit -> grey levels of its typical frame, of those of `units` (None: all) that have one.

    `sequences` are those looked at. Raises SourceError for an image that cannot be read any more.
    """
    wanted = range(len(table.words)) if units is None else units
    unit_of = {
        (table.looked_at.sequences[frame], table.looked_at.names[frame]): unit
        for unit in wanted
        if (frame := int(table.typical[unit])) >= 0
    }
    found = {}
    for sequence in sequences:
        chosen = [k for k, frame in enumerate(sequence.frames) if (sequence.name, frame.name) in unit_of]
        for k, image in zip(chosen, images_at(sequence, chosen), strict=True):
            if isinstance(image, str):
                raise SourceError(image)
            found[unit_of[sequence.name, sequence.frames[k].name]] = _preview(gray_levels(image))
    return found


def _preview(image: Gray) -> Gray:
    """The image, made smaller if it is large: as many of a film would not fit into memory."""
    import cv2

    scale = PREVIEW / max(image.shape)
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    return image if scale >= 1 else cast(Gray, cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def u_matrix(codebook: Singles) -> Floats:
    """The mean distance of every unit to the units above, below, left and right of it, (size, size)."""
    size = round(len(codebook) ** 0.5)
    lattice = codebook.astype(np.float64).reshape(size, size, -1)
    total, neighbours = np.zeros((size, size)), np.zeros((size, size))
    down = np.sqrt(np.square(np.diff(lattice, axis=0)).sum(axis=2))
    right = np.sqrt(np.square(np.diff(lattice, axis=1)).sum(axis=2))
    for part, between in ((np.s_[:-1], down), (np.s_[1:], down), (np.s_[:, :-1], right), (np.s_[:, 1:], right)):
        total[part] += between
        neighbours[part] += 1
    return total / np.maximum(neighbours, 1)


def word_sentences(table: WordTable) -> list[str]:
    """What there is to say of the words in general, in a few sentences."""
    frames, sequences = len(table.looked_at), len(table.looked_at.by_sequence())
    live, seen = int((table.hits > 0).sum()), int((table.frames > 0).sum())
    which = "all" if live == len(table.words) else str(live)
    told = [
        f"{len(table.words)} units, {which} of them hit in training; {seen} are words of "
        f"{counted(frames, 'frame')} in {counted(sequences, 'sequence')}."
    ]
    if live < len(table.words):
        told.append(_dead_sentence(table))
    labelled = int(table.votes.sum())
    if labelled:
        told.append(
            f"{percent(table.agreeing / labelled)} of the {counted(labelled, 'labelled frame')} have the place that "
            "their word mostly belongs to (counted on these very frames)."
        )
    else:
        told.append("No frame has a label: it is not known which place a word belongs to.")
    return told


def format_words(table: WordTable) -> str:
    """The sentences, and a line per place: its frames, its words, and how many of its frames have one of these."""
    lines = word_sentences(table)
    if table.places:
        width = max(5, *(len(shorten(place, _NAME_WIDTH)) for place in table.places))
        lines += ["", f"{'place':<{width}}  {'frames':>8}  {'words':>6}  {'its frames with these words':>28}"]
    for number, place in enumerate(table.places):
        mine = table.place == number
        frames = int(table.votes[:, number].sum())
        share = percent(int(table.votes[mine, number].sum()) / frames)
        lines.append(f"{shorten(place, _NAME_WIDTH):<{width}}  {frames:>8}  {int(mine.sum()):>6}  {share:>28}")
    return "\n".join(lines)


def _dead_sentence(table: WordTable) -> str:
    dead = int((table.hits == 0).sum())
    what = f"{counted(dead, 'unit')} that no training frame hit"
    if not table.to_dead:
        return f"{what}: none of these frames is nearest to one{', for they trained the map' * table.is_training}."
    reach = f"{percent(table.to_dead / len(table.looked_at))} of the frames"
    if table.units == "live":
        return f"{what}: {reach} are nearest to one, and get the word of the nearest live unit instead."
    return f"{what}: {reach} are nearest to one and have it as word, which no language model has seen."
