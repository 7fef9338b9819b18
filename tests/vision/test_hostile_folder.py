"""Folders that hold what is no image, or change while they are read: each bad frame is named, none ends the run."""

import logging
import os
import shutil
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers.image_files import chunk
from helpers.small_world import write_images

from placerec.errors import VisionError
from placerec.frames import find_sequences
from placerec.jobs import workers
from placerec.vision import DescriptorSpec, describe, describe_sources

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no such files there")
SPEC = DescriptorSpec(image_size=16)


def bomb(side: int) -> bytes:
    """A PNG of side x side black pixels in some kilobytes."""
    row = zlib.compressobj(9)
    data = b"".join(row.compress(bytes(1 + side)) for _ in range(side)) + row.flush()
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def locked(path: Path) -> None:
    path.write_bytes(b"secret")
    path.chmod(0)


HOSTILE: dict[str, tuple[Callable[[Path], object], str]] = {
    "pipe.png": (os.mkfifo, "is no regular file; remove it"),
    "empty.png": (Path.touch, "is empty; copy it again or remove it"),
    "zeros.png": (lambda path: path.write_bytes(bytes(5000)), "is no image that OpenCV can decode"),
    "text.jpg": (lambda path: path.write_text("<html>404</html>"), "is no image that OpenCV can decode"),
    "loop.png": (lambda path: path.symlink_to(path.name), "cannot be read: Too many levels of symbolic links"),
    "gone.png": (lambda path: path.symlink_to("nowhere"), "no such file"),
    "bomb.png": (lambda path: path.write_bytes(bomb(10_000)), "is 10000x10000 pixels, and 67108864 in all are read"),
    "null.png": (lambda path: path.symlink_to("/dev/zero"), "is no regular file; remove it"),
}


@pytest.mark.parametrize("jobs", [None, 1])
def test_each_is_named_and_none_ends_the_run(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, jobs: int | None
) -> None:
    folder = write_images(tmp_path / "run", frames=5) / "std_cam"
    alone = describe(find_sequences([tmp_path / "run"]), SPEC)
    for image in folder.iterdir():
        shutil.copy(image, tmp_path / f"{image.name.split('.')[0]}.png")
    for name, (make, _) in HOSTILE.items():
        make(tmp_path / name)
    (tmp_path / "folder.png").mkdir()
    shutil.rmtree(tmp_path / "run")
    found = describe(find_sequences([tmp_path]), SPEC, work=workers(jobs))
    np.testing.assert_array_equal(found.values, alone.values)
    assert found.skipped == len(HOSTILE)
    warnings = [record.getMessage() for record in caplog.records if "the frame is skipped" in record.getMessage()]
    assert len(warnings) == len(HOSTILE)
    for name, (_, reason) in HOSTILE.items():
        assert sum(f"{tmp_path / name}: {reason}" in warning for warning in warnings) == 1, (name, warnings)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = write_images(tmp_path / "run", frames=3) / "std_cam"
    (folder / "t1001.000000_x0.000000_y0.000000_a0.000000.png").chmod(0)
    assert describe(find_sequences([tmp_path / "run"]), SPEC).skipped == 1
    assert "cannot be read: Permission denied; the frame is skipped" in caplog.text


def names_in(path: Path) -> list[str]:
    with np.load(path) as file:
        frames: list[str] = file["frames"].tolist()
    return frames


@pytest.mark.parametrize("what", ["one image", "the folder"])
def test_images_that_vanish_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture, what: str) -> None:
    """After the first batch of 64 frames."""
    folder = write_images(tmp_path / "run", frames=150) / "std_cam"
    images = sorted(folder.iterdir())
    gone = images[100:101] if what == "one image" else images[64:]

    def vanish(done: int, total: int) -> None:
        if done == 64:
            for path in gone if what == "one image" else images:
                path.unlink()
            if what == "the folder":
                shutil.rmtree(folder.parent)

    describe_sources([tmp_path / "run"], tmp_path / "d.npz", spec=SPEC, work=workers(1), progress=vanish)
    assert names_in(tmp_path / "d.npz") == [path.name for path in images if path not in gone]
    for path in gone:
        assert f"{path}: no such file; the frame is skipped" in caplog.messages


