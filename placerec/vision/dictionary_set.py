"""Several dictionaries, of one or more views of a frame, learned together and kept in one words.npz."""

import hashlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from placerec.arrays import Ints, Singles
from placerec.errors import VisionError
from placerec.frames.sequence import Image
from placerec.jobs import Executor
from placerec.vision.chunks import Source, SpooledRows, spooled
from placerec.vision.describe import Descriptors
from placerec.vision.dictionary import (
    Dictionary,
    check_names,
    read_dictionaries,
    rows_to_look_up,
    words_in,
    write_dictionaries,
)
from placerec.vision.learning import TrainingRows, learn_map, some_columns, training_rows, warn_of_few
from placerec.vision.lookup import Lookup
from placerec.vision.options import DictionarySetOptions, View
from placerec.vision.pca import Pca, moments, projected
from placerec.vision.som import EpochProgress, MapQuality
from placerec.vision.spec import DescriptorSpec, descriptor
from placerec.vision.views import fit_blocks, half_whitened, place_normalised, place_numbers

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class DictionarySet:
    """Dictionaries of one frame's descriptors; the first has no name, others are named by view and size: `pn20`.

    Raises VisionError for other names, and for dictionaries whose descriptors are made with different settings.
    """

    dictionaries: tuple[Dictionary, ...]

    def __post_init__(self) -> None:
        check_names(self.names)
        for one in self.dictionaries:
            self.spec.columns_of(one.spec)

    @classmethod
    def of(cls, dictionary: "Dictionary | DictionarySet") -> "DictionarySet":
        """The set as it is, or that of one dictionary."""
        return cls((replace(dictionary, name=""),)) if isinstance(dictionary, Dictionary) else dictionary

    @classmethod
    def fit(
        cls,
        descriptors: Source,
        *,
        spec: DescriptorSpec,
        places: Sequence[str] | None = None,
        options: DictionarySetOptions = DictionarySetOptions(),
        progress: EpochProgress | None = None,
        work: Executor | None = None,
    ) -> "DictionarySet":
        """Learn a dictionary for every view and size from descriptors (n, spec.length) in time order.

        `places`: the label of each row, "" where there is none. A map of the view `plain` is the one that
        `Dictionary.fit` learns with that size and seed, which tells of `descriptors`, `progress` (called for one map
        after the other) and `work`. Descriptors without a label train maps, but no view `pn`. Where fewer than
        two places are labelled, views `pn` that were named are left out with a warning, and those of the default are
        `half`. Raises VisionError for unusable descriptors, and if no view is left.
        """
        rows = training_rows(descriptors, spec, options.of_map(options.sizes[0]))
        labelled = len({*(places or ())} - {""}) > 1
        views = options.views_of(spec, labelled)
        if not (labelled or options.views):
            log.warning("no two places are labelled: views are half whitened, not normalised by places")
        made: dict[View, list[Dictionary]] = {}
        missing: dict[View, str] = {}
        for part in dict.fromkeys(view.part_of(spec) for view in views):
            own = replace(rows, source=some_columns(rows.source, spec.columns_of(part)))
            wanted = {view.projection: view for view in views if view.part_of(spec) == part}
            told = {projection: view.told_in(spec) for projection, view in wanted.items()}
            for projection, maps in _fit_part(own, part, places, told, options, progress, work).items():
                if isinstance(maps, str):
                    missing[wanted[projection]] = maps
                else:
                    made[wanted[projection]] = maps
        named = [
            replace(one, view=view.told_in(spec), name=f"{view.name_in(spec)}{one.training.size}")
            for view in views
            for one in made.get(view, ())
        ]
        _tell_missing(missing, left=len(named))
        warn_of_few(named[0].quality.used, *options.sizes)
        return cls((replace(named[0], name=""), *named[1:]))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the dictionaries, "" that of the first."""
        return tuple(one.name for one in self.dictionaries)

    def named(self, name: str) -> Dictionary:
        """The dictionary of a name, "" for the first; VisionError that lists the names if there is no such one."""
        if name not in self.names:
            named = ", ".join(self.names[1:]) or "no other dictionary"
            raise VisionError(f"no dictionary is called {name!r}; there is the first, without a name, and {named}")
        return self.dictionaries[self.names.index(name)]

    @property
    def options(self) -> DictionarySetOptions:
        """The options that such a set is learned with."""
        views = [one.view for one in self.dictionaries]
        training = [one.training for one in self.dictionaries]
        rest = asdict(training[0])
        rest.pop("size")
        return DictionarySetOptions(
            tuple(dict.fromkeys(views)), tuple(dict.fromkeys(one.size for one in training)), **rest
        )

    @cached_property
    def spec(self) -> DescriptorSpec:
        """What a frame's descriptor is: those of all dictionaries, joined in the order of the dictionaries."""
        settings: dict[str, Any] = {}
        for one in self.dictionaries:
            settings |= {name: getattr(one.spec, name) for name in one.spec.settings}
        kinds = dict.fromkeys(kind for one in self.dictionaries for kind in one.spec.kinds)
        return DescriptorSpec(**{**settings, "kind": "+".join(kinds)})

    @property
    def sequences(self) -> tuple[str, ...]:
        """The names of the recordings that trained the dictionaries, as far as they are known."""
        return self.dictionaries[0].sequences

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that decides which words a frame gets, 64 hexadecimal digits; one dictionary's is its own."""
        if len(self.dictionaries) == 1:
            return self.dictionaries[0].fingerprint
        of_each = "".join(f"{one.name} {one.fingerprint}\n" for one in self.dictionaries)
        return hashlib.sha256(of_each.encode()).hexdigest()

    def words(self, descriptors: Singles | Descriptors) -> tuple[tuple[Ints, Singles], ...]:
        """For every dictionary the units int64 (n,) and distances float32 (n,) that `Dictionary.words` gives."""
        rows = rows_to_look_up(descriptors, self.spec)
        found: dict[str, tuple[Ints, Singles]] = {}
        for columns, dictionaries, lookup in self._parts:
            answers = words_in(dictionaries, rows[:, columns], lookup)
            found |= zip((one.name for one in dictionaries), answers, strict=True)
        return tuple(found[name] for name in self.names)

    def words_of(self, image: Image | NDArray[Any]) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """The words of one image (`spec.descriptor`), one for every dictionary, and the distances from their units.

        Raises VisionError for an image that cannot be used.
        """
        found = self.words(descriptor(image, self.spec)[None])
        words = (one.vocabulary[int(units[0])] for one, (units, _) in zip(self.dictionaries, found, strict=True))
        return tuple(words), tuple(float(distances[0]) for _, distances in found)

    def quality_of(self, descriptors: Singles | Descriptors) -> tuple[MapQuality, ...]:
        """How well each map represents these frames, for instance of recordings that trained nothing."""
        rows = rows_to_look_up(descriptors, self.spec)
        return tuple(one.quality_of(rows[:, self.spec.columns_of(one.spec)]) for one in self.dictionaries)

    @cached_property
    def _parts(self) -> tuple[tuple[slice | list[int], tuple[Dictionary, ...], Lookup | None], ...]:
        """The columns of each kind of descriptors, its dictionaries, and what is known of these for one row."""
        parts = []
        for spec in dict.fromkeys(one.spec for one in self.dictionaries):
            own = tuple(one for one in self.dictionaries if one.spec == spec)
            parts.append((self.spec.columns_of(spec), own, Lookup.of([(one.pca, one.units) for one in own])))
        return tuple(parts)

    def save(self, path: Path | str) -> None:
        """Write words.npz; a set of one dictionary is the file that `Dictionary.save` writes."""
        write_dictionaries(Path(path), self.dictionaries, self.spec)

    @classmethod
    def load(cls, path: Path | str, *, network: Path | str | None = None) -> "DictionarySet":
        """Read and check a words.npz of one dictionary or of several; VisionError as `Dictionary.load` says.

        `network`: the file of the image network that the words are of; without it no image can be described.
        VisionError for another network, and where there is none.
        """
        found = read_dictionaries(Path(path))
        if network is None:
            return cls(found)
        spec = cls(found).spec.with_network(network)
        return cls(tuple(replace(one, spec=spec.part(*one.spec.kinds)) for one in found))


