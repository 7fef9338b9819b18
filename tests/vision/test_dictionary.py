"""The dictionary: fitting, words, the file and what is wrong with it."""

import json
import logging
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from placerec.errors import OutputError, VisionError
from placerec.frames.table import FrameTable
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionaryOptions, descriptor
from placerec.vision.chunks import CHUNK, Source
from placerec.vision.learning import Quality

SPEC = DescriptorSpec()
Content = dict[str, Any]


def sample(n: int = 300, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    places = rng.random((20, 384)) * 0.2
    return (places[rng.integers(20, size=n)] + 0.01 * rng.random((n, 384))).astype(np.float32)


def fit(descriptors: Source | None = None, spec: DescriptorSpec = SPEC, **options: Any) -> Dictionary:
    chosen = DictionaryOptions(**({"size": 5} | options))
    return Dictionary.fit(sample() if descriptors is None else descriptors, spec=spec, options=chosen)


@pytest.fixture(scope="module")
def dictionary() -> Dictionary:
    return fit()


def test_fields(dictionary: Dictionary) -> None:
    assert dictionary.codebook.shape == (25, 80)
    assert dictionary.pca.components.shape == (80, 384)
    assert dictionary.hits.sum() == dictionary.quality.frames == dictionary.quality.used == 300
    assert dictionary.dead == int((dictionary.hits == 0).sum())
    units, distances = dictionary.words(sample())
    np.testing.assert_array_equal(np.bincount(units, minlength=25), dictionary.hits)
    assert dictionary.quality.quantisation_error == pytest.approx(distances.mean(), rel=1e-5)
    assert units.dtype == np.int64
    assert distances.dtype == np.float32


def test_words_of_nothing(dictionary: Dictionary) -> None:
    units, distances = dictionary.words(np.zeros((0, 384), np.float32))
    assert units.shape == distances.shape == (0,)


def test_a_word_does_not_depend_on_the_frames_around_it(dictionary: Dictionary) -> None:
    rows = sample(40, seed=1)
    units, distances = dictionary.words(rows)
    for row, unit, distance in zip(rows, units, distances, strict=True):
        alone = dictionary.words(row[None])
        assert (alone[0][0], alone[1][0]) == (unit, distance)


def test_what_a_dictionary_remembers_changes_no_byte(dictionary: Dictionary) -> None:
    """One frame at a time from a dictionary that has answered before, all frames from one that never has."""
    rows = np.concatenate([sample(40, seed=1), dictionary.pca.mean[None].astype(np.float32)])
    dictionary.words(rows)
    fresh = replace(dictionary, pca=replace(dictionary.pca), codebook=dictionary.codebook.copy())
    units, distances = fresh.words(rows)
    singly = [dictionary.words(row[None]) for row in rows]
    assert np.concatenate([unit for unit, _ in singly]).tobytes() == units.tobytes()
    assert np.concatenate([distance for _, distance in singly]).tobytes() == distances.tobytes()
    # Nothing of it is kept where the dictionary is another one.
    dead = replace(dictionary, hits=np.where(np.arange(25) == units[0], 0, dictionary.hits))
    assert dead.words(rows[:1])[0][0] != units[0]


@pytest.mark.parametrize(("size", "first", "last"), [(1, "w0", "w0"), (3, "w0", "w8"), (10, "w00", "w99")])
def test_vocabulary_is_padded_to_the_last_index(size: int, first: str, last: str) -> None:
    words = fit(size=size).vocabulary
    assert (words[0], words[-1], len(words)) == (first, last, size * size)
    assert list(words) == sorted(words)


def test_live_units_answer_and_dead_ones_only_if_asked_for() -> None:
    live, every = fit(sample(30), size=8), fit(sample(30), size=8, units="all")
    np.testing.assert_array_equal(live.codebook, every.codebook)
    assert live.dead > 0
    elsewhere = np.random.default_rng(5).random((400, 384)).astype(np.float32) * 0.2
    assert (live.hits[live.words(elsewhere)[0]] > 0).all()
    assert (every.hits[every.words(elsewhere)[0]] == 0).any()


def test_an_image_has_the_word_of_its_descriptor(dictionary: Dictionary) -> None:
    image = np.random.default_rng(0).integers(0, 256, (60, 80)).astype(np.uint8)
    units, distances = dictionary.words(descriptor(image, SPEC)[None])
    assert dictionary.word_of(image) == (dictionary.vocabulary[units[0]], float(distances[0]))


def test_seeds(tmp_path: Path, dictionary: Dictionary) -> None:
    again, other = fit(), fit(seed=1)
    for number, one in enumerate((dictionary, again, other)):
        one.save(tmp_path / f"{number}.npz")
    files = [(tmp_path / f"{number}.npz").read_bytes() for number in range(3)]
    assert files[0] == files[1]
    assert dictionary.fingerprint == again.fingerprint
    assert dictionary.fingerprint != other.fingerprint
    assert (dictionary.codebook != other.codebook).any()
    # The seed is the map's: the PCA of all frames is the same.
    np.testing.assert_array_equal(dictionary.pca.components, other.pca.components)


def test_fraction_draws_frames_by_the_seed() -> None:
    some, again, other = (fit(fraction=0.25, seed=seed) for seed in (0, 0, 1))
    assert (some.quality.frames, some.quality.used, int(some.hits.sum())) == (300, 75, 75)
    assert some.fingerprint == again.fingerprint
    assert (some.pca.mean != other.pca.mean).any()


def test_streamed_and_mapped_descriptors_give_the_same(tmp_path: Path) -> None:
    rows = sample(CHUNK + 50)
    np.save(tmp_path / "rows.npy", rows)
    mapped = np.load(tmp_path / "rows.npy", mmap_mode="r")
    options: Content = {"size": 3, "components": 4, "epochs": 2}
    assert fit(mapped, **options).fingerprint == fit(rows, **options).fingerprint
    options["fraction"] = 0.6
    whole = fit(rows, **options)
    assert fit(lambda: iter(np.split(rows, [10, 10, 3500])), **options).fingerprint == whole.fingerprint


def test_streamed_descriptors_are_checked() -> None:
    rows = sample(20)
    rows[13, 2] = np.nan
    with pytest.raises(VisionError, match=r"descriptor 13 \(from 0\) holds NaN or infinite values; leave it out"):
        fit(lambda: iter(np.split(rows, [6, 12])))
    with pytest.raises(VisionError, match="the descriptors have 10 values, and the dictionary's have 384"):
        fit(lambda: iter([rows[:, :10]]))


BLAS = """
import numpy as np
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions
from placerec.vision.som import train_som
rng = np.random.default_rng(0)
rows = (rng.random((30, 384))[rng.integers(30, size=1500)] + 0.3 * rng.random((1500, 384))).astype(np.float32)
options = DictionarySetOptions(sizes=(12,), components=40, epochs=6)
made = DictionarySet.fit(rows, spec=DescriptorSpec(), places=[str(n % 8) for n in range(1500)], options=options)
assert made.names == ("", "pn12")
print(made.fingerprint, [far.tobytes().hex() for _, far in made.words(rows[:100] + np.float32(0.01))])
online = train_som(rows[:300, :40], 12, rng=rng, rule="online", epochs=1)
print(online.codebook.tobytes().hex())
"""


def test_the_bytes_do_not_depend_on_the_blas_and_its_threads() -> None:
    outputs = set()
    # Kernels of another processor add in another order, as more threads do; a BLAS that is not OpenBLAS ignores them.
    for threads, kernels in (("1", {}), ("2", {}), ("2", {"OPENBLAS_CORETYPE": "Haswell"})):
        environment = os.environ | {"OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads} | kernels
        run = subprocess.run([sys.executable, "-c", BLAS], env=environment, capture_output=True, text=True, check=True)
        outputs.add(run.stdout)
    assert len(outputs) == 1
    assert len(outputs.pop().splitlines()) == 2


def test_what_is_large_is_told_in_a_line(dictionary: Dictionary) -> None:
    size, dead = dictionary.training.size, dictionary.dead
    components = f"{len(dictionary.pca.components)} components of gist descriptors"
    assert repr(dictionary) == f"Dictionary({size} x {size} words, {dead} of them dead; {components}, 0 sequences)"
    frames = Descriptors(SPEC, sample(3), FrameTable.of("run", ["a", "b", "c"]))
    assert repr(frames) == "Descriptors(3 frames, 384 values of gist, 1 sequence)"


def test_descriptors_of_another_kind_are_refused(dictionary: Dictionary) -> None:
    rows = sample(3)
    mine = Descriptors(SPEC, rows, FrameTable.of("run", ["a", "b", "c"]))
    np.testing.assert_array_equal(dictionary.words(mine)[0], dictionary.words(rows)[0])
    assert dictionary.quality_of(mine) == dictionary.quality_of(rows)
    other = replace(mine, spec=DescriptorSpec("classic"))
    for work in (dictionary.words, dictionary.quality_of):
        with pytest.raises(VisionError, match=r"the descriptors are of another kind .*'classic'.* the dictionary's"):
            work(other)


def test_quality_is_measured_on_training_and_on_other_frames(dictionary: Dictionary) -> None:
    trained, quality = dictionary.quality_of(sample()), dictionary.quality
    assert (trained.frames, trained.unseen, trained.dead) == (300, 0, dictionary.dead)
    assert (trained.quantisation_error, trained.topographic_error, trained.entropy, trained.dead) == (
        quality.quantisation_error,
        quality.topographic_error,
        quality.entropy,
        quality.dead,
    )
    shares = dictionary.hits[dictionary.hits > 0] / 300
    assert quality.entropy == pytest.approx(-(shares * np.log2(shares)).sum())
    elsewhere = np.random.default_rng(5).random((400, 384)).astype(np.float32) * 0.2
    others = dictionary.quality_of(elsewhere)
    assert others.quantisation_error != trained.quantisation_error
    # The nearest of all units, dead ones among them, though `words` answers with live ones.
    units, _ = replace(dictionary, training=replace(dictionary.training, units="all")).words(elsewhere)
    assert others.unseen == pytest.approx((dictionary.hits[units] == 0).mean())


def test_what_the_data_cannot_give_is_said(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        few = fit(sample(10))
    assert few.pca.components.shape == (9, 384)
    assert "PCA keeps 9 components instead of 80" in caplog.text
    assert "10 frames cannot fill the 25 words of a map of size 5" in caplog.text


@pytest.mark.parametrize(
    ("descriptors", "options", "message"),
    [
        (sample(0), {}, "PCA needs at least 2 descriptors, and there are 0"),
        (sample(1), {}, "PCA needs at least 2 descriptors, and there are 1"),
        (sample(0), {"fraction": 0.5}, "PCA needs at least 2 descriptors, and there are 0"),
        (np.ones((20, 384), np.float32), {}, "all 20 descriptors are equal"),
        (np.ones((20, 383), np.float32), {}, "the descriptors have 383 values, and the dictionary's have 384"),
        (np.ones(384, np.float32), {}, r"descriptors are float32 \(n, 384\), and these are float32 \(384,\)"),
        (sample(), {"size": 0}, "size 0 cannot be used; give a number of 1 or more"),
        (sample(), {"components": 0}, "components 0 cannot be used; give a number of 1 or more"),
        (sample(), {"epochs": 0}, "epochs 0 cannot be used; give a number of 1 or more"),
        (sample(), {"seed": -1}, "seed -1 cannot be used; give a number of 0 or more"),
        (sample(), {"fraction": 0.0}, "fraction 0.0 cannot be used; give a number above 0 and up to 1"),
        (sample(), {"fraction": 1.5}, "fraction 1.5 cannot be used; give a number above 0 and up to 1"),
        (sample(), {"units": "some"}, "no choice of units is called 'some'; choose one of live, all"),
        (sample(), {"rule": "kohonen"}, "no rule is called 'kohonen'; choose one of batch, online"),
        (sample(), {"width": 0.0}, "width 0.0 cannot be used; give a number above 0"),
        (sample(), {"width": np.inf}, "width inf cannot be used; give a number above 0"),
    ],
)
def test_unusable_input_is_refused(descriptors: NDArray[np.float32], options: Content, message: str) -> None:
    with pytest.raises(VisionError, match=f"^{message}"):
        fit(descriptors, **options)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_row_that_is_not_finite_is_named(dictionary: Dictionary, value: float) -> None:
    rows = sample()
    rows[7, 3] = value
    for work in (fit, dictionary.words):
        with pytest.raises(VisionError, match=r"descriptor 7 \(from 0\) holds NaN or infinite values; leave it out"):
            work(rows)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "x"}, "no GIST variant is called 'x'; choose one of lmgist, classic"),
        ({"fit": "x"}, "no fit is called 'x'; choose one of squash, crop"),
        ({"image_size": 7}, "an image size of 7 cannot be used; give a number of 8 or more"),
    ],
)
def test_a_descriptor_that_does_not_exist_is_refused(options: Content, message: str) -> None:
    with pytest.raises(VisionError, match=message):
        DescriptorSpec(**options)


