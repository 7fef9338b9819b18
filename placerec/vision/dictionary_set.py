"""Several dictionaries of the same descriptors, learned together and kept in one words.npz."""

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

from placerec.arrays import Ints, Singles
from placerec.errors import VisionError
from placerec.frames.sequence import Gray
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
from placerec.vision.learning import TrainingRows, learn_map, training_rows, warn_of_few
from placerec.vision.lookup import Lookup
from placerec.vision.options import DictionarySetOptions
from placerec.vision.pca import Pca, fit_pca, is_orthonormal, moments, projected
from placerec.vision.som import EpochProgress, MapQuality
from placerec.vision.spec import DescriptorSpec, descriptor
from placerec.vision.views import place_normalised, place_numbers

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class DictionarySet:
    """Dictionaries of one kind of descriptors; the first has no name, the others are named by view and size: `pn20`.

    Raises VisionError for other names, and for dictionaries of several kinds of descriptors.
    """

    dictionaries: tuple[Dictionary, ...]

    def __post_init__(self) -> None:
        check_names(self.names)
        if any(one.spec != self.spec for one in self.dictionaries):
            raise VisionError("dictionaries of several kinds of descriptors are no set")

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
        after the other) and `work`. Descriptors without a label train maps, but not the view `pn`, which is left out
        with a warning where fewer than two places are labelled. Raises VisionError for unusable descriptors, and if
        no view is left.
        """
        rows = training_rows(descriptors, spec, options.of_map(options.sizes[0]))
        pca = fit_pca(moments(rows.source, work), options.components)

        def learned(codes: SpooledRows, pca: Pca) -> list[Dictionary]:
            made = []
            for of_map in map(options.of_map, options.sizes):
                som, quality = learn_map(codes, pca, rows, of_map, progress)
                made.append(Dictionary(spec, pca, som.codebook, som.hits, of_map, quality))
            return made

        of_view: dict[str, list[Dictionary]] = {}
        normalised = None
        # A fifth of the descriptors, for many passes; handed out for those of a map alone.
        with spooled(projected(rows.source, pca), work if "plain" in options.views else None) as codes:
            warn_of_few(codes.rows, *options.sizes)
            if "plain" in options.views:
                of_view["plain"] = learned(codes, pca)
            if "pn" in options.views:
                normalised = _normalised(pca, codes, rows, places, options, work)
        if normalised is not None:
            with spooled(projected(rows.source, normalised), work) as codes:
                of_view["pn"] = learned(codes, normalised)
        made = [(view, one) for view in options.views for one in of_view.get(view, ())]
        others = (replace(one, name=f"{view}{one.training.size}") for view, one in made[1:])
        return cls((made[0][1], *others))

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
        views = ["plain" if is_orthonormal(one.pca) else "pn" for one in self.dictionaries]
        training = [one.training for one in self.dictionaries]
        rest = asdict(training[0])
        rest.pop("size")
        return DictionarySetOptions(
            tuple(dict.fromkeys(views)), tuple(dict.fromkeys(one.size for one in training)), **rest
        )

    @property
    def spec(self) -> DescriptorSpec:
        """What the descriptors are."""
        return self.dictionaries[0].spec

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
        return words_in(self.dictionaries, rows_to_look_up(descriptors, self.spec), self._lookup)

    def words_of(self, image: Gray) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """The words of one grey image (h, w) of 0..255, one for every dictionary, and the distances from their units.

        Raises VisionError for an image that cannot be used.
        """
        found = words_in(self.dictionaries, descriptor(image, self.spec)[None], self._lookup)
        words = (one.vocabulary[int(units[0])] for one, (units, _) in zip(self.dictionaries, found, strict=True))
        return tuple(words), tuple(float(distances[0]) for _, distances in found)

    def quality_of(self, descriptors: Singles | Descriptors) -> tuple[MapQuality, ...]:
        """How well each map represents these frames, for instance of recordings that trained nothing."""
        return tuple(one.quality_of(descriptors) for one in self.dictionaries)

    @cached_property
    def _lookup(self) -> Lookup | None:
        return Lookup.of([(one.pca, one.units) for one in self.dictionaries])

    def save(self, path: Path | str) -> None:
        """Write words.npz; a set of one dictionary is the file that `Dictionary.save` writes."""
        write_dictionaries(Path(path), self.dictionaries)

    @classmethod
    def load(cls, path: Path | str) -> "DictionarySet":
        """Read and check a words.npz of one dictionary or of several; VisionError as `Dictionary.load` says."""
        return cls(read_dictionaries(Path(path)))


def _normalised(
    pca: Pca,
    codes: SpooledRows,
    rows: TrainingRows,
    places: Sequence[str] | None,
    options: DictionarySetOptions,
    work: Executor | None,
) -> Pca | None:
    """The place-normalised projection; None, and a warning, if the labels do not give one and another view is left."""
    numbers = place_numbers(places, codes.rows if rows.kept is None else len(rows.kept))
    try:
        return place_normalised(pca, codes, numbers if rows.kept is None else numbers[rows.kept], work)
    except VisionError as error:
        if options.views == ("pn",):
            raise VisionError(
                f"the view pn cannot be learned: {error}; label more frames, or choose --views plain"
            ) from error
        log.warning("the view pn is left out: %s", error)
        return None