def test_an_image_that_is_replaced_is_described_as_it_is_then(tmp_path: Path) -> None:
    folder = write_images(tmp_path / "run", frames=150) / "std_cam"
    images = sorted(folder.iterdir())

    def replace(done: int, total: int) -> None:
        if done == 64:
            shutil.copy(images[0], tmp_path / "new")
            (tmp_path / "new").replace(images[100])

    describe_sources([tmp_path / "run"], tmp_path / "d.npz", spec=SPEC, work=workers(1), progress=replace)
    with np.load(tmp_path / "d.npz") as file:
        np.testing.assert_array_equal(file["descriptors"][100], file["descriptors"][0])


def test_a_folder_that_is_gone_before_it_is_read_is_an_error(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sequences = find_sequences([write_images(tmp_path / "run", frames=3)])
    shutil.rmtree(tmp_path / "run")
    with caplog.at_level(logging.WARNING), pytest.raises(VisionError, match="none of the 3 images can be read"):
        describe(sequences, SPEC)


def test_an_image_that_changed_between_two_runs_is_described_anew(tmp_path: Path) -> None:
    """A run that was interrupted after two batches, of which the second was made of another image."""
    folder = write_images(tmp_path / "run", frames=200) / "std_cam"
    images = sorted(folder.iterdir())

    def interrupt(done: int, total: int) -> None:
        if done > 128:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        describe_sources([tmp_path / "run"], tmp_path / "d.npz", spec=SPEC, work=workers(1), progress=interrupt)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".d.npz.partial-journal", "run"]
    shutil.copy(images[0], images[100])
    told: list[int] = []
    describe_sources(
        [tmp_path / "run"], tmp_path / "d.npz", spec=SPEC, work=workers(1), progress=lambda done, _: told.append(done)
    )
    describe_sources([tmp_path / "run"], tmp_path / "new.npz", spec=SPEC, work=workers(1))
    assert (tmp_path / "d.npz").read_bytes() == (tmp_path / "new.npz").read_bytes()
    assert told == [64, 128, 192, 200]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d.npz", "new.npz", "run"]


@pytest.mark.parametrize("change", ["options", "version", "dictionary"])
def test_what_was_found_otherwise_is_not_taken_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str) -> None:
    """The journal of an interrupted run is of no use to a run with other options, and not in its way."""
    write_images(tmp_path / "run", frames=200)
    run, out = [tmp_path / "run"], tmp_path / "out"

    def interrupt(done: int, total: int) -> None:
        if done > 128:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        describe_sources(run, out, spec=SPEC, work=workers(1), progress=interrupt)
    described = 0
    real = sys.modules["placerec.vision.work"].__dict__["describe_frame"]

    def counting(*args: object) -> object:
        nonlocal described
        described += 1
        return real(*args)

    monkeypatch.setattr("placerec.vision.work.describe_frame", counting)
    spec = DescriptorSpec(image_size=24) if change == "options" else SPEC
    if change == "version":
        monkeypatch.setattr("placerec.vision.work.__version__", "0.0.0")
    if change == "dictionary":
        from placerec.vision import Dictionary, DictionaryOptions
        from placerec.words.tokenize import tokenize

        Dictionary.fit(
            np.random.default_rng(0).random((30, 384), np.float32), spec=SPEC, options=DictionaryOptions(size=2)
        ).save(tmp_path / "w")
        tokenize(run, tmp_path / "w", out, work=workers(1))
    else:
        describe_sources(run, out, spec=spec, work=workers(1))
    assert described == 200
    assert not list(tmp_path.glob(".*"))
