"""How stable words are: the changes themselves, and the counts against a plain loop."""

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.recordings import find_one, pictures, read_images, write_video
from helpers.small_world import write_images
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.frames import Sequence, find_sequences, read_gray
from placerec.frames.sequence import Gray
from placerec.inspection import changes, word_stability
from placerec.inspection.changes import CHANGES, Change
from placerec.inspection.word_stability import ChangeResult, Stability, word_changes
from placerec.jobs import workers
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe, descriptor, fit_image
from placerec.vision.light import LIGHTS, relight

SPEC = DescriptorSpec(image_size=16)
World = tuple[list[Sequence], Dictionary]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / name, seed, 10)
    sequences = find_sequences([root])
    return sequences, Dictionary.fit(describe(sequences, SPEC).values, spec=SPEC, options=DictionaryOptions(size=4))


def change(kind: str, amount: str) -> Change:
    return next(each for each in CHANGES if (each.kind, each.amount) == (kind, amount))


def spoilt(gray: Gray, kind: str, amount: str, spec: DescriptorSpec = SPEC) -> Gray:
    return change(kind, amount).apply(gray, spec, np.random.Generator(np.random.PCG64(0)))


def picture(dtype: type = np.uint8, height: int = 48, width: int = 64) -> NDArray[np.uint8 | np.float32]:
    smooth = cv2.GaussianBlur(np.random.default_rng(0).random((height, width)), (0, 0), 2)
    low, high = smooth.min(), smooth.max()
    gray: NDArray[np.uint8 | np.float32] = (20 + 200 * (smooth - low) / (high - low)).astype(dtype)
    return gray


