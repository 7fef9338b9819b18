"""The file of `placerec describe` in place of images: the words and token streams that the images give."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import SMALL, done, fails

from placerec.errors import PlacerecError, SourceError, VisionError
from placerec.frames import SourceOptions, find_sequences
from placerec.vision import (
    DescriptorSpec,
    DictionarySetOptions,
    describe,
    describe_sources,
    train_dictionary,
)
from placerec.vision.stored import read_descriptors
from placerec.words.tokenize import tokenize

SPEC = DescriptorSpec(image_size=16)
OPTIONS = DictionarySetOptions(views=("plain", "pn"), sizes=(2, 3))


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sequences, described together and each alone; an image of the first cannot be read."""
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / "runs" / name, seed)
    (sorted((root / "runs/seq1").rglob("*.png"))[5]).write_bytes(b"")
    describe_sources([root / "runs"], root / "all.npz", spec=SPEC)
    for name in ("seq1", "seq2"):
        describe_sources([root / "runs" / name], root / f"{name}.npz", spec=SPEC)
    return root


@pytest.mark.parametrize("names", [["all.npz"], ["seq1.npz", "seq2.npz"]])
def test_what_is_read_is_what_was_described(world: Path, names: list[str]) -> None:
    found = read_descriptors([world / name for name in names])
    plain = describe(find_sequences([world / "runs"]), SPEC)
    for _ in range(2):
        np.testing.assert_array_equal(np.concatenate(list(found.values.pieces())), plain.values)
    assert found.table == plain.table
    assert (found.spec, found.skipped, found.constant) == (SPEC, 1, 0)


@pytest.mark.parametrize("names", [["all.npz"], ["seq1.npz", "seq2.npz"]])
def test_words_and_tokens_are_those_of_the_images(world: Path, tmp_path: Path, names: list[str]) -> None:
    for out, sources in (("images", [world / "runs"]), ("stored", [world / name for name in names])):
        train_dictionary(sources, tmp_path / f"{out}.npz", spec=SPEC, options=OPTIONS, held_out=sources, matrix=None)
        tokenize(sources, tmp_path / f"{out}.npz", tmp_path / out)
    assert (tmp_path / "stored.npz").read_bytes() == (tmp_path / "images.npz").read_bytes()
    files = {path.name: path.read_bytes() for path in (tmp_path / "images").iterdir()}
    assert {path.name: path.read_bytes() for path in (tmp_path / "stored").iterdir()} == files
    assert {"seq1.tsv", "seq2.tsv"} < set(files)


def test_the_kind_of_descriptor_is_the_files(world: Path, tmp_path: Path) -> None:
    made = train_dictionary([world / "all.npz"], tmp_path / "words.npz", options=OPTIONS)
    assert made.spec == SPEC
    wanted = "holds descriptors kind=gist variant=lmgist image_size=16 fit=squash, and descriptors kind=centrist"
    with pytest.raises(VisionError, match=rf"all\.npz: {wanted} image_size=128 fit=squash are wanted; describe the"):
        train_dictionary([world / "all.npz"], tmp_path / "no.npz", spec=DescriptorSpec(kind="centrist"))
    describe_sources([world / "runs"], tmp_path / "large.npz", spec=DescriptorSpec(image_size=24))
    with pytest.raises(VisionError, match=r"large\.npz: holds .* image_size=24 .* image_size=16 fit=squash are wanted"):
        tokenize([tmp_path / "large.npz"], tmp_path / "words.npz", tmp_path / "tokens")
    assert not (tmp_path / "tokens").exists()


