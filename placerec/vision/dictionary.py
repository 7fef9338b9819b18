"""The visual dictionary: descriptor -> PCA -> unit of a self-organising map -> word."""

import logging
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.errors import VisionError
from placerec.frames.sequence import Gray
from placerec.jobs import Executor
from placerec.version import __version__
from placerec.vision.chunks import Source, chunks, first_unusable, spooled
from placerec.vision.describe import Descriptors
from placerec.vision.pca import Pca, fit_pca, moments, project, projected
from placerec.vision.som import RULES, WIDTH, EpochProgress, MapQuality, Units, map_quality, nearest_units, train_som
from placerec.vision.spec import DescriptorSpec, descriptor
from placerec.vision.storage import Arrays, fingerprint, read_npz, write_npz

log = logging.getLogger(__name__)

FORMAT, VERSION = "placerec-words", 1
UNITS = ("live", "all")
_REMEDY = "make it again with `placerec train-words`"
_ARRAYS = {  # name -> type and axes: d values, k components, K units
    "mean": (np.float64, "d"),
    "components": (np.float32, "kd"),
    "variances": (np.float32, "k"),
    "codebook": (np.float32, "Kk"),
    "hits": (np.int64, "K"),
}


@dataclass(frozen=True)
class DictionaryOptions:
    """How a dictionary of size x size words is learned: the options of `train-words`.

    `components`: how many principal components the map sees. `fraction`: the share of the frames, drawn by `seed`,
    that PCA and map see. `units`: answer with those that at least one training frame hit (`live`: no language model
    can know the others), or with `all`. `rule`, `width`, `epochs`: how the map learns, see `train_som`. Raises
    VisionError for a value that cannot be used.
    """

    size: int = 10
    components: int = 80
    seed: int = 0
    fraction: float = 1.0
    epochs: int | None = None
    units: str = "live"
    rule: str = "batch"
    width: float = WIDTH

    def __post_init__(self) -> None:
        for name in ("size", "components", "epochs"):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= 1) and not (name == "epochs" and value is None):
                raise VisionError(f"{name} {value} cannot be used; give a number of 1 or more")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise VisionError(f"seed {self.seed} cannot be used; give a number of 0 or more")
        if not isinstance(self.fraction, float | int) or not 0 < self.fraction <= 1:
            raise VisionError(f"fraction {self.fraction} cannot be used; give a number above 0 and up to 1")
        if not isinstance(self.width, float | int) or not 0 < self.width < np.inf:
            raise VisionError(f"width {self.width} cannot be used; give a number above 0")
        for name, value, choices in (("choice of units", self.units, UNITS), ("rule", self.rule, RULES)):
            if value not in choices:
                raise VisionError(f"no {name} is called {value!r}; choose one of {', '.join(choices)}")


@dataclass(frozen=True)
class Quality:
    """What came of it, over the frames that were used; the errors, entropy and dead units are those of `MapQuality`.

    `explained`: the share of the variance that the components keep; `needed`: the components that would keep 99 %.
    """

    frames: int
    used: int
    epochs: int
    explained: float
    needed: int
    quantisation_error: float
    topographic_error: float
    entropy: float
    dead: int


@dataclass(frozen=True, eq=False, repr=False)
class Dictionary:
    """PCA + map: codebook float32 (K, k) and hits int64 (K,), the training frames per unit, row-major on the map.

    `sequences`: the names of the recordings that it was learnt from, as far as they are known.
    """

    spec: DescriptorSpec
    pca: Pca
    codebook: Singles
    hits: Ints
    training: DictionaryOptions
    quality: Quality
    sequences: tuple[str, ...] = ()

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
        size = options.size
        rng = np.random.Generator(np.random.PCG64(options.seed))
        source = _checked(descriptors, spec)
        frames = None
        if options.fraction < 1:
            frames = len(source) if isinstance(source, np.ndarray) else sum(map(len, chunks(source)))
            source = _drawn(source, frames, options.fraction, rng)
        data = moments(source, work)
        pca = fit_pca(data, options.components)
        if data.n < size * size:
            log.warning("%d frames cannot fill the %d words of a map of size %d", data.n, size * size, size)
        # A fifth of the descriptors, for many passes.
        with spooled(projected(source, pca), work) as codes:
            som = train_som(
                codes,
                size,
                rng=rng,
                rule=options.rule,
                width=options.width,
                epochs=options.epochs,
                progress=progress,
            )
            got = map_quality(codes, som.codebook, som.hits)
        errors = got.quantisation_error, got.topographic_error, got.entropy, got.dead
        quality = Quality(frames or data.n, data.n, som.epochs, pca.explained, pca.needed, *errors)
        return cls(spec, pca, som.codebook, som.hits, options, quality)

    def __repr__(self) -> str:
        size, components = self.training.size, len(self.pca.components)
        of = f"{components} components of {self.spec.kind} descriptors, {len(self.sequences)} sequences"
        return f"Dictionary({size} x {size} words, {self.dead} of them dead; {of})"

    @cached_property
    def vocabulary(self) -> tuple[str, ...]:
        """The K words in index order: "w" and the index, zero-padded to the digits of K - 1."""
        digits = len(str(len(self.codebook) - 1))
        return tuple(f"w{unit:0{digits}d}" for unit in range(len(self.codebook)))

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
        return nearest_units(self._codes(descriptors), self._units)

    def quality_of(self, descriptors: Singles | Descriptors) -> MapQuality:
        """How well the map represents these frames, for instance of recordings that trained nothing."""
        return map_quality(self._codes(descriptors), self.codebook, self.hits)

    def word_of(self, image: Gray) -> tuple[str, float]:
        """The word of one grey image (h, w) of 0..255, and its distance from the word's unit in PCA space.

        Raises VisionError for an image that cannot be used.
        """
        units, distances = self.words(descriptor(image, self.spec)[None])
        return self.vocabulary[int(units[0])], float(distances[0])

    def save(self, path: Path | str) -> None:
        """Write words.npz: arrays and a JSON string `meta`, no pickle; the same dictionary gives the same bytes."""
        meta = {
            "format": FORMAT,
            "version": VERSION,
            "placerec": __version__,
            "descriptor": self.spec.as_dict(),
            "training": asdict(self.training),
            "quality": asdict(self.quality),
            "sequences": list(self.sequences),
        }
        write_npz(Path(path), self._arrays(), meta)

    @classmethod
    def load(cls, path: Path | str) -> "Dictionary":
        """Read and check what `save` wrote; VisionError names the file, what is wrong with it, and the remedy."""
        try:
            arrays, meta = read_npz(Path(path), tuple(_ARRAYS))
            return _restored(arrays, meta)
        except VisionError as error:
            remedy = "name another" if str(error) == "no such file" else _REMEDY
            raise VisionError(f"{path}: {error}; {remedy}") from error

    @cached_property
    def _units(self) -> Units:
        return Units.of(self.codebook, self.hits > 0 if self.training.units == "live" else None)

    def _codes(self, descriptors: Singles | Descriptors) -> Singles:
        if isinstance(descriptors, Descriptors):
            if descriptors.spec != self.spec:
                raise VisionError(
                    f"the descriptors are of another kind ({descriptors.spec}) than the dictionary's ({self.spec}); "
                    "describe the images with the dictionary's"
                )
            descriptors = descriptors.values
        return project(_check(descriptors, self.spec), self.pca)

    def _arrays(self) -> Arrays:
        pca = {name: getattr(self.pca, name) for name in ("mean", "components", "variances")}
        return {**pca, "codebook": self.codebook, "hits": self.hits}


