"""How stable words are: the share of frames that get another word by a camera's small faults, or in another light."""

import logging
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, groupby, islice
from pathlib import Path
from statistics import NormalDist

import numpy as np

from placerec.arrays import Ints, Mask, Singles
from placerec.errors import SourceError, VisionError, counted
from placerec.evaluation.summary import percent
from placerec.figures.canvas import figure_file, picture_file
from placerec.frames import Frame, Sequence, SourceOptions, find_sequences, images_at
from placerec.frames.image import read_image
from placerec.frames.sequence import Image
from placerec.inspection.changes import CHANGES, SIMULATED, in_lights, with_faults
from placerec.jobs import Executor, Progress, workers
from placerec.vision import Dictionary, DictionarySet
from placerec.vision.light import LIGHTS
from placerec.vision.spec import check_describable, descriptor

log = logging.getLogger(__name__)

# Frames that are looked at where nothing else is said: the interval of a share is 9 % wide at most.
SAMPLE = 500
# Frames that a worker looks at in one go.
_TOGETHER = 8
_NONE = -1

# Okabe and Ito's vermilion and sky blue.
_FAR, _NEAR = "#D55E00", "#56B4E9"
_NEXT = "the next frame, for comparison"
# The kind and the amount of each change.
_Names = list[tuple[str, str]]
_FAULTS: _Names = [(one.kind, one.amount) for one in CHANGES]
_LIGHTS: _Names = [(SIMULATED, light) for light in LIGHTS]


@dataclass(frozen=True)
class ChangeResult:
    """How many frames got another word by a change, and how many of these the word of a unit next to it (of 8).

    Also of pairs of consecutive frames, which tell how much words change anyway. `of`: the frames that these `frames`
    were drawn from.
    """

    kind: str
    amount: str
    frames: int
    changed: int
    neighbour: int
    of: int

    @property
    def share(self) -> float:
        """The share of 1 of those that changed, nan where there are no frames."""
        return self.changed / self.frames if self.frames else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """What the share of all frames is with 95 % confidence (Wilson's score interval, for a finite population)."""
        if self.frames >= self.of:
            return self.share, self.share
        # As many as would tell as much if there were infinitely many frames to draw from.
        n = self.frames * (self.of - 1) / (self.of - self.frames)
        z = NormalDist().inv_cdf(0.975)
        middle = (self.share + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(self.share * (1 - self.share) / n + z * z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)

    def shares(self) -> dict[str, object]:
        """The shares of 1 of those that changed, and the interval, None where there are no frames."""
        if not self.frames:
            return {"changed": None, "interval": None, "to_neighbour": None}
        return {"changed": self.share, "interval": list(self.interval), "to_neighbour": self.neighbour / self.frames}


@dataclass(frozen=True)
class Stability:
    """The result for every change, over `frames` of `of` frames, and for the step from a frame to the next."""

    frames: int
    of: int
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
            "of": self.of,
            "changes": [{"kind": one.kind, "amount": one.amount, **one.shares()} for one in self.results],
            "next_frame": {"steps": self.step.frames, **self.step.shares()},
        }


