"""How stable words are: the share of frames that get another word when a camera's small faults are added to them."""

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import chain, groupby
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask, Singles
from placerec.errors import VisionError
from placerec.evaluation.summary import percent
from placerec.figures.canvas import figure_file, picture_file
from placerec.frames import Frame, Sequence, SourceOptions, all_images, find_sequences
from placerec.frames.sequence import Gray
from placerec.jobs import Progress
from placerec.vision import Dictionary, DictionarySet
from placerec.vision.spec import DescriptorSpec, describer, descriptor

log = logging.getLogger(__name__)

# Frames whose descriptors are held at once: each has one a change.
_CHUNK = 256

# Okabe and Ito's vermilion and sky blue.
_FAR, _NEAR = "#D55E00", "#56B4E9"
_NEXT = "the next frame, for comparison"


@dataclass(frozen=True)
class Change:
    """One way to spoil a picture: `apply(gray, spec, rng)` gives a picture of the same or of the fitted size."""

    kind: str
    amount: str
    apply: Callable[[Gray, DescriptorSpec, np.random.Generator], Gray]


@dataclass(frozen=True)
class ChangeResult:
    """How many frames got another word by a change, and how many of these the word of a unit next to it (of 8).

    Also of pairs of consecutive frames, which tell how much words change anyway.
    """

    kind: str
    amount: str
    frames: int
    changed: int
    neighbour: int

    def shares(self) -> dict[str, float | None]:
        """The shares of 1 of those that changed, None where there are no frames."""
        counts = {"changed": self.changed, "to_neighbour": self.neighbour}
        return {name: count / self.frames if self.frames else None for name, count in counts.items()}


@dataclass(frozen=True)
class Stability:
    """The result for every change, over `frames` frames, and for the step from a frame to the next."""

    frames: int
    results: tuple[ChangeResult, ...]
    step: ChangeResult

    @property
    def shown(self) -> list[ChangeResult]:
        """The results that there are: that for a step only where there are two frames in a row."""
        return [*self.results, *([self.step] if self.step.frames else [])]

    def to_json(self) -> dict[str, object]:
        """The object that `stability --json` prints; shares are of 1, None where there are no two frames in a row."""
        return {
            "frames": self.frames,
            "changes": [{"kind": one.kind, "amount": one.amount, **one.shares()} for one in self.results],
            "next_frame": {"steps": self.step.frames, **self.step.shares()},
        }


def stability(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str | None = None,
    *,
    name: str = "",
    source_options: SourceOptions = SourceOptions(),
    seed: int = 0,
    progress: Progress | None = None,
) -> Stability:
    """`placerec stability`: how many frames of the sources get another word by what a camera does to pictures.

    `out`: the picture to draw, PNG, SVG or PDF by suffix. `name`: which dictionary of several, "" for the first.
    `seed`: of the noise. Raises SourceError and VisionError for what cannot be read, OutputError for a picture that
    cannot be written, MissingExtraError without matplotlib.
    """
    with picture_file(out) as picture:
        dictionary = DictionarySet.load(words).named(name)
        found = word_changes(find_sequences(sources, options=source_options), dictionary, seed=seed, progress=progress)
        if picture is not None:
            plot_stability(found, picture)
    return found


