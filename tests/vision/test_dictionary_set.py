"""Several dictionaries in one file: what they are called, what they share, and that one alone is what it was."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision import (
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySet,
    DictionarySetOptions,
)

SPEC = DescriptorSpec()
SIZES = (3, 5)
Content = dict[str, Any]


def sample(n: int = 300, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    places = rng.random((20, 384)) * 0.2
    return (places[rng.integers(20, size=n)] + 0.01 * rng.random((n, 384))).astype(np.float32)


def fit(**options: Any) -> DictionarySet:
    chosen = DictionarySetOptions(**({"views": ("plain",), "sizes": SIZES} | options))
    return DictionarySet.fit(sample(), spec=SPEC, options=chosen)


@pytest.fixture(scope="module")
def several() -> DictionarySet:
    return fit()


def test_every_plain_map_is_the_one_that_is_learned_alone(several: DictionarySet) -> None:
    assert several.names == ("", "plain5")
    choices: list[Content] = [{}, {"fraction": 0.5, "seed": 3, "epochs": 4}]
    for options in choices:
        for one, size in zip(fit(**options).dictionaries, SIZES, strict=True):
            alone = Dictionary.fit(sample(), spec=SPEC, options=DictionaryOptions(size=size, **options))
            assert (one.fingerprint, one.quality, one.training) == (alone.fingerprint, alone.quality, alone.training)


def test_words_tell_their_dictionary(several: DictionarySet) -> None:
    first, other = several.dictionaries
    assert (first.vocabulary[0], first.vocabulary[-1]) == ("w0", "w8")
    assert (other.vocabulary[0], other.vocabulary[-1]) == ("plain5.w00", "plain5.w24")


def test_the_words_are_those_of_each_dictionary(several: DictionarySet) -> None:
    rows = sample(40, 1)
    for one, (units, distances) in zip(several.dictionaries, several.words(rows), strict=True):
        np.testing.assert_array_equal(units, one.words(rows)[0])
        np.testing.assert_array_equal(distances, one.words(rows)[1])
    image = np.random.default_rng(0).integers(0, 256, (60, 80)).astype(np.uint8)
    assert tuple(zip(*several.words_of(image), strict=True)) == tuple(
        one.word_of(image) for one in several.dictionaries
    )
    measured = several.quality_of(rows)
    assert measured == tuple(one.quality_of(rows) for one in several.dictionaries)


def test_a_set_of_one_is_its_dictionary(tmp_path: Path, several: DictionarySet) -> None:
    alone = replace(several.dictionaries[0], sequences=("run1",))
    one = DictionarySet.of(alone)
    assert DictionarySet.of(one) is one
    assert (one.names, one.fingerprint, one.spec, one.sequences) == (("",), alone.fingerprint, SPEC, ("run1",))
    alone.save(tmp_path / "alone.npz")
    one.save(tmp_path / "one.npz")
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "alone.npz").read_bytes()
    assert DictionarySet.load(tmp_path / "alone.npz").fingerprint == alone.fingerprint
    # A name is the set's, no part of the file.
    named = several.dictionaries[1]
    assert DictionarySet.of(named).names == ("",)
    named.save(tmp_path / "named.npz")
    assert Dictionary.load(tmp_path / "named.npz").vocabulary[0] == "w00"


def test_version_0_1_learned_the_same_words() -> None:
    """The fingerprint that version 0.1 gave to these very rows, learned with these options."""
    rng = np.random.default_rng(0)
    rows = (rng.random((30, 384))[rng.integers(30, size=200)] + 0.3 * rng.random((200, 384))).astype(np.float32)
    options: Content = {"components": 20, "seed": 5, "fraction": 0.9, "epochs": 6}
    first = DictionarySet.fit(
        rows, spec=SPEC, options=DictionarySetOptions(views=("plain",), sizes=(4, 5), **options)
    ).dictionaries[0]
    assert first.fingerprint == "8f20290dfa259eb291d59ce5986ca4258f5239993d58a68db152a1daad08c2af"


def test_load_gives_what_was_saved(tmp_path: Path, several: DictionarySet) -> None:
    saved = DictionarySet(tuple(replace(one, sequences=("a", "b")) for one in several.dictionaries))
    saved.save(tmp_path / "words.npz")
    loaded = DictionarySet.load(tmp_path / "words.npz")
    assert (loaded.names, loaded.spec, loaded.sequences) == (saved.names, SPEC, ("a", "b"))
    assert loaded.fingerprint == saved.fingerprint
    assert loaded.dictionaries[0].pca is loaded.dictionaries[1].pca
    for mine, its in zip(loaded.dictionaries, saved.dictionaries, strict=True):
        assert (mine.training, mine.quality) == (its.training, its.quality)
    loaded.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "words.npz").read_bytes()


def test_the_file_holds_what_is_shared_once(tmp_path: Path, several: DictionarySet) -> None:
    several.save(tmp_path / "words.npz")
    with np.load(tmp_path / "words.npz", allow_pickle=False) as file:
        names = file.files
        meta = json.loads(str(file["meta"]))
    assert names == ["mean", "components", "variances", "codebook", "hits", "codebook.plain5", "hits.plain5", "meta"]
    assert (meta["format"], meta["version"]) == ("placerec-words", 2)
    assert [one["name"] for one in meta["dictionaries"]] == ["", "plain5"]


def test_a_reader_of_one_dictionary_says_how_many_there_are(tmp_path: Path, several: DictionarySet) -> None:
    several.save(tmp_path / "words.npz")
    with pytest.raises(VisionError) as caught:
        Dictionary.load(tmp_path / "words.npz")
    message = "holds 2 dictionaries; read it with DictionarySet.load"
    assert str(caught.value) == f"{tmp_path / 'words.npz'}: {message}"


def test_the_fingerprint_is_of_every_dictionary_and_its_name(several: DictionarySet) -> None:
    first, other = several.dictionaries
    sets = [
        several,
        DictionarySet((first,)),
        DictionarySet((first, replace(other, name="plain6"))),
        DictionarySet((first, replace(other, codebook=other.codebook + 1))),
        DictionarySet((first, other, replace(other, name="plain6"))),
    ]
    assert len({one.fingerprint for one in sets}) == 5
    assert len(several.fingerprint) == 64


def test_what_is_no_set_is_refused(several: DictionarySet) -> None:
    first, other = several.dictionaries
    classic = replace(other, spec=DescriptorSpec("classic"))
    cases: list[tuple[tuple[Dictionary, ...], str]] = [
        ((), "the first dictionary of a set has no name"),
        ((other, other), "the first dictionary of a set has no name"),
        ((first, first), "a dictionary cannot be called ''; small letters and a number are a name"),
        ((first, replace(other, name="../x1")), "a dictionary cannot be called '../x1'"),
        ((first, other, other), "two dictionaries are called plain5"),
        ((first, classic), "gist descriptors are no part of gist descriptors with these settings"),
    ]
    for dictionaries, message in cases:
        with pytest.raises(VisionError, match=f"^{message}"):
            DictionarySet(dictionaries)


def with_member(number: int, **values: Any) -> Callable[[Content], Content]:
    def changed(content: Content) -> Content:
        content["meta"]["dictionaries"][number] |= values
        return content

    return changed


def without(name: str) -> Callable[[Content], Content]:
    return lambda content: {other: value for other, value in content.items() if other != name}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("codebook.plain5"), "the array codebook.plain5 is missing"),
        (without("hits"), "the array hits is missing"),
        (with_member(1, projection="pn"), "the array mean.pn is missing"),
        (with_member(1, name="plain6"), "the array codebook.plain6 is missing"),
        (with_member(1, name="../../x"), "a dictionary cannot be called '../../x'"),
        (with_member(0, name="plain3"), "the first dictionary of a set has no name"),
        (with_member(1, training={"size": 4}), "codebook.plain5 is float32 (25, 80), not float32 (16, 80)"),
        (with_member(1, training=None), "its meta is incomplete"),
        (with_member(1, quality={}), "its meta is incomplete"),
        (
            lambda content: content | {"hits.plain5": content["hits.plain5"] * 0},
            "hits.plain5 holds no counts of frames",
        ),
        (lambda content: content | {"meta": content["meta"] | {"dictionaries": []}}, "the first dictionary of a set"),
        (lambda content: content | {"meta": content["meta"] | {"dictionaries": 3}}, "its meta is incomplete"),
    ],
)
def test_a_file_with_wrong_content_is_refused(
    tmp_path: Path, several: DictionarySet, change: Callable[[Content], Content], message: str
) -> None:
    path = tmp_path / "words.npz"
    several.save(path)
    with np.load(path) as file:
        content = {**{name: file[name] for name in file.files}, "meta": json.loads(str(file["meta"]))}
    content = change(content)
    content["meta"] = np.array(json.dumps(content["meta"]))
    np.savez(path, **content)
    with pytest.raises(VisionError) as caught:
        DictionarySet.load(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert str(caught.value).endswith("; make it again with `placerec train-words`")


def test_no_flipped_byte_is_a_traceback(tmp_path: Path) -> None:
    path = tmp_path / "words.npz"
    small = fit(sizes=(2, 3), components=2)
    small.save(path)
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    # Half of them in the last bytes, where the zip keeps its directory.
    for place in [*rng.integers(len(data), size=40), *rng.integers(len(data) - 900, len(data), size=40)]:
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x41]) + data[place + 1 :])
        try:
            assert DictionarySet.load(path).fingerprint == small.fingerprint
        except VisionError:
            refused += 1
    assert refused > 40


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sizes": ()}, "no sizes are given; name at least one"),
        ({"sizes": (3, 3)}, "sizes 3,3 name one twice; leave it out"),
        ({"sizes": (3, 0)}, "size 0 cannot be used; give a number of 1 or more"),
        ({"views": ("plain", "x")}, "no view is called 'x'; choose some of plain"),
        ({"seed": -1}, "seed -1 cannot be used; give a number of 0 or more"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(VisionError, match=f"^{message}"):
        DictionarySetOptions(**options)