def test_load_gives_what_was_saved(tmp_path: Path) -> None:
    spec = DescriptorSpec("classic", 64, "crop")
    saved = fit(spec=spec, size=4, components=7, seed=3, fraction=0.5, epochs=9, units="all", width=0.3)
    # Whatever the suffix: the name is the user's.
    saved.save(tmp_path / "words.bin")
    loaded = Dictionary.load(tmp_path / "words.bin")
    assert [path.name for path in tmp_path.iterdir()] == ["words.bin"]
    assert (loaded.spec, loaded.training, loaded.quality) == (spec, saved.training, saved.quality)
    assert loaded.fingerprint == saved.fingerprint
    for mine, its in zip(loaded.words(sample(50, 1)), saved.words(sample(50, 1)), strict=True):
        np.testing.assert_array_equal(mine, its)


def test_the_file_is_arrays_and_json(tmp_path: Path, dictionary: Dictionary) -> None:
    dictionary.save(tmp_path / "words.npz")
    with np.load(tmp_path / "words.npz", allow_pickle=False) as file:
        assert {name: file[name].dtype.kind for name in file.files} == {
            "mean": "f",
            "components": "f",
            "variances": "f",
            "codebook": "f",
            "hits": "i",
            "meta": "U",
        }
        meta = json.loads(str(file["meta"]))
    assert (meta["format"], meta["version"]) == ("placerec-words", 1)
    assert meta["descriptor"] == {"kind": "gist", "variant": "lmgist", "image_size": 128, "fit": "squash"}
    assert meta["training"] == {
        "size": 5,
        "components": 80,
        "seed": 0,
        "fraction": 1.0,
        "epochs": None,
        "units": "live",
        "rule": "batch",
        "width": 0.5,
    }
    assert set(meta["quality"]) >= {"explained", "needed", "quantisation_error", "topographic_error", "entropy", "dead"}