def word_changes(
    sequences: Iterable[Sequence], dictionary: Dictionary, *, seed: int = 0, progress: Progress | None = None
) -> Stability:
    """The words of all frames as they are and after each of CHANGES, compared.

    The picture is changed as the file holds it, in grey and before it is fitted, and stays of 8 bits where it was.
    Noise is drawn by seed and number of the frame. An image that cannot be read is skipped and named in a warning;
    VisionError if none can be read, or if the dictionary is of descriptors that were computed elsewhere.
    """
    describer(dictionary.spec)
    sequences = list(sequences)
    total = sum(len(sequence.frames) for sequence in sequences)
    words: list[Ints] = []
    kept: list[int] = []
    rows: list[Singles] = []
    for number, (frame, image) in enumerate(chain.from_iterable(map(all_images, sequences))):
        described = _described(frame, image, dictionary.spec, np.random.Generator(np.random.PCG64([seed, number])))
        if described is not None:
            rows.append(described)
            kept.append(number)
        if rows and (len(rows) == _CHUNK or number == total - 1):
            words.append(dictionary.words(np.concatenate(rows))[0].reshape(len(rows), -1))
            rows = []
        if progress is not None:
            progress(number + 1, total)
    if not kept:
        raise VisionError(f"none of the {total} images can be read; name a folder with images")
    starts = np.cumsum([len(sequence.frames) for sequence in sequences])
    sequence_of = np.searchsorted(starts, kept, side="right")
    return _compared(np.concatenate(words), sequence_of[1:] == sequence_of[:-1], dictionary.training.size)


