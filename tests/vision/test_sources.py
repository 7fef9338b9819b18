"""`placerec train-words`: what it says about the map, and about frames that trained nothing."""

import logging
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import done

from placerec.errors import OutputError
from placerec.frames import files_of, find_sequences
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe, describe_sources, train_dictionary

SPEC = DescriptorSpec(image_size=32)


def test_held_out_frames_train_nothing_and_are_measured(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_images(tmp_path / "run1", seed=1)
    write_images(tmp_path / "run2", seed=2, frames=8)
    told: list[tuple[int, int]] = []
    with caplog.at_level(logging.INFO):
        made = train_dictionary(
            [tmp_path / "run1"],
            tmp_path / "words.npz",
            spec=SPEC,
            options=DictionaryOptions(size=5),
            held_out=[tmp_path / "run2"],
            progress=lambda done, total: told.append((done, total)),
        )
        summary = caplog.messages[-1]
    assert told == [(12, 20), (20, 20)]
    without = train_dictionary(
        [tmp_path / "run1"], tmp_path / "other.npz", spec=SPEC, options=DictionaryOptions(size=5)
    )
    assert made.fingerprint == without.fingerprint
    got = made.quality_of(describe(find_sequences([tmp_path / "run2"]), SPEC))
    assert got.frames == 8
    assert summary == (
        f"held out: 8 frames, {100 * got.unseen:.1f} % of them on words that training never saw; quantisation error "
        f"{got.quantisation_error:.4g}, topographic error {got.topographic_error:.3f}, entropy {got.entropy:.2f} bits"
    )


def test_the_command_says_what_came_of_it(tmp_path: Path) -> None:
    write_images(tmp_path / "run1", seed=1)
    out = tmp_path / "words.npz"
    options = ["--size", "3", "--image-size", "32", "--rule", "online", "--width", "0.4", "--epochs", "4"]
    held_out = ["--held-out", str(tmp_path / "run1"), "--held-out", str(write_images(tmp_path / "run2"))]
    result = done("train-words", tmp_path / "run1", "-o", out, *options, *held_out)
    made = Dictionary.load(out)
    assert (made.training.rule, made.training.width, made.quality.epochs) == ("online", 0.4, 4)
    assert made.spec == SPEC
    summary = r"9 words, \d of them never seen, from 12 of 12 frames; 11 components keep 100\.0 % of the variance "
    summary += r"\(\d+ would keep 99 %\); after 4 epochs quantisation error [\d.e-]+, topographic error 0\.\d{3}, "
    summary += r"entropy \d\.\d\d bits\n"
    assert re.search(summary, result.stderr), result.stderr
    assert "held out: 24 frames, " in result.stderr


def test_another_rule_is_another_map(tmp_path: Path) -> None:
    write_images(tmp_path / "run1", seed=1)
    batch = train_dictionary([tmp_path / "run1"], tmp_path / "a.npz", spec=SPEC, options=DictionaryOptions(size=3))
    online = train_dictionary(
        [tmp_path / "run1"], tmp_path / "b.npz", spec=SPEC, options=DictionaryOptions(size=3, rule="online")
    )
    np.testing.assert_array_equal(batch.pca.components, online.pca.components)
    assert batch.fingerprint != online.fingerprint


def test_what_is_read_is_not_written_over(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run")
    image = files_of(find_sequences([run])[0])[0]
    before = image.read_bytes()
    (tmp_path / "link.npz").symlink_to(image)
    matrix = tmp_path / "rows.npz"
    describe_sources([run], matrix, spec=SPEC)
    for out in (image, tmp_path / "link.npz"):
        with pytest.raises(OutputError, match="is read, and would be written over; name another output"):
            describe_sources([run], out, spec=SPEC)
        with pytest.raises(OutputError, match="is read, and would be written over"):
            train_dictionary([run], out, spec=SPEC)
    with pytest.raises(OutputError, match="is read, and would be written over"):
        describe_sources([run], matrix, matrix=matrix)
    assert image.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 3
    describe_sources([run], matrix, spec=SPEC)