def content_of(dictionary: Dictionary, path: Path) -> Content:
    dictionary.save(path)
    with np.load(path) as file:
        return {**{name: file[name] for name in file.files}, "meta": json.loads(str(file["meta"]))}


def without(*names: str) -> Callable[[Content], Content]:
    return lambda content: {name: value for name, value in content.items() if name not in names}


def with_meta(**values: Any) -> Callable[[Content], Content]:
    return lambda content: content | {"meta": content["meta"] | values}


def with_array(name: str, change: Callable[[NDArray[Any]], Any]) -> Callable[[Content], Content]:
    return lambda content: content | {name: change(content[name])}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("codebook"), "the array codebook is missing"),
        (without("meta"), "the array meta is missing"),
        (with_meta(format="other"), "it is not a dictionary of placerec"),
        (with_meta(version=3), "it has format version 3, and this placerec reads 1 and 2"),
        (with_meta(descriptor={"variant": "x"}), "no GIST variant is called 'x'"),
        (with_meta(training={"colour": 1}), "its meta is incomplete"),
        (with_meta(quality={}), "its meta is incomplete"),
        (
            with_meta(quality={field.name: "x" for field in fields(Quality)}),
            "its meta holds a quality that is not a number",
        ),
        (with_array("codebook", lambda a: a[:-1]), "codebook is float32 (24, 80), not float32 (25, 80)"),
        (with_array("hits", lambda a: a.astype(float)), "hits is float64 (25,), not int64 (25,)"),
        (with_array("hits", lambda a: a * 0), "hits holds no counts of frames"),
        (with_array("codebook", lambda a: a * np.nan), "codebook holds NaN or infinite values"),
        (with_array("mean", lambda a: a[:5]), "mean is float64 (5,), not float64 (384,)"),
        (with_array("components", lambda a: a[0, 0]), "components is float32 (), not float32 (80, 384)"),
        (with_array("hits", lambda a: a.astype(object)), "it cannot be read: Object arrays cannot be loaded"),
        (lambda content: content | {"meta": [1]}, "its meta is not a JSON object"),
    ],
)
def test_a_file_with_wrong_content_is_refused(
    tmp_path: Path, dictionary: Dictionary, change: Callable[[Content], Content], message: str
) -> None:
    path = tmp_path / "words.npz"
    content = change(content_of(dictionary, path))
    if "meta" in content:
        content["meta"] = np.array(json.dumps(content["meta"]))
    np.savez(path, **content)
    with pytest.raises(VisionError) as caught:
        Dictionary.load(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert str(caught.value).endswith("; make it again with `placerec train-words`")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: b"", "it is not an npz file, or it is truncated"),
        (lambda data: b"no zip at all", "it is not an npz file, or it is truncated"),
        (lambda data: data[: len(data) // 2], "it is not an npz file, or it is truncated"),
        (lambda data: data[:2000] + b"\0\1\2\3" + data[2004:], "the checksum of mean.npy is wrong"),
    ],
)
def test_a_damaged_file_is_refused(
    tmp_path: Path, dictionary: Dictionary, change: Callable[[bytes], bytes], message: str
) -> None:
    path = tmp_path / "words.npz"
    dictionary.save(path)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(VisionError) as caught:
        Dictionary.load(path)
    assert str(caught.value) == f"{path}: {message}; make it again with `placerec train-words`"