def _compared(words: Ints, follows: Mask, size: int) -> Stability:
    """words (n, 1 + changes), the unchanged first; follows (n - 1,): whether the next row is of the same sequence."""

    def compared(kind: str, amount: str, before: Ints, after: Ints) -> ChangeResult:
        # Next to each other on the map, corners included.
        apart = np.maximum(np.abs(before // size - after // size), np.abs(before % size - after % size))
        return ChangeResult(kind, amount, len(before), int((apart > 0).sum()), int((apart == 1).sum()))

    changed = zip(CHANGES, words[:, 1:].T, strict=True)
    results = tuple(compared(change.kind, change.amount, words[:, 0], after) for change, after in changed)
    return Stability(len(words), results, compared(_NEXT, "", words[:-1, 0][follows], words[1:, 0][follows]))


def _described(frame: Frame, gray: Gray | str, spec: DescriptorSpec, rng: np.random.Generator) -> Singles | None:
    """Descriptors of a frame as it is and after each change, (1 + changes, d); None if it cannot be used."""
    if isinstance(gray, str):
        log.warning("%s; the frame is skipped", gray)
        return None
    try:
        return np.stack([descriptor(gray, spec), *(descriptor(each.apply(gray, spec, rng), spec) for each in CHANGES)])
    except VisionError as error:
        log.warning("%s: frame %s: %s; the frame is skipped", frame.path, frame.name, error)
    return None


def _like(values: NDArray[Any], gray: Gray) -> Gray:
    """Grey values cut to 0..255, and to whole numbers where the picture's are."""
    values = values.clip(0, 255)
    return cast(Gray, np.rint(values).astype(np.uint8) if gray.dtype == np.uint8 else values.astype(np.float32))


def _jpeg(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, quality: int) -> Gray:
    whole = np.rint(gray).astype(np.uint8)
    _, data = cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cast(Gray, cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))


def _noise(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, sigma: float) -> Gray:
    return _like(gray + sigma * rng.standard_normal(gray.shape), gray)


def _brightness(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, factor: float) -> Gray:
    return _like(gray * np.float64(factor), gray)


def _blur(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, sigma: float) -> Gray:
    return cast(Gray, cv2.GaussianBlur(gray, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))


def _shift(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, right: int, down: int) -> Gray:
    # What comes in from outside repeats the edge.
    height, width = gray.shape
    rows = np.clip(np.arange(height) - down, 0, height - 1)
    columns = np.clip(np.arange(width) - right, 0, width - 1)
    return gray[np.ix_(rows, columns)]


def _resized(gray: Gray, spec: DescriptorSpec, rng: np.random.Generator, *, interpolation: int) -> Gray:
    """The picture fitted to its square as `fit_image` does it, but by another filter."""
    height, width = gray.shape
    side = spec.image_size
    if spec.fit == "squash":
        height, width = side, side
    else:
        scale = max(side / height, side / width)
        height, width = int(scale * height + 0.5), int(scale * width + 0.5)
    top, left = (height - side) // 2, (width - side) // 2
    whole = cv2.resize(gray, (width, height), interpolation=interpolation)
    return _like(whole[top : top + side, left : left + side], gray)


CHANGES = (
    *(Change("JPEG", f"quality {q}", partial(_jpeg, quality=q)) for q in (90, 70, 50, 30)),
    *(Change("noise", f"sigma {s}", partial(_noise, sigma=s)) for s in (2, 5, 10)),
    *(Change("brightness", f"{p:+d} %", partial(_brightness, factor=1 + p / 100)) for p in (-30, -10, 10, 30)),
    *(Change("blur", f"sigma {s}", partial(_blur, sigma=s)) for s in (1, 2)),
    *(
        Change("shift by 1 pixel", way, partial(_shift, right=right, down=down))
        for way, right, down in (("left", -1, 0), ("right", 1, 0), ("up", 0, -1), ("down", 0, 1))
    ),
    Change("resize filter", "nearest", partial(_resized, interpolation=cv2.INTER_NEAREST)),
    Change("resize filter", "bicubic", partial(_resized, interpolation=cv2.INTER_CUBIC)),
)


def format_stability(found: Stability) -> str:
    """A line per change: the share of frames whose word changes, and of these the share that stays next to it."""
    lines = [f"Of {found.frames} frames", f"{'':<32}{'other word':>11}{'a neighbour':>13}{'farther':>9}"]
    for one in found.shown:
        shares = [percent(count / one.frames) for count in (one.changed, one.neighbour, one.changed - one.neighbour)]
        lines.append(f"{f'{one.kind} {one.amount}'.strip():<32}{shares[0]:>11}{shares[1]:>13}{shares[2]:>9}")
    return "\n".join(lines)


def plot_stability(found: Stability, path: Path | str) -> None:
    """Draw the shares as bars, PNG, SVG or PDF by suffix.

    Raises OutputError for another suffix or a path that cannot be written, MissingExtraError without matplotlib.
    """
    rows = found.shown
    groups = [list(group) for _, group in groupby(rows, key=lambda row: row.kind)]
    # Half a row of space between the kinds of change.
    tops = np.concatenate([np.arange(len(group)) for group in groups])
    tops = tops + np.repeat(np.cumsum([0, *(len(group) + 0.5 for group in groups[:-1])]), [len(g) for g in groups])
    near = np.array([100 * one.neighbour / one.frames for one in rows])
    far = np.array([100 * (one.changed - one.neighbour) / one.frames for one in rows])
    height = 1.6 + 0.26 * float(tops[-1] + 1)
    with figure_file(path, 9.0, height) as figure:
        axes = figure.add_axes((0.27, 0.6 / height, 0.68, 1 - 1.45 / height))
        axes.barh(tops, far, color=_FAR, height=0.8, label="to a word farther away on the map")
        axes.barh(tops, near, left=far, color=_NEAR, height=0.8, label="to one of the 8 neighbours of its unit")
        for top, share in zip(tops, near + far, strict=True):
            axes.text(share + 0.6, top, f"{share:.1f}", va="center", fontsize=8)
        names = [f"{one.kind} {one.amount}".strip() for one in rows]
        axes.set_yticks(tops, labels=names, fontsize=8.5)
        axes.tick_params(axis="y", length=0)
        axes.tick_params(axis="x", labelsize=8)
        axes.set(ylim=(tops[-1] + 0.7, -0.7), xlim=(0, max(10.0, 1.12 * float((near + far).max()))))
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.set_xlabel("frames whose word changes, %", fontsize=8.5)
        figure.text(0.02, 1 - 0.4 / height, f"How stable the words of {found.frames} frames are", fontsize=14)
        figure.legend(loc="upper left", bbox_to_anchor=(0.01, 1 - 0.5 / height), ncols=2, frameon=False, fontsize=8.5)
