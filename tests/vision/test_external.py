"""Descriptors computed elsewhere: rows go to frames by order or by name, and no other file is taken for a matrix."""

import logging
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import write_images
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.frames import Sequence, find_sequences
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe, describe_sources, train_dictionary
from placerec.vision.external import read_rows

FRAMES = [("b", "1.png"), ("b", "2.png"), ("a", "1.png")]
ROWS = np.arange(12, dtype=np.float32).reshape(3, 4)


def refused(message: str, path: Path, frames: list[tuple[str, str]] = FRAMES) -> None:
    with pytest.raises(VisionError) as caught:
        read_rows(path, frames)
    assert str(caught.value).startswith(f"{path}: ")
    assert re.search(message, str(caught.value)), str(caught.value)


def named(path: Path, names: list[tuple[str, str]], rows: NDArray[Any]) -> Path:
    np.savez(path, descriptors=rows, sequences=[name[0] for name in names], frames=[name[1] for name in names])
    return path


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", ">f4", "i1", "u2", "i8"])
def test_rows_by_order_whatever_their_type(tmp_path: Path, dtype: str) -> None:
    np.save(tmp_path / "m.npy", ROWS.astype(dtype))
    np.savez(tmp_path / "m.npz", descriptors=np.asfortranarray(ROWS.astype(dtype)))
    for name in ("m.npy", "m.npz"):
        values, kept = read_rows(tmp_path / name, FRAMES)
        assert values.dtype == np.float32
        assert kept == [0, 1, 2]
        np.testing.assert_array_equal(values, ROWS)


def test_a_large_matrix_stays_on_disk(tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", ROWS)
    assert isinstance(read_rows(tmp_path / "m.npy", FRAMES)[0], np.memmap)


@given(order=st.permutations(range(5)), wanted=st.permutations(range(5)))
def test_rows_by_name_whatever_the_order(
    tmp_path_factory: pytest.TempPathFactory, order: list[int], wanted: list[int]
) -> None:
    names = [*FRAMES, ("a", "2.png"), ("c", "1.png")]
    rows = np.arange(10.0).reshape(5, 2)
    path = named(tmp_path_factory.getbasetemp() / "named.npz", [names[k] for k in order], rows[order])
    values, kept = read_rows(path, [names[k] for k in wanted[:3]])
    np.testing.assert_array_equal(values, rows[wanted[:3]])
    assert kept == [0, 1, 2]


def test_frames_without_a_row_are_left_out_and_sequences_without_rows_refused(tmp_path: Path) -> None:
    path = named(tmp_path / "m.npz", [FRAMES[2], FRAMES[1]], ROWS[:2])
    values, kept = read_rows(path, FRAMES)
    assert kept == [1, 2]
    np.testing.assert_array_equal(values, ROWS[[1, 0]])
    refused("has no rows for the sequence 'b'; it names a", named(path, FRAMES[2:], ROWS[:1]))


def test_a_wrong_number_of_rows_is_told_with_both(tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", ROWS)
    refused("has 3 rows, and the sources have 2 frames; give each frame one", tmp_path / "m.npy", FRAMES[:2])
    np.savez(tmp_path / "m.npz", descriptors=ROWS[:2])
    refused("has 2 rows, and the sources have 3 frames", tmp_path / "m.npz")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_rows_that_are_no_numbers_are_named(tmp_path: Path, bad: float) -> None:
    rows = ROWS.astype(float)
    rows[1, 2] = bad
    np.save(tmp_path / "m.npy", rows)
    refused(r"row 1 \(from 0\), of b/2.png, holds NaN or infinite values", tmp_path / "m.npy")
    # The row of the file, not that of the sources.
    named(tmp_path / "m.npz", FRAMES[::-1], rows)
    refused(r"row 1 \(from 0\), of b/2.png", tmp_path / "m.npz", FRAMES[1:])


def test_a_bad_row_far_down_is_found(tmp_path: Path) -> None:
    rows = np.zeros((9000, 1), np.float32)
    rows[8765] = np.nan
    np.save(tmp_path / "m.npy", rows)
    refused(r"row 8765 \(from 0\), of s/8765,", tmp_path / "m.npy", [("s", str(k)) for k in range(9000)])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (np.zeros(3), r"holds float64 \(3,\); a matrix of numbers is wanted, one row a frame"),
        (np.zeros((3, 2, 2)), r"holds float64 \(3, 2, 2\)"),
        (np.zeros((3, 0)), r"holds float64 \(3, 0\)|cannot be read"),
        (np.zeros((3, 2), complex), r"holds complex128 \(3, 2\)"),
        (np.zeros((3, 2), bool), r"holds bool \(3, 2\)"),
        (np.array([["a"] * 2] * 3), r"holds <U1 \(3, 2\)"),
        (np.array([[{}] * 2] * 3), "it cannot be read: .*[Oo]bject"),
        (np.zeros((3, 4097), np.float16), "has rows of 4097 values; reduce them to 4096 or fewer"),
    ],
    ids=lambda value: str(getattr(value, "dtype", "")),
)
def test_what_is_no_matrix_is_refused(tmp_path: Path, rows: NDArray[Any], message: str) -> None:
    np.save(tmp_path / "m.npy", rows, allow_pickle=True)
    refused(message, tmp_path / "m.npy")
    np.savez(tmp_path / "m.npz", descriptors=rows)
    refused(message, tmp_path / "m.npz")