def _fit_part(
    rows: TrainingRows,
    spec: DescriptorSpec,
    places: Sequence[str] | None,
    projections: Mapping[str, str],
    options: DictionarySetOptions,
    progress: EpochProgress | None,
    work: Executor | None,
) -> dict[str, list[Dictionary] | str]:
    """For every projection of some descriptors the dictionaries of all sizes, or why it cannot be learned.

    `projections`: what the view of each is called.
    """
    pca = fit_blocks(moments(rows.source, work), spec.lengths, options.components)

    def learned(codes: SpooledRows, pca: Pca) -> list[Dictionary]:
        made = []
        for of_map in map(options.of_map, options.sizes):
            som, quality = learn_map(codes, pca, rows, of_map, progress)
            made.append(Dictionary(spec, pca, som.codebook, som.hits, of_map, quality))
        return made

    of_projection: dict[str, list[Dictionary] | str] = {}
    others: dict[str, Pca | str] = {"half": half_whitened(pca)} if "half" in projections else {}
    # A fifth of the descriptors, for many passes; handed out for those of a map alone.
    with spooled(projected(rows.source, pca), work if "plain" in projections else None) as codes:
        if "plain" in projections:
            of_projection["plain"] = learned(codes, pca)
        if "pn" in projections:
            others["pn"] = _normalised(pca, codes, rows, places, projections["pn"], work)
    for projection, found in others.items():
        if isinstance(found, str):
            of_projection[projection] = found
        else:
            with spooled(projected(rows.source, found), work) as codes:
                of_projection[projection] = learned(codes, found)
    return of_projection


def _normalised(
    pca: Pca,
    codes: SpooledRows,
    rows: TrainingRows,
    places: Sequence[str] | None,
    told: str,
    work: Executor | None,
) -> Pca | str:
    """The place-normalised projection, or why the labels do not give one."""
    numbers = place_numbers(places, codes.rows if rows.kept is None else len(rows.kept))
    try:
        return place_normalised(pca, codes, numbers if rows.kept is None else numbers[rows.kept], work, told=told)
    except VisionError as error:
        return str(error)


def _tell_missing(missing: Mapping[View, str], left: int) -> None:
    """A warning of the views that cannot be learned; VisionError if none of the dictionaries is `left`."""
    if missing:
        told = f"the view{'s' * (len(missing) > 1)} {', '.join(map(str, missing))}"
        why = next(iter(missing.values()))
        if not left:
            raise VisionError(f"{told} cannot be learned: {why}; label more frames, or choose --views plain")
        log.warning("%s %s left out: %s", told, "are" if len(missing) > 1 else "is", why)
