"""Describing sequences: every readable frame, in order; what cannot be read is said and skipped."""

import json
import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from placerec.errors import VisionError
from placerec.frames import Frame, Sequence, find_sequences
from placerec.jobs import workers
from placerec.vision import (
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    describe,
    describe_sources,
    fit_image,
    gist,
    save_descriptors,
    train_dictionary,
)


def sequence(folder: Path, name: str, count: int, seed: int = 0) -> Sequence:
    """Real PNG files of noise, 1 s apart, the first half in a kitchen."""
    rng = np.random.default_rng(seed)
    frames = []
    (folder / name).mkdir()
    for index in range(count):
        path = folder / name / f"{index:03d}.png"
        cv2.imwrite(str(path), rng.integers(0, 256, (40, 60), dtype=np.uint8))
        frames.append(Frame(path.name, float(index), "kitchen" if index < count // 2 else "", path))
    return Sequence(name, tuple(frames), folder / name)


def test_every_frame_in_order(tmp_path: Path) -> None:
    sequences = [sequence(tmp_path, "b", 3, seed=1), sequence(tmp_path, "a", 2, seed=2)]
    spec = DescriptorSpec("classic", 32, "crop")
    told: list[tuple[int, int]] = []
    described = describe(sequences, spec, progress=lambda done, total: told.append((done, total)))
    assert told == [(3, 5), (5, 5)]
    assert described.sequences == ("b", "b", "b", "a", "a")
    assert described.frames == ("000.png", "001.png", "002.png", "000.png", "001.png")
    assert described.places == ("kitchen", "", "", "kitchen", "")
    assert described.times.tolist() == [0, 1, 2, 0, 1]
    assert (described.skipped, described.constant, described.spec) == (0, 0, spec)
    assert described.values.dtype == np.float32
    image = cv2.imread(str(tmp_path / "a/001.png"), cv2.IMREAD_GRAYSCALE)
    want = gist(fit_image(np.asarray(image, np.uint8), 32, "crop"), variant="classic")
    np.testing.assert_array_equal(described.values[4], want)
    rows = described.table.by_sequence()
    assert {name: list(mine) for name, mine in rows.items()} == {"b": [0, 1, 2], "a": [3, 4]}
    assert list(rows) == ["b", "a"]


def test_broken_images_are_skipped_and_constant_ones_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    one = sequence(tmp_path, "run", 5)
    one.frames[1].path.write_bytes(b"not an image")
    one.frames[2].path.unlink()
    cv2.imwrite(str(one.frames[3].path), np.full((40, 60), 90, np.uint8))
    with caplog.at_level(logging.WARNING):
        described = describe([one])
    assert described.frames == ("000.png", "003.png", "004.png")
    assert (described.skipped, described.constant) == (2, 1)
    np.testing.assert_array_equal(described.values.any(axis=1), [True, False, True])
    warnings = [record.message for record in caplog.records]
    assert len(warnings) == 3
    for frame, warning in zip(one.frames[1:3], warnings, strict=False):
        assert warning.startswith(str(frame.path))
        assert warning.endswith("; the frame is skipped")
    assert warnings[2] == f"{one.frames[3].path}: of one grey level throughout; its descriptor is zero"


def test_any_number_of_workers_gives_the_same(tmp_path: Path) -> None:
    one = sequence(tmp_path, "run", 330)
    one.frames[5].path.write_bytes(b"not an image")
    spec = DescriptorSpec(image_size=64)
    described = [describe([one], spec, work=workers(jobs)) for jobs in (None, 1, 2)]
    for other in described[1:]:
        assert other.values.tobytes() == described[0].values.tobytes()
        assert other.frames == described[0].frames


def test_images_are_read_as_they_are_wanted(tmp_path: Path) -> None:
    one = sequence(tmp_path, "run", 150)
    seen: list[int] = []

    def stop(done: int, total: int) -> None:
        seen.append(done)
        one.frames[-1].path.unlink(missing_ok=True)

    described = describe([one], DescriptorSpec(image_size=32), work=workers(1), progress=stop)
    assert seen == [64, 128, 150]
    assert described.skipped == 1


def test_nothing_readable_is_an_error(tmp_path: Path) -> None:
    one = sequence(tmp_path, "run", 2)
    for frame in one.frames:
        frame.path.write_bytes(b"")
    with pytest.raises(VisionError, match="none of the 2 images can be read; name a folder with images"):
        describe([one])
    with pytest.raises(VisionError, match="none of the 0 images can be read"):
        describe([])


def test_the_descriptors_file(tmp_path: Path) -> None:
    described = describe([sequence(tmp_path, "run", 4)])
    save_descriptors(described, tmp_path / "descriptors.npz")
    with np.load(tmp_path / "descriptors.npz", allow_pickle=False) as file:
        np.testing.assert_array_equal(file["descriptors"], described.values)
        assert file["frames"].tolist() == list(described.frames)
        assert file["sequences"].tolist() == ["run"] * 4
        assert file["places"].tolist() == ["kitchen", "kitchen", "", ""]
        assert file["times"].tolist() == [0, 1, 2, 3]
        meta = json.loads(str(file["meta"]))
    assert meta["descriptor"] == {"kind": "gist", "variant": "lmgist", "image_size": 128, "fit": "squash"}
    assert (meta["skipped"], meta["constant"]) == (0, 0)


def test_sources_to_files(tmp_path: Path) -> None:
    sequence(tmp_path, "run", 12)
    describe_sources([tmp_path / "run"], tmp_path / "d.npz", spec=DescriptorSpec(image_size=32))
    with np.load(tmp_path / "d.npz") as file:
        assert file["descriptors"].shape == (12, 384)
        told: list[int] = []
        made = train_dictionary(
            [tmp_path / "run"],
            tmp_path / "w.npz",
            spec=DescriptorSpec(image_size=32),
            options=DictionaryOptions(size=2, components=5, seed=4),
            progress=lambda done, total: told.append(done),
        )
        fitted = Dictionary.fit(
            file["descriptors"],
            spec=DescriptorSpec(image_size=32),
            options=DictionaryOptions(size=2, components=5, seed=4),
        )
    assert told == [12]
    assert Dictionary.load(tmp_path / "w.npz").fingerprint == made.fingerprint == fitted.fingerprint


def test_the_second_lap_of_a_real_corridor_is_told_by_the_words_of_the_first(shared: Path) -> None:
    described = describe(find_sequences([shared / "data/rtabmap_corridor"]), DescriptorSpec(image_size=64))
    assert (len(described.values), described.skipped, described.constant) == (84, 0, 0)
    rows, places = described.table.by_sequence(), np.array(described.places)
    first, second = described.values[rows["lap1"]], described.values[rows["lap2"]]
    seen, asked = places[rows["lap1"]], places[rows["lap2"]]
    dictionary = Dictionary.fit(first, spec=described.spec, options=DictionaryOptions(size=5))
    names = np.unique(seen)
    votes = np.equal.outer(np.arange(25), dictionary.words(first)[0]).astype(int) @ np.equal.outer(seen, names)
    told = names[votes.argmax(axis=1)][dictionary.words(second)[0]]
    # The most frequent of the four legs is a third of the lap.
    assert (told == asked).mean() > 0.6
