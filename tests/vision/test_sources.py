"""`placerec train-words`: what it says about the map, and about frames that trained nothing."""

import logging
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import done, fails, misused

from placerec.errors import OutputError
from placerec.frames import files_of, find_sequences
from placerec.jobs import workers
from placerec.vision import (
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySet,
    DictionarySetOptions,
    describe,
    describe_sources,
    train_dictionary,
)

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
    (got,) = made.quality_of(describe(find_sequences([tmp_path / "run2"]), SPEC))
    assert got.frames == 8
    assert summary == (
        f"held out: 8 frames, {100 * got.unseen:.1f} % of them on words that training never saw; quantisation error "
        f"{got.quantisation_error:.4g}, topographic error {got.topographic_error:.3f}, entropy {got.entropy:.2f} bits"
    )


def test_the_command_says_what_came_of_it(tmp_path: Path) -> None:
    write_images(tmp_path / "run1", seed=1)
    out = tmp_path / "words.npz"
    options = ["--as-in-paper", "--size", "3", "--image-size", "32"]
    options += ["--rule", "online", "--width", "0.4", "--epochs", "4"]
    held_out = ["--held-out", str(tmp_path / "run1"), "--held-out", str(write_images(tmp_path / "run2"))]
    result = done("train-words", tmp_path / "run1", "-o", out, *options, *held_out)
    made = Dictionary.load(out)
    assert (made.training.rule, made.training.width, made.quality.epochs) == ("online", 0.4, 4)
    assert made.spec == SPEC
    summary = r"9 words, \d of them never seen, from 12 frames; 11 components keep 100\.0 % of the variance "
    summary += r"\(\d+ would keep 99 %\); after 4 epochs quantisation error [\d.e-]+, topographic error 0\.\d{3}, "
    summary += r"entropy \d\.\d\d bits\n"
    assert re.search(summary, result.stderr), result.stderr
    assert "held out: 24 frames, " in result.stderr


def test_another_rule_is_another_map(tmp_path: Path) -> None:
    write_images(tmp_path / "run1", seed=1)
    batch, online = (
        train_dictionary([tmp_path / "run1"], tmp_path / "w.npz", spec=SPEC, options=options).dictionaries[0]
        for options in (DictionaryOptions(size=3), DictionaryOptions(size=3, rule="online"))
    )
    np.testing.assert_array_equal(batch.pca.components, online.pca.components)
    assert batch.fingerprint != online.fingerprint


VIEWS = ("--views", "plain,pn", "--sizes", "2,3", "--image-size", "32")


def test_several_dictionaries_are_each_told_of(tmp_path: Path) -> None:
    run, out = write_images(tmp_path / "run1", seed=1), tmp_path / "words.npz"
    held_out = write_images(tmp_path / "run2", seed=2)
    result = done("train-words", run, "-o", out, *VIEWS, "--held-out", held_out, "--no-cache")
    made = DictionarySet.load(out)
    assert (made.names, made.sequences) == (("", "plain3", "pn2", "pn3"), ("run1",))
    told = result.stderr.splitlines()
    assert re.fullmatch(r"view pn: from 12 labelled frames of 2 places, their covariance shrunk by \d\.\d\d", told[2])
    for one, line in zip(made.dictionaries[1:], told[-8:-5], strict=True):
        assert line.startswith(f"{one.name}: {one.training.size**2} words, {one.dead} of them never seen; after ")
    assert [line.split(":")[0] for line in told[-4:]] == ["held out", *(f"held out, {name}" for name in made.names[1:])]
    again = train_dictionary(
        [run], tmp_path / "again.npz", spec=SPEC, options=DictionarySetOptions(sizes=(2, 3)), work=workers(2)
    )
    assert again.fingerprint == made.fingerprint
    assert out.read_bytes() == (tmp_path / "again.npz").read_bytes()


def test_the_papers_words_are_a_preset_and_what_is_given_wins(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run1", seed=1)
    small = ("--image-size", "32", "-q")
    for name, options in {
        "paper": ("--as-in-paper",),
        "spelled": ("--views", "plain", "--size", "10"),
        "paper3": ("--as-in-paper", "--size", "3"),
        "spelled3": ("--sizes", "3", "--views", "plain"),
        "both": ("--as-in-paper", "--views", "pn,plain", "--sizes", "2,3"),
    }.items():
        done("train-words", run, "-o", tmp_path / name, *options, *small)
    train_dictionary([run], tmp_path / "library", spec=SPEC, options=DictionaryOptions())
    paper, spelled, library = ((tmp_path / name).read_bytes() for name in ("paper", "spelled", "library"))
    assert paper == spelled == library
    assert (tmp_path / "paper3").read_bytes() == (tmp_path / "spelled3").read_bytes()
    assert Dictionary.load(tmp_path / "paper3").training.size == 3
    assert DictionarySet.load(tmp_path / "both").names == ("", "pn3", "plain2", "plain3")


def test_views_and_sizes_that_do_not_exist_are_refused(tmp_path: Path) -> None:
    for options, message in (
        (
            ("--views", "plain,lda"),
            "Invalid value for '--views': no view is called 'lda'; choose some of plain, pn",
        ),
        (("--views", "pn,pn"), "Invalid value for '--views': pn is named twice"),
        (("--sizes", "10,1"), "Invalid value for '--size' / '--sizes': 1 is not in the range 2<=x<=200;"),
        (("--size", "10,,20"), "Invalid value for '--size' / '--sizes': '' is not a valid integer range;"),
        (("--size", "010,10"), "Invalid value for '--size' / '--sizes': 10 is named twice"),
    ):
        misused(message, "train-words", tmp_path, "-o", tmp_path / "no", *options)


def test_without_labels_one_view_is_left(tmp_path: Path) -> None:
    write_images(tmp_path / "run1", seed=1)
    (tmp_path / "run1/std_cam").rename(tmp_path / "bare")
    result = done("train-words", tmp_path / "bare", "-o", tmp_path / "words.npz", *VIEWS)
    assert "warning: the view pn is left out: it needs frames of two places, and of 12 frames none is labelled\n" in (
        result.stderr
    )
    assert DictionarySet.load(tmp_path / "words.npz").names == ("", "plain3")
    alone = ("--views", "pn", "--size", "3")
    fails(
        "the view pn cannot be learned: it needs frames of",
        "train-words",
        tmp_path / "bare",
        "-o",
        tmp_path / "n",
        *alone,
    )


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