def _checked(descriptors: Source, spec: DescriptorSpec) -> Source:
    if not callable(descriptors):
        return _check(descriptors, spec)
    give = descriptors

    def pieces() -> Iterator[Singles]:
        first = 0
        for piece in give():
            yield _check(piece, spec, first)
            first += len(piece)

    return pieces


def _check(descriptors: Singles, spec: DescriptorSpec, first: int = 0) -> Singles:
    """The descriptors as float32; `first`: the index of their first row, for the message."""
    rows = np.asarray(descriptors)
    if rows.ndim != 2 or rows.dtype.kind not in "uif":
        raise VisionError(f"descriptors are float32 (n, {spec.length}), and these are {rows.dtype} {rows.shape}")
    if rows.shape[1] != spec.length:
        raise VisionError(f"the descriptors have {rows.shape[1]} values, and the dictionary's have {spec.length}")
    rows = rows.astype(np.float32, copy=False)
    bad = first_unusable(rows)
    if bad is not None:
        raise VisionError(f"descriptor {first + bad} (from 0) holds NaN or infinite values; leave it out")
    return rows


def _drawn(source: Source, n: int, fraction: float, rng: np.random.Generator) -> Source:
    """`fraction` of the n rows of a source, at least one, in their order."""
    kept = np.zeros(n, np.bool_)
    kept[rng.permutation(n)[: max(1, round(fraction * n))]] = True

    def pieces() -> Iterator[Singles]:
        first = 0
        for rows in chunks(source):
            yield rows[kept[first : first + len(rows)]]
            first += len(rows)

    return pieces


def _restored(arrays: Arrays, meta: dict[str, Any]) -> Dictionary:
    if meta.get("format") != FORMAT:
        raise VisionError("it is not a dictionary of placerec")
    if meta.get("version") != VERSION:
        raise VisionError(f"it has format version {meta.get('version')}, and this placerec reads {VERSION}")
    try:
        spec, training = DescriptorSpec(**meta["descriptor"]), DictionaryOptions(**meta["training"])
        quality = Quality(**meta["quality"])
        sequences = tuple(map(str, meta.get("sequences", ())))
    except (KeyError, TypeError) as error:
        raise VisionError(f"its meta is incomplete ({error})") from error
    if not all(isinstance(value, int | float) for value in asdict(quality).values()):
        raise VisionError("its meta holds a quality that is not a number")
    _check_arrays(arrays, {"d": spec.length, "k": arrays["variances"].size, "K": training.size**2})
    pca = Pca(arrays["mean"], arrays["components"], arrays["variances"], quality.explained, quality.needed)
    return Dictionary(spec, pca, arrays["codebook"], arrays["hits"], training, quality, sequences)


def _check_arrays(arrays: Arrays, lengths: dict[str, int]) -> None:
    for name, (dtype, axes) in _ARRAYS.items():
        array, shape = arrays[name], tuple(lengths[axis] for axis in axes)
        if array.dtype != dtype or array.shape != shape:
            raise VisionError(
                f"{name} is {array.dtype} {array.shape}, not {np.dtype(dtype)} {shape}, as its meta tells"
            )
        if not np.isfinite(array).all():
            raise VisionError(f"{name} holds NaN or infinite values")
    if arrays["hits"].min() < 0 or not arrays["hits"].any():
        raise VisionError("hits holds no counts of frames")
