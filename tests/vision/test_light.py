"""Simulated light: the formulas, what is drawn once for a sequence, and recordings in another light."""

from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import done, fails

from placerec.cli import commands
from placerec.errors import OutputError, SourceError, VisionError
from placerec.frames import find_sequences, read_gray
from placerec.vision.light import LIGHTS, relight, relight_sequence, relit, relit_sequence


def image(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (24, 32, 3)).astype(np.uint8)


def linear(levels: np.ndarray) -> np.ndarray:
    return np.asarray((levels / 255) ** 2.2)


def lit(levels: np.ndarray, light: str, sequence: str = "run1", frame: int = 0, seed: int = 0) -> np.ndarray:
    return relit(levels, light, seed=seed, sequence=sequence, frame=frame)


def test_exposure_is_a_factor_of_linear_light() -> None:
    factors = set()
    for sequence in map(str, range(12)):
        found, dark = lit(image(), "exposure", sequence), linear(image()) < 0.4
        ratio = linear(found)[dark & (image() > 60)] / linear(image())[dark & (image() > 60)]
        factors.add(round(float(np.median(ratio)), 2))
        np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.06)
    assert factors == {0.45, 2.2}
    assert lit(np.full((8, 8, 3), 250, np.uint8), "exposure", "1").max() in (255, 174)


def test_dim_is_a_fifth_of_the_light_with_noise_of_its_own_in_every_frame() -> None:
    gray = np.full((200, 200, 3), 180, np.uint8)
    one, other = (linear(lit(gray, "dim", frame=frame)) for frame in (0, 1))
    share = float(linear(gray)[0, 0, 0]) / 5
    assert one.mean() == pytest.approx(share, rel=0.02)
    assert one.std() == pytest.approx(np.sqrt(share * 1000 + 9) / 1000, rel=0.1)
    assert (one != other).mean() > 0.5


def test_warm_takes_blue_and_a_lamp_has_a_side() -> None:
    gray = np.full((20, 100, 3), 128, np.uint8)
    warm, lamp = linear(lit(gray, "warm"))[0, 0], linear(lit(gray, "lamp"))[:, :, 1].mean(axis=0)
    assert warm[0] < warm[1] < warm[2]
    assert (np.diff(lamp) >= 0).all() or (np.diff(lamp) <= 0).all()
    for light in ("warm", "lamp"):
        assert (lit(image(), light, frame=0) == lit(image(), light, frame=7)).all()
        assert len({lit(image(), light, sequence=str(k)).tobytes() for k in range(8)}) > 1


@pytest.mark.parametrize("light", LIGHTS)
def test_the_seed_decides(light: str) -> None:
    assert (lit(image(), light) == lit(image(), light)).all()
    assert len({lit(image(), light, seed=seed).tobytes() for seed in range(8)}) > 1
    gray = image()[:, :, 0]
    assert (lit(gray, light) == lit(np.repeat(gray[:, :, None], 3, axis=2), light)).all()


def test_a_recording_in_another_light_keeps_frames_times_and_labels(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run1", seed=1)
    assert relight([run], tmp_path / "dim", "dim") == 12
    (before,), (after,) = find_sequences([run]), find_sequences([tmp_path / "dim"])
    assert [Path(frame.name).stem for frame in after.frames] == [Path(frame.name).stem for frame in before.frames]
    assert [(frame.time, frame.place) for frame in after.frames] == [
        (frame.time, frame.place) for frame in before.frames
    ]
    levels = [read_gray(frame.path).mean() for one in (before, after) for frame in one.frames]
    assert max(levels[12:]) < min(levels[:12])
    first = after.frames[0].path.read_bytes()
    done("relight", run, "-o", tmp_path / "dim", "--light", "dim")
    assert find_sequences([tmp_path / "dim"])[0].frames[0].path.read_bytes() == first


def test_a_relit_sequence_has_the_times_and_places_of_its_frames_whatever_their_files_tell(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run1", seed=1)
    (sequence,) = find_sequences([run])
    sequence.frames[3].path.write_text("no picture")
    frames = [replace(frame, time=float(k), place=f"place {k}") for k, frame in enumerate(sequence.frames)]
    sequence = replace(sequence, frames=frames)
    assert [*relight_sequence(sequence, tmp_path / "warm", "warm", seed=0)] == [k != 3 for k in range(12)]
    found = relit_sequence(sequence, tmp_path / "warm")
    assert found.name == "run1"
    assert [(frame.time, frame.place) for frame in found.frames] == [
        (frame.time, frame.place) for k, frame in enumerate(frames) if k != 3
    ]
    assert all(read_gray(frame.path).shape == (24, 32) for frame in found.frames)


def test_what_something_else_wrote_is_not_replaced(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run1", seed=1)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/README.txt").write_text("mine")
    with pytest.raises(OutputError, match="out"):
        relight([run], tmp_path / "out", "warm")
    with pytest.raises(VisionError, match="no simulated light is called 'dusk'; choose one of dim, warm, lamp, exp"):
        relight([run], tmp_path / "new", "dusk")
    fails("no sequence there", "relight", tmp_path / "out", "-o", tmp_path / "new", "--light", "dim")


def test_the_command_offers_every_light() -> None:
    (light,) = [one for one in commands.commands["relight"].params if one.name == "light"]
    assert isinstance(light.type, click.Choice)
    assert [*light.type.choices] == [*LIGHTS]


def test_two_frames_that_would_be_one_file_are_refused(tmp_path: Path) -> None:
    run = write_images(tmp_path / "run", 1, 2)
    first, second, *_ = sorted(run.rglob("*.png"))
    second.rename(first.with_suffix(".jpg"))
    with pytest.raises(SourceError, match=rf"run: two frames would both be stored as {first.stem}\.jpeg; rename one"):
        relight([run], tmp_path / "out", "warm")
    assert not (tmp_path / "out").exists()