def test_no_flipped_byte_is_a_traceback(tmp_path: Path) -> None:
    path = tmp_path / "words.npz"
    small = fit(size=2, components=2)
    small.save(path)
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    # Half of them in the last bytes, where the zip keeps its directory.
    for place in [*rng.integers(len(data), size=60), *rng.integers(len(data) - 600, len(data), size=60)]:
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x41]) + data[place + 1 :])
        try:
            assert Dictionary.load(path).fingerprint == small.fingerprint
        except VisionError:
            refused += 1
    assert refused > 60


def test_a_zip_of_something_else_and_other_things_that_are_no_file(tmp_path: Path, dictionary: Dictionary) -> None:
    path = tmp_path / "other.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    for place, message in ((path, "the array mean is missing"), (tmp_path / "no.npz", "no such file")):
        with pytest.raises(VisionError, match=message):
            Dictionary.load(place)
    with pytest.raises(VisionError, match=r"it is a folder; name the words\.npz of train-words or learn$"):
        Dictionary.load(tmp_path)
    with pytest.raises(OutputError):
        dictionary.save(path / "words.npz")


def test_the_fingerprint_is_of_all_that_decides_words(dictionary: Dictionary) -> None:
    moved = dictionary.codebook.copy()
    moved[0, 0] += 1
    others = [
        replace(dictionary, codebook=moved),
        replace(dictionary, spec=DescriptorSpec("classic")),
        replace(dictionary, training=replace(dictionary.training, units="all")),
        replace(dictionary, pca=replace(dictionary.pca, mean=dictionary.pca.mean + 1)),
    ]
    assert len({one.fingerprint for one in [dictionary, *others]}) == 5
    assert len(dictionary.fingerprint) == 64
    told = replace(dictionary, quality=replace(dictionary.quality, entropy=0.0))
    assert told.fingerprint == dictionary.fingerprint
