"""Descriptors that are kept for other commands: taken as long as the images did not change, and never anything else."""

import logging
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.recordings import find_one, write_video
from helpers.small_world import write_images
from helpers.typed_commands import SMALL, done, misused

from placerec.experiments.store import describe_all
from placerec.frames import find_sequences
from placerec.frames.images import BATCH
from placerec.jobs import workers
from placerec.journal import Cache
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe, train_dictionary
from placerec.words.tokenize import streams_of, tokenize

SPEC = DescriptorSpec(image_size=16)


def kept(folder: Path) -> list[Path]:
    return sorted((folder / "described").iterdir())


def known(messages: list[str]) -> list[str]:
    return [message.partition(" were described before")[0] for message in messages if "described before" in message]


def frames_of(root: Path, count: int) -> Path:
    return write_images(root / "run", frames=count)


@pytest.mark.parametrize("jobs", [None, 2])
def test_what_is_kept_is_what_would_be_described(
    tmp_path: Path, jobs: int | None, caplog: pytest.LogCaptureFixture
) -> None:
    frames_of(tmp_path, BATCH + 6)
    sequences = find_sequences([tmp_path / "run"])
    work = jobs and workers(jobs)
    plain = describe(sequences, SPEC)
    with caplog.at_level(logging.INFO):
        first, second = (describe(sequences, SPEC, work=work or None, cache=tmp_path / "kept") for _ in range(2))
    assert known(caplog.messages) == [f"{BATCH + 6} of {BATCH + 6} frames"]
    for found in (first, second):
        np.testing.assert_array_equal(found.values, plain.values)
        assert found.table == plain.table
    assert len(kept(tmp_path / "kept")) == 2


def test_nothing_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames_of(tmp_path, 5)
    sequences = find_sequences([tmp_path / "run"])
    plain = describe(sequences, SPEC, cache=tmp_path / "kept")
    monkeypatch.setattr("placerec.vision.work.read_image", lambda path, **how: pytest.fail("an image was read"))
    np.testing.assert_array_equal(describe(sequences, SPEC, cache=tmp_path / "kept").values, plain.values)


@pytest.mark.parametrize("change", ["content", "removed", "settings"])
def test_what_changed_is_described_anew(tmp_path: Path, change: str, caplog: pytest.LogCaptureFixture) -> None:
    run = frames_of(tmp_path, 2 * BATCH)
    describe(find_sequences([run]), SPEC, cache=tmp_path / "kept")
    images = sorted(run.rglob("*.png"))
    spec = SPEC
    if change == "content":
        # As long and as old as before.
        old = images[3].stat()
        data = bytearray(images[3].read_bytes())
        images[3].unlink()
        images[3].write_bytes(images[4].read_bytes()[: len(data)].ljust(len(data), b"\0"))
        os.utime(images[3], ns=(old.st_atime_ns, old.st_mtime_ns))
    elif change == "removed":
        images[3].unlink()
    else:
        spec = DescriptorSpec(image_size=24)
    with caplog.at_level(logging.INFO):
        found = describe(find_sequences([run]), spec, cache=tmp_path / "kept")
    plain = describe(find_sequences([run]), spec)
    np.testing.assert_array_equal(found.values, plain.values)
    assert known(caplog.messages) == ([f"{BATCH} of {2 * BATCH} frames"] if change == "content" else [])