def test_the_counts_are_those_of_a_plain_loop(world: World) -> None:
    sequences, dictionary = world
    found = word_changes(sequences, dictionary, seed=3)
    rows = [
        [descriptor(gray, SPEC), *(descriptor(each.apply(gray, SPEC, rng), SPEC) for each in CHANGES)]
        for number, frame in enumerate(frame for sequence in sequences for frame in sequence.frames)
        for gray, rng in [(read_gray(frame.path), np.random.Generator(np.random.PCG64([3, number])))]
    ]
    words = [[int(dictionary.words(values[None])[0][0]) for values in row] for row in rows]

    def counts(pairs: list[tuple[int, int]]) -> tuple[int, int]:
        apart = [max(abs(a // 4 - b // 4), abs(a % 4 - b % 4)) for a, b in pairs]
        return sum(distance > 0 for distance in apart), sum(distance == 1 for distance in apart)

    assert (found.frames, found.step.frames) == (20, 18)
    for column, result in enumerate(found.results, start=1):
        assert (result.kind, result.amount) == (CHANGES[column - 1].kind, CHANGES[column - 1].amount)
        assert (result.changed, result.neighbour) == counts([(row[0], row[column]) for row in words])
    steps = [(words[i][0], words[i + 1][0]) for i in range(19) if i != 9]
    assert (found.step.changed, found.step.neighbour) == counts(steps)
    assert sum(result.changed for result in found.results) > 0


def test_the_same_seed_gives_the_same_counts_in_pieces_of_any_size(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = word_changes(*world)
    told: list[tuple[int, int]] = []
    monkeypatch.setattr(word_stability, "_TOGETHER", 3)
    assert word_changes(*world, progress=lambda *done: told.append(done)) == whole
    assert told == [(done, 20) for done in (3, 6, 9, 10, 13, 16, 19, 20)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_any_number_of_workers_gives_the_same_counts(world: World, jobs: int) -> None:
    assert word_changes(*world, work=workers(jobs)) == word_changes(*world)


def test_a_sample_is_drawn_by_the_seed_and_judged_as_in_the_whole(world: World) -> None:
    sequences, dictionary = world
    found = word_changes(sequences, dictionary, seed=5, sample=7)
    drawn = np.sort(np.random.Generator(np.random.PCG64(5)).permutation(20)[:7]).tolist()
    assert (found.frames, found.of) == (7, 20)
    assert {(result.frames, result.of) for result in found.results} == {(7, 20)}
    assert (found.step.frames, found.step.of) == (len(set(drawn) - {9, 19}), 18)
    words = []
    for number in drawn:
        gray = read_gray([frame for sequence in sequences for frame in sequence.frames][number].path)
        rng = np.random.Generator(np.random.PCG64([5, number]))
        rows = [descriptor(gray, SPEC), *(descriptor(each.apply(gray, SPEC, rng), SPEC) for each in CHANGES)]
        words.append([int(dictionary.words(values[None])[0][0]) for values in rows])
    for column, result in enumerate(found.results, start=1):
        assert result.changed == sum(row[0] != row[column] for row in words)
    assert word_changes(sequences, dictionary, seed=6, sample=7) != found
    assert word_changes(sequences, dictionary, seed=5, sample=20) == word_changes(sequences, dictionary, seed=5)


def test_a_sample_of_a_recording_is_that_of_its_images(world: World, tmp_path: Path) -> None:
    video = find_one(write_video(tmp_path / "run.mp4", frames=pictures(20)))
    folder = tmp_path / "run"
    folder.mkdir()
    for number, gray in enumerate(read_images(video)):
        assert not isinstance(gray, str)
        cv2.imwrite(str(folder / f"{number:03d}.png"), gray)
    whole, found = (word_changes([one], world[1], sample=6) for one in (*find_sequences([folder]), video))
    assert found == whole


def test_the_interval_holds_the_share_of_all_frames_as_often_as_it_says() -> None:
    """A share of all frames that is known, and samples of it."""
    rng = np.random.Generator(np.random.PCG64(0))
    of, changed = 1000, 130
    for frames in (50, 500):
        drawn = rng.hypergeometric(changed, of - changed, frames, 4000)
        ends = np.array([ChangeResult("", "", frames, int(k), 0, of).interval for k in range(frames + 1)])
        held = (ends[drawn, 0] <= changed / of) & (changed / of <= ends[drawn, 1])
        assert held.mean() == pytest.approx(0.95, abs=0.02)
        assert (np.diff(ends, axis=1) >= 0).all()
    assert ChangeResult("", "", 500, 0, 0, 1000).interval[0] == 0
    assert ChangeResult("", "", 500, 500, 0, 1000).interval[1] == pytest.approx(1)
    low, high = ChangeResult("", "", word_stability.SAMPLE, word_stability.SAMPLE // 2, 0, 10**9).interval
    assert high - low < 0.09


def test_an_image_that_cannot_be_read_is_skipped_and_named(
    world: World, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bad = next((write_images(tmp_path / "seq", frames=4) / "std_cam").iterdir())
    bad.write_text("no picture")
    with caplog.at_level(logging.WARNING, "placerec"):
        found = word_changes(find_sequences([tmp_path / "seq"]), world[1])
    assert found.frames == 3
    assert f"{bad}: is no image that OpenCV can decode" in caplog.text
    for path in (tmp_path / "seq/std_cam").iterdir():
        path.write_text("no picture")
    with pytest.raises(VisionError, match="none of the 4 images can be read"):
        word_changes(find_sequences([tmp_path / "seq"]), world[1])


def coloured(root: Path, video: bool) -> None:
    """Two sequences of frames in colours, which differ little from each other."""
    rng = np.random.default_rng(0)
    base = cv2.GaussianBlur(rng.random((48, 64, 3)), (0, 0), 3) - 0.5
    for name in ("seq1", "seq2"):
        (root / name).mkdir(parents=True)
        frames = [
            np.clip(120 + 600 * base + 6 * rng.standard_normal(base.shape), 0, 255).astype(np.uint8) for _ in range(7)
        ]
        if video:
            write_video(root / name / "run.avi", "MJPG", frames)
        for number, frame in enumerate([] if video else frames):
            cv2.imwrite(str(root / name / f"{number:03d}.png"), frame)


@pytest.mark.parametrize(("kind", "video"), [("gist", False), ("colour", False), ("ranks", True)])
def test_words_in_other_lights_are_those_of_the_relit_sequences(tmp_path: Path, kind: str, video: bool) -> None:
    coloured(tmp_path / "runs", video)
    sequences = find_sequences([tmp_path / "runs"])
    spec = DescriptorSpec(kind=kind)
    values = describe(sequences, spec).values
    dictionary = Dictionary.fit(values, spec=spec, options=DictionaryOptions(size=3))
    found = word_changes(sequences, dictionary, light=True, seed=2)
    before = dictionary.words(values)[0]
    for light, result in zip(LIGHTS, found.results, strict=True):
        relight([tmp_path / "runs"], tmp_path / light, light, seed=2)
        after = dictionary.words(describe(find_sequences([tmp_path / light]), spec).values)[0]
        assert (result.kind, result.amount, result.frames) == ("simulated light", light, 14)
        assert result.changed == (before != after).sum()
    assert sum(result.changed for result in found.results) > 0
    assert found.step == word_changes(sequences, dictionary).step


def test_json_has_shares() -> None:
    found = Stability(4, 4, (ChangeResult("noise", "sigma 2", 4, 2, 1, 4),), ChangeResult("next", "", 0, 0, 0, 0))
    shares = {"changed": 0.5, "interval": [0.5, 0.5], "to_neighbour": 0.25}
    assert found.to_json() == {
        "frames": 4,
        "of": 4,
        "changes": [{"kind": "noise", "amount": "sigma 2", **shares}],
        "next_frame": {"steps": 0, "changed": None, "interval": None, "to_neighbour": None},
    }


# The changes


@pytest.mark.parametrize("each", CHANGES, ids=lambda each: f"{each.kind} {each.amount}")
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_changed_picture_is_a_picture_of_its_kind(each: Change, dtype: type) -> None:
    gray = picture(dtype)
    before = gray.copy()
    changed = each.apply(gray, SPEC, np.random.Generator(np.random.PCG64(0)))
    np.testing.assert_array_equal(gray, before)
    assert changed.dtype == (np.uint8 if each.kind == "JPEG" else dtype)
    assert changed.shape == ((16, 16) if each.kind == "resize filter" else gray.shape)
    assert 0 <= changed.min() <= changed.max() <= 255
    if changed.shape == gray.shape:
        assert not np.array_equal(changed, gray)


def test_brightness_is_a_factor_and_stays_within_white() -> None:
    gray = np.tile(np.array([0, 10, 100, 250], np.uint8), (8, 2))
    assert spoilt(gray, "brightness", "+30 %")[0, :4].tolist() == [0, 13, 130, 255]
    assert spoilt(gray, "brightness", "-10 %")[0, :4].tolist() == [0, 9, 90, 225]


def test_noise_has_the_deviation_that_it_says() -> None:
    gray = np.full((100, 100), 128, np.float32)
    for sigma in (2, 5, 10):
        assert spoilt(gray, "noise", f"sigma {sigma}").std() == pytest.approx(sigma, rel=0.03)


@pytest.mark.parametrize(("way", "row", "column"), [("left", 0, -1), ("right", 0, 1), ("up", -1, 0), ("down", 1, 0)])
def test_a_shift_moves_the_picture_by_a_pixel_and_repeats_the_edge(way: str, row: int, column: int) -> None:
    gray = np.zeros((9, 9), np.uint8)
    gray[4, 4], gray[0, 0], gray[8, 8] = 200, 7, 9
    moved = spoilt(gray, "shift by 1 pixel", way)
    assert moved[4 + row, 4 + column] == 200
    assert (moved == 200).sum() == 1
    assert (moved == (9 if row + column < 0 else 7)).sum() == 2


def test_less_quality_is_farther_from_the_picture() -> None:
    gray = picture().astype(np.uint8)
    errors = [np.abs(spoilt(gray, "JPEG", f"quality {q}").astype(int) - gray).mean() for q in (90, 70, 50, 30)]
    assert errors == sorted(errors)
    assert 0 < errors[0] < errors[-1]


@pytest.mark.parametrize("fit", ["squash", "crop"])
def test_another_filter_keeps_the_way_of_fitting(fit: str) -> None:
    gray = picture(np.float32, 60, 90)
    spec = DescriptorSpec(image_size=20, fit=fit)
    rng = np.random.Generator(np.random.PCG64(0))
    with_ours = changes._resized(gray, spec, rng, interpolation=cv2.INTER_AREA)
    np.testing.assert_allclose(with_ours, fit_image(gray, 20, fit), atol=1e-3)
    for name in ("nearest", "bicubic"):
        assert not np.array_equal(spoilt(gray, "resize filter", name, spec), with_ours)