def test_commands_take_it(world: Path, tmp_path: Path) -> None:
    done("train-words", world / "all.npz", "-o", tmp_path / "words.npz", "--as-in-paper", "--size", 3)
    done("train-words", world / "runs", "-o", tmp_path / "plain.npz", *SMALL)
    assert (tmp_path / "words.npz").read_bytes() == (tmp_path / "plain.npz").read_bytes()
    done("tokenize", world / "all.npz", "-w", tmp_path / "words.npz", "-o", tmp_path / "tokens")
    done("tokenize", world / "runs", "-w", tmp_path / "words.npz", "-o", tmp_path / "plain")
    assert (tmp_path / "tokens/seq2.tsv").read_bytes() == (tmp_path / "plain/seq2.tsv").read_bytes()
    options = ("train-words", world / "all.npz", "-o", tmp_path / "no.npz", "--image-size")
    fails(r"all\.npz: holds descriptors .* image_size=16 .* image_size=128 fit=squash are wanted", *options, 128)
    done(*options, 16, "--as-in-paper", "--size", 2)


def test_what_does_not_go_with_it(world: Path, tmp_path: Path) -> None:
    stored, out = world / "all.npz", tmp_path / "words.npz"
    for sources, options, message in (
        ([stored, world / "runs"], {}, "holds descriptors, which do not go with images; describe all, or give all"),
        (
            [stored],
            {"source_options": SourceOptions(every=2)},
            "holds descriptors, of which --every, --labels and the like say nothing",
        ),
        ([stored], {"matrix": tmp_path / "m.npy"}, r"holds descriptors, and so does .*m\.npy; name one of them"),
    ):
        with pytest.raises(SourceError, match=rf"all\.npz: {message}"):
            train_dictionary(sources, out, **options)
    with pytest.raises(VisionError, match=r"seq1\.npz: the sequence 'seq1' is in .*all\.npz, too; leave one"):
        train_dictionary([stored, world / "seq1.npz"], out)
    assert not out.exists()


Arrays = dict[str, Any]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda it: it | {"descriptors": it["descriptors"][1:]},
            r"holds descriptors <f4 \(22, 384\), and <f4 \(23, 384",
        ),
        (lambda it: it | {"descriptors": it["descriptors"][:, 1:]}, r"holds descriptors <f4 \(23, 383\)"),
        (lambda it: it | {"descriptors": it["descriptors"].astype(float)}, "holds descriptors <f8"),
        (lambda it: it | {"descriptors": np.asfortranarray(it["descriptors"])}, "is not stored row by row"),
        (lambda it: it | {"frames": it["frames"][1:]}, "frames, sequences and places are not texts of 23 frames"),
        (lambda it: it | {"places": np.zeros(23)}, "frames, sequences and places are not texts of 23 frames"),
        (lambda it: {name: it[name] for name in it if name != "frames"}, "the array frames is missing"),
        (lambda it: {name: it[name] for name in it if name != "meta"}, "the array meta is missing"),
        (lambda it: it | {"meta": np.array("{}")}, "its meta is not that of `placerec describe`"),
        (lambda it: it | {"meta": np.array(json.dumps({"format": "words"}))}, "is a file of words, and descriptors of"),
    ],
)
def test_other_files_are_refused(world: Path, tmp_path: Path, change: Callable[[Arrays], Arrays], message: str) -> None:
    with np.load(world / "all.npz") as file:
        arrays = {name: file[name] for name in file.files}
    path = tmp_path / "bad.npz"
    np.savez(path, **change(arrays))
    with pytest.raises(VisionError, match=rf"^{re.escape(str(path))}: .*{message}"):
        read_descriptors([path])


@pytest.mark.parametrize("damage", ["cut", "changed", "no archive", "missing", "folder"])
def test_damaged_files_are_refused(world: Path, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "bad.npz"
    data = bytearray((world / "all.npz").read_bytes())
    if damage == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "changed":
        data[4000] ^= 1
        path.write_bytes(data)
    elif damage == "no archive":
        path.write_text("descriptors")
    elif damage == "folder":
        path.mkdir()
    with pytest.raises(PlacerecError, match=rf"^{re.escape(str(path))}: "):
        train_dictionary([path], tmp_path / "words.npz")
    assert not (tmp_path / "words.npz").exists()