def test_files_that_are_none(tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", ROWS)
    whole = (tmp_path / "m.npy").read_bytes()
    for data, message in (
        (b"", "it is not a .npy or .npz file"),
        (b"0.1 0.2\n", "it is not a .npy or .npz file"),
        (whole[:40], "it cannot be read: "),
        (whole[:-1], "it cannot be read: "),
        (b"PK\3\4 no more", "it is not an npz file, or it is truncated"),
    ):
        (tmp_path / "x").write_bytes(data)
        refused(message, tmp_path / "x")
    refused("no such file", tmp_path / "none.npy")
    refused("it is a folder", tmp_path)
    with zipfile.ZipFile(tmp_path / "x", "w") as archive:
        archive.writestr("readme.txt", "hello")
    refused("the array descriptors is missing", tmp_path / "x")


def test_names_that_name_nothing_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    refused("has two rows for b/1.png", named(path, [FRAMES[0], FRAMES[0], FRAMES[1]], ROWS))
    np.savez(path, descriptors=ROWS, frames=["1", "2", "3"])
    refused("names rows by frames alone; give both sequences and frames, or neither", path)
    for frames in (["1", "2"], [1, 2, 3], [["1"], ["2"], ["3"]]):
        np.savez(path, descriptors=ROWS, frames=frames, sequences=["a"] * 3)
        refused(r"its names are .*, and \(3,\) texts are wanted", path)


# Through the whole room


@pytest.fixture
def runs(tmp_path: Path) -> list[Sequence]:
    """Two sequences of 12 images, one of which is broken: no image is read."""
    for seed, name in enumerate(("run1", "run2")):
        write_images(tmp_path / "runs" / name, seed)
    sequences = find_sequences([tmp_path / "runs"])
    sequences[0].frames[3].path.write_bytes(b"broken")
    return sequences


def features(n: int = 24, d: int = 5) -> NDArray[np.float32]:
    return np.random.default_rng(0).normal(size=(n, d)).astype(np.float32)


def test_described_frames_have_their_rows(runs: list[Sequence], tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", features())
    described = describe(runs, matrix=tmp_path / "m.npy")
    np.testing.assert_array_equal(described.values, features())
    assert described.spec == DescriptorSpec(kind="npy", columns=5)
    assert described.frames == tuple(frame.name for sequence in runs for frame in sequence.frames)
    assert described.sequences == ("run1",) * 12 + ("run2",) * 12
    assert described.places[:7] == ("hall",) * 6 + ("kitchen",)
    assert (described.skipped, described.constant) == (0, 0)


def test_a_matrix_of_other_rows_is_refused_and_images_too(runs: list[Sequence], tmp_path: Path) -> None:
    path = tmp_path / "m.npy"
    np.save(path, features())
    for spec, message in (
        (DescriptorSpec(kind="npy", columns=7), "has rows of 5 values, and the dictionary's have 7"),
        (DescriptorSpec(), "is not wanted, for the dictionary is of gist descriptors; leave it out"),
    ):
        with pytest.raises(VisionError, match=f"{re.escape(str(path))}: {message}"):
            describe(runs, spec, matrix=path)
    with pytest.raises(VisionError, match="images cannot be described so here; tokenize with --descriptor npy:FILE"):
        describe(runs, DescriptorSpec(kind="npy", columns=5))


def test_described_once_named_for_good(runs: list[Sequence], tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """`describe` puts the names to the rows; then any of the sequences can be taken from the one file."""
    np.save(tmp_path / "m.npy", features())
    describe_sources([tmp_path / "runs"], tmp_path / "m.npz", matrix=tmp_path / "m.npy")
    second = describe(runs[1:], matrix=tmp_path / "m.npz")
    np.testing.assert_array_equal(second.values, features()[12:])
    # What `describe` makes of images lacks the broken one, and lacks it again.
    describe_sources([tmp_path / "runs"], tmp_path / "gist.npz", spec=DescriptorSpec(image_size=16))
    caplog.clear()
    with caplog.at_level(logging.INFO):
        again = describe(runs, matrix=tmp_path / "gist.npz")
    assert (again.spec.columns, again.skipped, len(again.frames)) == (384, 1, 23)
    broken = runs[0].frames[3]
    assert caplog.messages[0] == f"{tmp_path / 'gist.npz'}: has no row for {broken.path}; the frame is skipped"
    assert broken.name not in again.frames[:12]


def test_a_matrix_without_any_row_of_these_frames(runs: list[Sequence], tmp_path: Path) -> None:
    path = named(tmp_path / "m.npz", [("run1", "other.png"), ("run2", "other.png")], features(2))
    with pytest.raises(VisionError, match="has a row for none of the 24 frames; name the matrix of these sources"):
        describe(runs, matrix=path)


def test_a_dictionary_of_a_matrix(runs: list[Sequence], tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", features())
    made = train_dictionary(
        [tmp_path / "runs"],
        tmp_path / "w.npz",
        options=DictionaryOptions(size=2, components=3),
        matrix=tmp_path / "m.npy",
    )
    loaded = Dictionary.load(tmp_path / "w.npz")
    assert loaded.spec == DescriptorSpec(kind="npy", columns=5)
    np.testing.assert_array_equal(loaded.words(features())[0], made.dictionaries[0].words(features())[0])
    assert str(tmp_path).encode() not in (tmp_path / "w.npz").read_bytes()
    with pytest.raises(VisionError, match="the descriptors have 6 values, and the dictionary's have 5"):
        loaded.words(features(d=6))
    with pytest.raises(VisionError, match="were computed elsewhere"):
        loaded.word_of(np.zeros((20, 20), np.uint8))
