"""What methods of descriptors see of a frame: the components of a view, or those of several views side by side.

A view is called what `--views` calls it: `lbp:pn`, `gist+lbp`; without a kind (`plain`, `pn`), of the descriptors that
the methods of one dictionary have words of. `views` are all those together that `hohmm` may have words of.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.errors import EvaluationError, VisionError
from placerec.experiments.cost import description_cost
from placerec.experiments.store import WordsJob
from placerec.frames.table import Labels
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionarySet
from placerec.vision.chunks import spooled
from placerec.vision.options import PROJECTIONS, View
from placerec.vision.pca import Pca, moments, project
from placerec.vision.views import fit_blocks, half_whitened, place_normalised, place_numbers

# The views that methods are compared on by default, and the name of all together.
PLAIN, NORMALISED = PROJECTIONS[:2]
ALL = "views"

# The points float32 (T, k) of the T frames of each sequence, those of the training first.
Points = tuple[Singles, ...]


@dataclass(frozen=True)
class SeenView:
    """All sequences as points of a view; `microseconds`: what describing a frame takes more for it than for PLAIN."""

    points: Points = field(repr=False)
    microseconds: float


@dataclass(frozen=True)
class _Frames:
    """The described frames of a job, the first `training` sequences to learn from.

    `spec`: what they are described by, and `dictionary`: that of the methods of one dictionary.
    """

    spec: DescriptorSpec
    found: tuple[Descriptors, ...] = field(repr=False)
    training: int
    dictionary: Dictionary

    def through(self, pca: Pca, spec: DescriptorSpec) -> Points:
        """The points of a projection of some of the descriptors."""
        return tuple(project(one.part(spec).values, pca) for one in self.found)

    def principal(self, spec: DescriptorSpec) -> Pca:
        """The PCA of some of the descriptors, the dictionary's where it is of these."""
        if spec == self.dictionary.spec:
            return self.dictionary.pca
        if spec not in self._principal:
            values = np.concatenate([one.part(spec).values for one in self.found[: self.training]])
            self._principal[spec] = fit_blocks(moments(values), spec.lengths, self.dictionary.training.components)
        return self._principal[spec]

    @cached_property
    def _principal(self) -> dict[DescriptorSpec, Pca]:
        return {}

    @cached_property
    def places(self) -> Ints:
        """The number of the place of each training frame, -1 for none."""
        labels = Labels.concat([one.table.places for one in self.found[: self.training]])
        return place_numbers(labels, len(labels))


def check_views(names: Iterable[str], spec: DescriptorSpec) -> None:
    """Raise EvaluationError for a view that frames which are described by `spec` do not have."""
    for name in names:
        if name != ALL:
            with _told(name):
                View.parse(name).part_of(spec)


def see(
    names: Iterable[str], job: WordsJob, dictionary: Dictionary, words: DictionarySet | None = None
) -> dict[str, SeenView]:
    """The frames of a job in PLAIN and in the views of these names, each fitted to the training sequences.

    `dictionary`: that of the methods of one dictionary, whose projection is PLAIN. `words`: dictionaries that `hohmm`
    uses as they are, with their projections; None for the default views, among which it chooses. Raises EvaluationError
    for a view that the frames do not have, or that their labels do not give.
    """
    frames = _Frames(
        job.train[0].spec, tuple(one.load() for one in (*job.train, *job.test)), len(job.train), dictionary
    )
    tests = frames.found[frames.training :]
    seen = {}
    for name in dict.fromkeys((PLAIN, *names)):
        with _told(name):
            spec = frames.spec if name == ALL else _part_of(View.parse(name), frames)
            points = _together(frames, words) if name == ALL else _points(View.parse(name), frames)
        more = 0.0
        if spec != dictionary.spec:
            more = max(description_cost(job, tests, spec) - description_cost(job, tests, dictionary.spec), 0.0)
        seen[name] = SeenView(points, more)
    return seen


@contextmanager
def _told(name: str) -> Iterator[None]:
    """An error that a view cannot be had names the methods that asked for it."""
    try:
        yield
    except VisionError as error:
        raise EvaluationError(f"no view for the methods @{name}: {error}; leave them out") from error


def _part_of(view: View, frames: _Frames) -> DescriptorSpec:
    return view.part_of(frames.spec) if view.kinds else frames.dictionary.spec


def _points(view: View, frames: _Frames) -> Points:
    spec = _part_of(view, frames)
    pca = frames.principal(spec)
    if view.projection == "half":
        return frames.through(half_whitened(pca), spec)
    points = frames.through(pca, spec)
    if view.projection == "plain":
        return points
    with spooled(np.concatenate(points[: frames.training])) as codes:
        normalised = place_normalised(pca, codes, frames.places, told=str(view))
    return frames.through(normalised, spec)


def _together(frames: _Frames, words: DictionarySet | None) -> Points:
    """The points of all views of `hohmm` side by side, each in units of the root of its training's total variance."""
    if words is None:
        blocks = [_points(view, frames) for view in View.default(frames.spec)]
    else:
        of_views = {(one.spec, one.view): one.pca for one in words.dictionaries}
        blocks = [frames.through(pca, spec) for (spec, _), pca in of_views.items()]
    scaled = [_scaled(block, frames.training) for block in blocks]
    return tuple(np.concatenate(of_sequence, axis=1) for of_sequence in zip(*scaled, strict=True))


def _scaled(points: Points, training: int) -> Sequence[Singles]:
    total = float(np.concatenate(points[:training]).var(axis=0, dtype=np.float64).sum())
    return [rows / np.float32(np.sqrt(total or 1.0)) for rows in points]
