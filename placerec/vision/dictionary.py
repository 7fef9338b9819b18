"""The visual dictionary: descriptor -> PCA -> unit of a self-organising map -> word."""

import logging
import re
from collections.abc import Sequence
from dataclasses import KW_ONLY, asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Singles
from placerec.errors import VisionError, counted
from placerec.frames.sequence import Image
from placerec.jobs import Executor
from placerec.version import __version__
from placerec.vision.chunks import Source, spooled
from placerec.vision.describe import Descriptors
from placerec.vision.learning import Quality, checked_rows, learn_map, training_rows, warn_of_few
from placerec.vision.lookup import Lookup
from placerec.vision.options import DictionaryOptions
from placerec.vision.pca import Pca, fit_pca, moments, project, projected
from placerec.vision.som import EpochProgress, MapQuality, Units, map_quality, nearest_units
from placerec.vision.spec import DescriptorSpec, descriptor
from placerec.vision.storage import Arrays, fingerprint, read_npz, write_npz

log = logging.getLogger(__name__)

FORMAT = "placerec-words"
ONE, SEVERAL = 1, 2  # versions of the file
_NAME = re.compile(r"[a-z]+[0-9]+")
_REMEDY = "make it again with `placerec train-words`"
_ARRAYS = {  # name -> type and axes: d values, k components, K units
    "mean": (np.float64, "d"),
    "components": (np.float32, "kd"),
    "variances": (np.float32, "k"),
    "codebook": (np.float32, "Kk"),
    "hits": (np.int64, "K"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Dictionary:
    """PCA + map: codebook float32 (K, k) and hits int64 (K,), the training frames per unit, row-major on the map.

    `sequences`: the names of the recordings that it was learnt from, as far as they are known. `name`: what a
    `DictionarySet` calls it, and `view`: the view of it (`options.View`), no part of a file of one.
    """

    spec: DescriptorSpec
    pca: Pca
    codebook: Singles
    hits: Ints
    training: DictionaryOptions
    quality: Quality
    sequences: tuple[str, ...] = ()
    _: KW_ONLY
    name: str = ""
    view: str = "plain"

    @classmethod
    def fit(
        cls,
        descriptors: Source,
        *,
        spec: DescriptorSpec,
        options: DictionaryOptions = DictionaryOptions(),
        progress: EpochProgress | None = None,
        work: Executor | None = None,
    ) -> "Dictionary":
        """Learn size x size words from descriptors (n, spec.length) in time order (readings A25-A29).

        `descriptors`: an array, a memory map, or a function that gives an iterator over float32 pieces of any length
        and is called three times: the memory then does not grow with n but for four bytes a frame. `progress`: called
        with epoch, epochs and quantisation error. `work`: whose other machines, if any, take a share of the sums
        (`cluster.cluster`). The bytes that `save` writes depend on descriptors and options alone, whoever does the
        work. Raises VisionError for unusable descriptors.
        """
        rows = training_rows(descriptors, spec, options)
        pca = fit_pca(moments(rows.source, work), options.components)
        # A fifth of the descriptors, for many passes.
        with spooled(projected(rows.source, pca), work) as codes:
            warn_of_few(codes.rows, options.size)
            som, quality = learn_map(codes, pca, rows, options, progress)
        return cls(spec, pca, som.codebook, som.hits, options, quality)

    def __repr__(self) -> str:
        size, components = self.training.size, len(self.pca.components)
        of = f"{components} components of {self.spec.kind} descriptors, {counted(len(self.sequences), 'sequence')}"
        return f"Dictionary({size} x {size} words, {self.dead} of them dead; {of})"

    @cached_property
    def vocabulary(self) -> tuple[str, ...]:
        """The K words in index order: "w" and the index, zero-padded to the digits of K - 1; "pn10.w07" with a name."""
        digits, start = len(str(len(self.codebook) - 1)), f"{self.name}.w" if self.name else "w"
        return tuple(f"{start}{unit:0{digits}d}" for unit in range(len(self.codebook)))

    @property
    def dead(self) -> int:
        """The number of units that no training frame hit."""
        return int((self.hits == 0).sum())

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that decides which word a frame gets, 64 hexadecimal digits.

        Not of what is only told about the map: a later version of placerec must know the dictionary again.
        """
        return fingerprint(self._arrays(), {"descriptor": self.spec.as_dict(), "units": self.training.units})

    def words(self, descriptors: Singles | Descriptors) -> tuple[Ints, Singles]:
        """The unit of every descriptor (n, spec.length), int64 (n,), and its distance in PCA space, float32 (n,).

        A frame's answer does not depend on the frames around it. Raises VisionError for unusable descriptors, and for
        `Descriptors` of another kind; of what kind a bare array is only its maker can know.
        """
        return words_in((self,), rows_to_look_up(descriptors, self.spec), self._lookup)[0]

    def quality_of(self, descriptors: Singles | Descriptors) -> MapQuality:
        """How well the map represents these frames, for instance of recordings that trained nothing."""
        codes = project(rows_to_look_up(descriptors, self.spec), self.pca)
        return map_quality(codes, self.codebook, self.hits)

    def word_of(self, image: Image | NDArray[Any]) -> tuple[str, float]:
        """The word of one image (`spec.descriptor`), and its distance from the word's unit in PCA space.

        Raises VisionError for an image that cannot be used.
        """
        units, distances = self.words(descriptor(image, self.spec)[None])
        return self.vocabulary[int(units[0])], float(distances[0])

    def words_of(self, image: Image | NDArray[Any]) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """The word of one image and its distance, as `DictionarySet.words_of` gives them for several."""
        word, distance = self.word_of(image)
        return (word,), (distance,)

    def save(self, path: Path | str) -> None:
        """Write words.npz: arrays and a JSON string `meta`, no pickle; the same dictionary gives the same bytes."""
        write_dictionaries(Path(path), (self,), self.spec)

    @classmethod
    def load(cls, path: Path | str) -> "Dictionary":
        """Read and check what `save` wrote; VisionError names the file, what is wrong with it, and the remedy."""
        dictionaries = read_dictionaries(Path(path))
        if len(dictionaries) > 1:
            raise VisionError(f"{path}: holds {len(dictionaries)} dictionaries; read it with DictionarySet.load")
        return dictionaries[0]

    @cached_property
    def units(self) -> Units:
        """The units that may answer, made ready for the search."""
        return Units.of(self.codebook, self.hits > 0 if self.training.units == "live" else None)

    @cached_property
    def _lookup(self) -> Lookup | None:
        return Lookup.of([(self.pca, self.units)])

    def _arrays(self) -> Arrays:
        return {**_of_pca(self.pca), "codebook": self.codebook, "hits": self.hits}


def words_in(
    dictionaries: Sequence[Dictionary], rows: Singles, lookup: Lookup | None
) -> tuple[tuple[Ints, Singles], ...]:
    """For every dictionary the units and distances of rows (n, d); `lookup`: what is known of them for one row."""
    alone = lookup.nearest(rows[0]) if lookup is not None and len(rows) == 1 else None
    if alone is not None:
        units, distances = alone
        return tuple((units[at : at + 1], distances[at : at + 1]) for at in range(len(dictionaries)))
    codes = {id(pca): project(rows, pca) for pca in {id(one.pca): one.pca for one in dictionaries}.values()}
    return tuple(nearest_units(codes[id(one.pca)], one.units) for one in dictionaries)


def rows_to_look_up(descriptors: Singles | Descriptors, spec: DescriptorSpec) -> Singles:
    """The descriptors as float32 (n, d); VisionError for unusable ones and for `Descriptors` of another kind."""
    if not isinstance(descriptors, Descriptors):
        return checked_rows(descriptors, spec)
    if not descriptors.spec.holds(spec):
        raise VisionError(
            f"the descriptors are of another kind ({descriptors.spec}) than the dictionary's ({spec}); "
            "describe the images with the dictionary's"
        )
    return checked_rows(descriptors.part(spec).values, spec)


def write_dictionaries(path: Path, dictionaries: tuple[Dictionary, ...], spec: DescriptorSpec) -> None:
    """Write words.npz of one dictionary, or of several: arrays of the first under plain names, others' as `hits.NAME`.

    A projection that several share is written once; `components.VIEW` is that of the first one named VIEW and a number.
    `spec`: the descriptors of all dictionaries, joined.
    """
    first = dictionaries[0]
    meta: dict[str, Any] = {
        "format": FORMAT,
        "version": ONE,
        "placerec": __version__,
        "descriptor": spec.as_dict(),
        "sequences": list(first.sequences),
    }
    arrays = first._arrays()
    if len(dictionaries) == 1:
        meta |= {} if first.view == "plain" else {"view": first.view}
        write_npz(path, arrays, {**meta, "training": asdict(first.training), "quality": asdict(first.quality)})
        return
    views = {id(first.pca): ""}
    members = []
    for one in dictionaries:
        view = views.setdefault(id(one.pca), view_of(one.name))
        arrays |= _named(_of_pca(one.pca), view) | _named({"codebook": one.codebook, "hits": one.hits}, one.name)
        told: dict[str, Any] = {"training": asdict(one.training), "quality": asdict(one.quality)}
        if one.spec != spec:
            told["descriptor"] = one.spec.kind
        members.append({"name": one.name, "view": one.view, "projection": view, **told})
    write_npz(path, arrays, {**meta, "version": SEVERAL, "dictionaries": members})


def read_dictionaries(path: Path) -> tuple[Dictionary, ...]:
    """Read and check what `write_dictionaries` wrote; VisionError as `Dictionary.load` says."""
    try:
        arrays, meta = read_npz(path, tuple(_ARRAYS), _more_arrays)
        return _restored(arrays, meta)
    except VisionError as error:
        named = {"no such file": "name another", "it is a folder": "name the words.npz of train-words or learn"}
        remedy = named.get(str(error), _REMEDY)
        raise VisionError(f"{path}: {error}; {remedy}") from error


def view_of(name: str) -> str:
    """The view in the name of a dictionary: `pn` of `pn10`."""
    return name.rstrip("0123456789")


def _of_pca(pca: Pca) -> Arrays:
    return {name: getattr(pca, name) for name in ("mean", "components", "variances")}


def _named(arrays: Arrays, suffix: str) -> Arrays:
    return {f"{name}.{suffix}": array for name, array in arrays.items()} if suffix else arrays


@dataclass(frozen=True)
class _Member:
    """What `meta` tells of a dictionary of the file."""

    name: str
    view: str
    spec: DescriptorSpec
    projection: str
    training: DictionaryOptions
    quality: Quality

    def arrays(self) -> dict[str, str]:
        """The names of the arrays, under the names that a dictionary alone gives them."""
        return {name: ".".join(filter(None, (name, self._suffix(name)))) for name in _ARRAYS}

    def _suffix(self, array: str) -> str:
        return self.name if array in ("codebook", "hits") else self.projection


def _members(meta: dict[str, Any]) -> list[_Member]:
    """The dictionaries that a file tells of, the first without a name; VisionError for what is no such file."""
    if meta.get("format") != FORMAT:
        raise VisionError("it is not a dictionary of placerec")
    if meta.get("version") not in (ONE, SEVERAL):
        raise VisionError(f"it has format version {meta.get('version')}, and this placerec reads {ONE} and {SEVERAL}")
    try:
        spec = DescriptorSpec(**meta["descriptor"])
        alone = {"name": "", "view": "plain", "projection": "", **meta, "descriptor": spec.kind}
        told = meta["dictionaries"] if meta["version"] == SEVERAL else [alone]
        members = [
            _Member(
                str(one["name"]),
                str(one["view"]),
                spec.part(*str(one.get("descriptor", spec.kind)).split("+")),
                str(one["projection"]),
                DictionaryOptions(**one["training"]),
                Quality(**one["quality"]),
            )
            for one in told
        ]
        check_names([member.name for member in members])
    except (KeyError, TypeError) as error:
        raise VisionError(f"its meta is incomplete ({error})") from error
    for member in members:
        if not all(isinstance(value, int | float) for value in asdict(member.quality).values()):
            raise VisionError("its meta holds a quality that is not a number")
    return members


def check_names(names: Sequence[str]) -> None:
    """VisionError unless the first of a set's dictionaries has no name, and the others names like `pn10`."""
    if not names or names[0]:
        raise VisionError("the first dictionary of a set has no name")
    for number, name in enumerate(names[1:], start=1):
        if not _NAME.fullmatch(name):
            raise VisionError(f"a dictionary cannot be called {name!r}; small letters and a number are a name")
        if name in names[:number]:
            raise VisionError(f"two dictionaries are called {name}")


def _more_arrays(meta: dict[str, Any]) -> list[str]:
    return [name for member in _members(meta) for name in member.arrays().values()]


def _restored(arrays: Arrays, meta: dict[str, Any]) -> tuple[Dictionary, ...]:
    members = _members(meta)
    try:
        sequences = tuple(map(str, meta.get("sequences", ())))
    except TypeError as error:
        raise VisionError(f"its meta is incomplete ({error})") from error
    projections: dict[str, Pca] = {}
    dictionaries = []
    for member in members:
        names = member.arrays()
        mine = {name: arrays[stored] for name, stored in names.items()}
        lengths = {"d": member.spec.length, "k": mine["variances"].size, "K": member.training.size**2}
        _check_arrays(mine, lengths, names)
        quality = member.quality
        pca = Pca(mine["mean"], mine["components"], mine["variances"], quality.explained, quality.needed)
        pca = projections.setdefault(member.projection, pca)
        of_map = mine["codebook"], mine["hits"]
        found = Dictionary(member.spec, pca, *of_map, member.training, quality, sequences)
        dictionaries.append(replace(found, name=member.name, view=member.view))
    return tuple(dictionaries)


def _check_arrays(arrays: Arrays, lengths: dict[str, int], names: dict[str, str]) -> None:
    for name, (dtype, axes) in _ARRAYS.items():
        array, shape = arrays[name], tuple(lengths[axis] for axis in axes)
        if array.dtype != dtype or array.shape != shape:
            raise VisionError(
                f"{names[name]} is {array.dtype} {array.shape}, not {np.dtype(dtype)} {shape}, as its meta tells"
            )
        if not np.isfinite(array).all():
            raise VisionError(f"{names[name]} holds NaN or infinite values")
    if arrays["hits"].min() < 0 or not arrays["hits"].any():
        raise VisionError(f"{names['hits']} holds no counts of frames")