def test_labels_may_change_freely(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    run = frames_of(tmp_path, 6)
    describe(find_sequences([run]), SPEC, cache=tmp_path / "kept")
    (places,) = run.rglob("places.lst")
    places.write_text(places.read_text().replace("hall", "cellar"))
    with caplog.at_level(logging.INFO):
        found = describe(find_sequences([run]), SPEC, cache=tmp_path / "kept")
    assert known(caplog.messages) == ["6 of 6 frames"]
    assert "cellar" in found.places


def test_a_frame_that_could_not_be_read_is_tried_again(tmp_path: Path) -> None:
    run = frames_of(tmp_path, 6)
    bad = sorted(run.rglob("*.png"))[2]
    whole = bad.read_bytes()
    bad.write_bytes(b"")
    assert describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").skipped == 1
    assert not (tmp_path / "kept").exists()
    bad.write_bytes(whole)
    assert describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").skipped == 0


def test_damage_is_described_anew(tmp_path: Path) -> None:
    run = frames_of(tmp_path, 3 * BATCH)
    plain = describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").values
    first, second, third = kept(tmp_path / "kept")
    first.write_bytes(first.read_bytes()[:-1])
    damaged = bytearray(second.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    second.write_bytes(damaged)
    third.write_bytes(first.read_bytes())
    np.testing.assert_array_equal(describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").values, plain)
    assert [path.read_bytes() for path in (first, second, third)] != [b""] * 3
    np.testing.assert_array_equal(describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").values, plain)


def test_a_recording_of_which_a_middle_is_known(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.mp4", frames=[np.full((32, 48, 3), i % 250, np.uint8) for i in range(3 * BATCH)])
    sequence = find_one(path)
    plain = describe([sequence], SPEC, cache=tmp_path / "kept").values
    for gone in range(3):
        for other in kept(tmp_path / "kept")[: gone + 1]:
            other.unlink()
        np.testing.assert_array_equal(describe([sequence], SPEC, cache=tmp_path / "kept").values, plain)
        assert len(kept(tmp_path / "kept")) == 3


@pytest.mark.parametrize("jobs", [None, 2])
def test_words_of_kept_descriptors(tmp_path: Path, jobs: int | None, caplog: pytest.LogCaptureFixture) -> None:
    run = frames_of(tmp_path, BATCH + 6)
    words, options = tmp_path / "words.npz", DictionaryOptions(size=3)
    train_dictionary([run], words, spec=SPEC, options=options, cache=tmp_path / "kept")
    tokenize([run], words, tmp_path / "plain")
    work = workers(jobs) if jobs else None
    with caplog.at_level(logging.INFO):
        # All known, and none: what tokenize keeps is what others take.
        for cache in ("kept", "new", "new"):
            tokenize([run], words, tmp_path / "tokens", cache=tmp_path / cache, work=work)
            assert (tmp_path / "tokens/run.tsv").read_bytes() == (tmp_path / "plain/run.tsv").read_bytes()
    assert known(caplog.messages) == [f"{BATCH + 6} of {BATCH + 6} frames"] * 2
    assert [path.name for path in kept(tmp_path / "new")] == [path.name for path in kept(tmp_path / "kept")]
    assert kept(tmp_path / "new")[0].read_bytes() == kept(tmp_path / "kept")[0].read_bytes()
    (stream,) = streams_of([run], Dictionary.load(words), cache=tmp_path / "new")
    assert len(stream) == BATCH + 6


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="rights do not bind here")
def test_a_folder_that_cannot_be_written_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    run = frames_of(tmp_path, 2 * BATCH)
    (tmp_path / "locked").mkdir(mode=0o500)
    describe(find_sequences([run]), SPEC, cache=tmp_path / "locked")
    assert sum("descriptors are not kept" in message for message in caplog.messages) == 1


def test_a_file_in_its_place_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    run = frames_of(tmp_path, 2 * BATCH)
    (tmp_path / "kept").write_text("mine")
    assert len(describe(find_sequences([run]), SPEC, cache=tmp_path / "kept").values) == 2 * BATCH
    assert sum("descriptors are not kept for other commands" in message for message in caplog.messages) == 1
    assert (tmp_path / "kept").read_text() == "mine"


def test_what_killed_runs_left_is_removed(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "kept")
    cache.put(b"key", b"content")
    (tmp_path / f"kept/.{b'other'.hex()}.partial-abcd_123").write_text("half")
    again = Cache(tmp_path / "kept")
    assert again.get(b"key") == b"content"
    assert again.get(b"other") is None
    assert [path.name for path in (tmp_path / "kept").iterdir()] == [b"key".hex()]


def test_commands_share_what_lies_beside_their_outputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames_of(tmp_path, 8)
    monkeypatch.chdir(tmp_path)
    told = done("train-words", "run", "-o", "words.npz", *SMALL[:-1]).stderr
    assert ".placerec-cache: keeps descriptors for other commands; it may be removed" in told
    (one,) = kept(tmp_path / ".placerec-cache")
    commands = (
        ("tokenize", "run", "-w", "words.npz", "-o", "tokens"),
        ("describe", tmp_path / "run", "-o", "descriptors.npz", "--image-size", 16),
        ("train-words", "run", "-o", "words2.npz", *SMALL[:-1]),
        ("learn", "run", "-o", "model", "--views", "plain", "--size", 3, "--image-size", 16),
        ("decode", "run", "-m", "model", "-o", "beliefs"),
        ("report", "beliefs", "--frames", "run", "-w", "words.npz", "-o", "report.html"),
        ("show-words", "words.npz", "run", "-o", "words.png"),
        ("show-words", "words.npz", "run", "--cache", ".placerec-cache"),
    )
    for command in commands:
        told = done(*command).stderr
        assert "8 of 8 frames were described before: .placerec-cache" in told, (command, told)
        assert "keeps descriptors" not in told
    assert kept(tmp_path / ".placerec-cache") == [one]


def test_what_is_kept_in_a_folder_does_not_forbid_to_replace_it(tmp_path: Path) -> None:
    run = frames_of(tmp_path, 8)
    options = ("--views", "plain", "--size", 3, "--image-size", 16, "-q")
    done("learn", run, "-o", tmp_path / "model", *options)
    done("decode", run, "-m", tmp_path / "model", "-o", tmp_path / "model/beliefs", "-q")
    assert kept(tmp_path / "model/.placerec-cache")
    done("learn", run, "-o", tmp_path / "model", *options)
    assert not (tmp_path / "model/.placerec-cache").exists()


def test_compare_takes_what_others_described(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for seed, name in enumerate(("run1", "run2")):
        write_images(tmp_path / "runs" / name, seed)
    sequences = find_sequences([tmp_path / "runs"])
    describe(sequences[:1], SPEC, cache=tmp_path / "kept")
    with caplog.at_level(logging.INFO):
        found = [describe_all(sequences, SPEC, tmp_path / cache) for cache in ("kept", "own")]
    assert known(caplog.messages) == ["12 of 24 frames"]
    for one, own in zip(*found, strict=True):
        np.testing.assert_array_equal(one.load().values, own.load().values)
    assert len(kept(tmp_path / "kept")) == 2
    assert not (tmp_path / "own/described").exists()


def test_whoever_wants_none_has_none(tmp_path: Path) -> None:
    run = frames_of(tmp_path, 8)
    (tmp_path / "out").mkdir()
    for _ in range(2):
        told = done("train-words", run, "-o", tmp_path / "out/words.npz", *SMALL[:-1], "--no-cache").stderr
        assert "described before" not in told
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["words.npz"]
    done("show-words", tmp_path / "out/words.npz", run)
    assert not list(tmp_path.rglob(".placerec-cache"))
    misused("contradict each other", "describe", run, "-o", tmp_path / "d.npz", "--no-cache", "--cache", tmp_path / "c")