def stability(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str | None = None,
    *,
    name: str = "",
    network: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    light: bool = False,
    seed: int = 0,
    sample: int = SAMPLE,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> Stability:
    """`placerec stability`: how many frames of the sources get another word by what a camera does to pictures.

    `out`: the picture to draw, PNG, SVG or PDF by suffix. `name`: which dictionary of several, "" for the first.
    `network`: the file of the image network, for words of one. `light`: in the simulated lights of `placerec relight`
    instead. `seed`, `sample`, `work`: see `word_changes`. Raises SourceError and VisionError for what cannot be read,
    OutputError for a picture that cannot be written, MissingExtraError without matplotlib.
    """
    with picture_file(out) as picture:
        dictionary = DictionarySet.load(words, network=network).named(name)
        sequences = find_sequences(sources, options=source_options)
        found = word_changes(sequences, dictionary, light=light, seed=seed, sample=sample, work=work, progress=progress)
        if picture is not None:
            plot_stability(found, picture)
    return found


def word_changes(
    sequences: Iterable[Sequence],
    dictionary: Dictionary,
    *,
    light: bool = False,
    seed: int = 0,
    sample: int = SAMPLE,
    work: Executor | None = None,
    progress: Progress | None = None,
) -> Stability:
    """The words of `sample` frames, drawn by `seed`, as they are and changed, compared; of all if fewer.

    The changes are CHANGES. The picture is changed as the file holds it, before it is fitted, and stays of 8 bits where
    it was: in grey, and for descriptors of colours in these, too, but for the resize filter, which is that of grey
    levels. Noise is drawn by seed and number of the frame. With `light` the changes are `placerec.vision.light.LIGHTS`,
    and the words those of the sequences that `placerec relight` writes with this seed.

    `work`: who does the work (`jobs.workers`), None for threads; the
    result does not depend on it. `progress` is called with pictures done and in all. An image that cannot be read is
    skipped and named in a warning; VisionError if none can be read, or if the dictionary is of descriptors that were
    computed elsewhere.
    """
    check_describable(dictionary.spec)
    sequences = list(sequences)
    starts = np.cumsum([0, *(len(sequence.frames) for sequence in sequences)])
    total = int(starts[-1])
    drawn = np.sort(np.random.Generator(np.random.PCG64(seed)).permutation(total)[:sample])
    # With the frame after each, of the same sequence.
    wanted = np.union1d(drawn, np.setdiff1d(drawn + 1, starts))
    parts = _parts(sequences, starts, wanted, np.isin(wanted, drawn), dictionary.spec.colours or light)
    words = []
    for found, complaints in (work or workers())(_Look(dictionary, seed, light), parts):
        for complaint in complaints:
            log.warning("%s; the frame is skipped", complaint)
        words.append(found)
        if progress is not None:
            progress(sum(map(len, words)), len(wanted))
    judged = _Judged(np.concatenate(words), wanted, drawn, starts)
    if not len(judged.rows):
        raise VisionError(f"none of the {counted(total, 'image')} can be read; name a folder with images")
    return judged.result(dictionary.training.size, _LIGHTS if light else _FAULTS)


@dataclass(frozen=True, eq=False)
class _Part:
    """Some frames of one sequence, by their `numbers` int64 (m,) among all, and which are to be `changed`, bool (m,).

    `start`: the number of the sequence's first frame. `images`: the frames' images, or why there are none; None if each
    is still in a file of its own.
    """

    sequence: str
    start: int
    numbers: Ints
    changed: Mask
    frames: tuple[Frame, ...]
    images: tuple[Image | str, ...] | None


def _parts(sequences: list[Sequence], starts: Ints, wanted: Ints, changed: Mask, colours: bool) -> Iterator[_Part]:
    """The wanted frames with what is to be done to them, a second or so of work each time."""
    for sequence, start, end in zip(sequences, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        own = slice(*np.searchsorted(wanted, (start, end)).tolist())
        at = (wanted[own] - start).tolist()
        images = iter(()) if sequence.recording is None else images_at(sequence, at, colours=colours)
        for first in range(own.start, own.stop, _TOGETHER):
            some = slice(first, min(first + _TOGETHER, own.stop))
            frames = tuple(sequence.frames[number - start] for number in wanted[some].tolist())
            taken = None if sequence.recording is None else tuple(islice(images, len(frames)))
            yield _Part(sequence.name, start, wanted[some], changed[some], frames, taken)


@dataclass(frozen=True)
class _Look:
    """Looks up the words of frames, in a worker."""

    dictionary: Dictionary
    seed: int
    light: bool

    def __call__(self, part: _Part) -> tuple[Ints, list[str]]:
        """The words int64 (m, 1 + changes), _NONE where there are none, and complaints of frames that cannot be read.

        A function of the part alone.
        """
        words = np.full((len(part.numbers), 1 + len(_LIGHTS if self.light else _FAULTS)), _NONE)
        complaints = []
        for k in range(len(part.numbers)):
            found = self._described(part, k)
            if isinstance(found, str):
                complaints.append(found)
            else:
                words[k, : len(found)] = self.dictionary.words(found)[0]
        return words, complaints

    def _described(self, part: _Part, k: int) -> Singles | str:
        """Descriptors of a frame as it is and, if that is wanted, changed, (1 + changes, d); why there are none."""
        frame, spec = part.frames[k], self.dictionary.spec
        image = None if part.images is None else part.images[k]
        if isinstance(image, str):
            return image
        try:
            read = read_image(frame.path, colours=spec.colours or self.light) if image is None else image
            changes = self._changed(read, part, k) if part.changed[k] else ()
            return np.stack([descriptor(each, spec) for each in chain((read,), changes)])
        except SourceError as error:
            return str(error)
        except VisionError as error:
            return f"{frame.path}: frame {frame.name}: {error}"

    def _changed(self, image: Image, part: _Part, k: int) -> Iterator[Image]:
        spec, number = self.dictionary.spec, int(part.numbers[k])
        if self.light:
            return in_lights(image, spec, seed=self.seed, sequence=part.sequence, frame=number - part.start)
        return with_faults(image, spec, np.random.Generator(np.random.PCG64([self.seed, number])))


@dataclass(frozen=True, eq=False)
class _Judged:
    """words int64 (w, 1 + changes) of the frames `wanted` (w,), the unchanged first; `drawn`: the frames to judge."""

    words: Ints
    wanted: Ints
    drawn: Ints
    starts: Ints

    @property
    def rows(self) -> Ints:
        """The rows of the frames to judge that could be read."""
        return self._readable(np.searchsorted(self.wanted, self.drawn))

    def _readable(self, rows: Ints) -> Ints:
        found: Ints = rows[self.words[rows, 0] != _NONE]
        return found

    def result(self, size: int, names: _Names) -> Stability:
        """What came of the changes that are called `names`, on a map of size x size."""
        rows, words = self.rows, self.words
        # With a frame after them, of the same sequence, that could be read, too.
        before = rows[np.isin(self.wanted[rows] + 1, self.wanted[self._readable(np.arange(len(words)))])]
        before = before[~np.isin(self.wanted[before] + 1, self.starts)]
        total, steps = int(self.starts[-1]), int(self.starts[-1]) - len(np.unique(self.starts)) + 1
        if len(self.drawn) == total:
            total, steps = len(rows), len(before)
        changed = zip(names, words[rows, 1:].T, strict=True)
        results = tuple(_compared(*name, words[rows, 0], after, total, size) for name, after in changed)
        step = _compared(_NEXT, "", words[before, 0], words[before + 1, 0], steps, size)
        return Stability(len(rows), total, results, step)


def _compared(kind: str, amount: str, first: Ints, after: Ints, of: int, size: int) -> ChangeResult:
    # Next to each other on the map, corners included.
    apart = np.maximum(np.abs(first // size - after // size), np.abs(first % size - after % size))
    return ChangeResult(kind, amount, len(first), int((apart > 0).sum()), int((apart == 1).sum()), of)


def format_stability(found: Stability) -> str:
    """A line per change: the share of frames whose word changes, its interval, and the share that stays next to it."""
    drawn = found.frames < found.of
    head = f"Of {counted(found.frames, 'frame')}" + (f", drawn from {found.of}" if drawn else "")
    lines = [
        head,
        f"{'':<32}{'other word':>11}{'95 % interval' * drawn:>{17 * drawn}}{'a neighbour':>13}{'farther':>9}",
    ]
    for one in found.shown:
        shares = [percent(count / one.frames) for count in (one.changed, one.neighbour, one.changed - one.neighbour)]
        low, high = (100 * end for end in one.interval)
        interval = f"{f'{low:.1f} to {high:.1f} %':>17}" if drawn else ""
        lines.append(f"{f'{one.kind} {one.amount}'.strip():<32}{shares[0]:>11}{interval}{shares[1]:>13}{shares[2]:>9}")
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
        drawn = f" (drawn from {found.of})" if found.frames < found.of else ""
        figure.text(
            0.02, 1 - 0.4 / height, f"How stable the words of {counted(found.frames, 'frame')}{drawn} are", fontsize=14
        )
        figure.legend(loc="upper left", bbox_to_anchor=(0.01, 1 - 0.5 / height), ncols=2, frameon=False, fontsize=8.5)
