"""The laboratory's files: COLD's layout and names, the same bytes from the same seed, labels that fit the poses."""

import re
from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from placerec import demo
from placerec.errors import OutputError
from placerec.lab import layout
from placerec.lab.layout import SCALES, SEQUENCES, Scale, render, render_lab, warn_of_another
from placerec.lab.path import Timing
from placerec.lab.world import place

# Even smaller than `tiny`: what is tested does not depend on the number of frames.
SMALLEST = Scale(80, 60, 30, 1.0, Timing({"seq3": (26, 28), "seq4": (34, 36)}, 0.3, 0.5, 0.01, brief=True))
NAME = re.compile(r"t(\d+\.\d{6})_x(-?\d+\.\d{7})_y(-?\d+\.\d{7})_a(-?\d+\.\d{7})\.jpeg")
THREE = ("seq4_cloudy1", "seq4_night1", "seq4_sunny1")


def read_labels(sequence: Path) -> tuple[list[str], list[str]]:
    lines = (sequence / "localization" / "places.lst").read_text(encoding="utf-8").splitlines()
    names, labels = zip(*(line.rsplit(" ", 1) for line in lines), strict=True)
    return list(names), list(labels)


def read_grey(sequence: Path) -> list[NDArray[np.float32]]:
    names, _ = read_labels(sequence)
    images = [cv2.imread(str(sequence / "std_cam" / name), cv2.IMREAD_GRAYSCALE) for name in names]
    return [np.asarray(image, np.float32) for image in images]


def read_bytes(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "all"
    frames = render(folder, SMALLEST, "--scale smallest --seed 5", 5, SEQUENCES)
    assert frames == len(list(folder.rglob("*.jpeg")))
    return folder


def test_eighteen_sequences_in_cold_layout(laboratory: Path) -> None:
    expected = {f"{p}_{w}{r}" for p in ("seq3", "seq4") for w in ("cloudy", "night", "sunny") for r in (1, 2, 3)}
    assert {p.name for p in laboratory.iterdir()} == expected | {"README.txt"}
    for sequence in (laboratory / name for name in sorted(expected)):
        names, _ = read_labels(sequence)
        matches = [NAME.fullmatch(name) for name in names]
        assert all(matches)
        times = np.array([float(m[1]) for m in matches if m])
        assert ((np.diff(times) > 0.1899) & (np.diff(times) < 0.2301)).all()
        assert {p.name for p in (sequence / "std_cam").iterdir()} == set(names)


def test_readme_says_synthetic(laboratory: Path) -> None:
    text = (laboratory / "README.txt").read_text(encoding="utf-8")
    assert "ynthetic" in text
    assert "placerec lab --scale smallest --seed 5" in text


def test_label_is_the_room_of_the_pose(laboratory: Path) -> None:
    for name in SEQUENCES:
        for file, label in zip(*read_labels(laboratory / name), strict=True):
            match = NAME.fullmatch(file)
            assert match is not None
            assert place(float(match[2]), float(match[3])) == label


def test_order_of_visits_is_that_of_cold(laboratory: Path, shared: Path) -> None:
    for path in ("seq3", "seq4"):
        real = shared / "cold_labels/COLD/saarbruecken" / f"{path}_cloudy1/localization/places.lst"
        visits = _visits([line.rsplit(" ", 1)[1] for line in sorted(real.read_text().split("\n")) if line])
        for name in (n for n in SEQUENCES if n.startswith(path)):
            assert _visits(read_labels(laboratory / name)[1]) == visits


def _visits(labels: list[str]) -> list[str]:
    return [label for i, label in enumerate(labels) if i == 0 or labels[i - 1] != label]


def test_same_seed_same_bytes_alone_or_with_others(laboratory: Path, tmp_path: Path) -> None:
    render(tmp_path / "again", SMALLEST, "", 5, ("seq3_night2",))
    again = read_bytes(tmp_path / "again" / "seq3_night2")
    # Painting begins with another run's furniture here, so this also shows that runs do not leak into each other.
    assert again == read_bytes(laboratory / "seq3_night2")


def test_other_seed_other_bytes(laboratory: Path, tmp_path: Path) -> None:
    render(tmp_path / "other", SMALLEST, "", 6, ("seq3_night2",))
    pictures = set(read_bytes(tmp_path / "other" / "seq3_night2").values())
    assert not pictures & set(read_bytes(laboratory / "seq3_night2").values())


def test_runs_differ(laboratory: Path) -> None:
    first, second = (set(read_bytes(laboratory / f"seq3_cloudy{run}").values()) for run in (1, 2))
    assert not first & second


def test_images_are_neither_flat_nor_noise(laboratory: Path) -> None:
    images = [image for name in THREE for image in read_grey(laboratory / name)]
    # A plain wall at arm's length may be dull; a flat picture would have only the sensor's noise, below 4.
    assert min(float(image.std()) for image in images) > 4
    assert np.median([image.std() for image in images]) > 20
    alike = [np.corrcoef(image[:, 1:].ravel(), image[:, :-1].ravel())[0, 1] for image in images if image.std() > 15]
    assert len(alike) > 60
    assert min(alike) > 0.4
    assert np.median(alike) > 0.8


def test_night_is_darker_than_cloudy_and_sunny_is_brightest(laboratory: Path) -> None:
    for path in ("seq3", "seq4"):
        night, cloudy, sunny = (
            np.mean([i.mean() for run in (1, 2, 3) for i in read_grey(laboratory / f"{path}_{weather}{run}")])
            for weather in ("night", "cloudy", "sunny")
        )
        assert night + 8 < cloudy
        assert cloudy + 8 < sunny


def test_neighbours_in_time_look_more_alike_than_others(laboratory: Path) -> None:
    for name in THREE:
        pictures = [cv2.resize(i, (20, 15), interpolation=cv2.INTER_AREA) for i in read_grey(laboratory / name)]
        small = np.stack(pictures)
        near = np.abs(small[1:] - small[:-1]).mean()
        far = np.abs(small[9:] - small[:-9]).mean()
        assert near < 0.9 * far


def test_unknown_scale_and_negative_seed_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="scale 'huge' is unknown; use one of tiny, small, paper"):
        render_lab(tmp_path / "x", scale="huge")
    with pytest.raises(OutputError, match="seed -1 is negative"):
        render_lab(tmp_path / "x", seed=-1)
    assert list(tmp_path.iterdir()) == []


def test_who_replaces_another_laboratory_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Rendered whole it would take a minute: what is there tells what made it."""
    folder = tmp_path / "lab"
    render(folder, SMALLEST, "--scale tiny --seed 3", 3, ("seq3_cloudy1",))
    warn_of_another(folder, "tiny", 3)
    warn_of_another(tmp_path / "none", "tiny", 4)
    assert caplog.messages == []
    warn_of_another(folder, "tiny", 4)
    told = f"{folder}: was the laboratory of --scale tiny --seed 3, and becomes that of --scale tiny --seed 4"
    assert caplog.messages == [told]
    (folder / "README.txt").write_bytes(b"\xff mine")
    warn_of_another(folder, "tiny", 4)
    assert caplog.messages == [told]


def test_the_warning_comes_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    render(tmp_path / "demo/lab", SMALLEST, "--scale small --seed 3", 3, ("seq3_cloudy1",))

    def stop(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(layout, "render", stop)
    told = "was the laboratory of --scale small --seed 3, and becomes that of --scale small --seed 0"
    with pytest.raises(KeyboardInterrupt):
        render_lab(tmp_path / "demo/lab")
    monkeypatch.setattr(demo, "render_lab", stop)
    with pytest.raises(KeyboardInterrupt):
        demo.run_demo(tmp_path / "demo", progress=lambda label: nullcontext(lambda done, total: None))
    assert caplog.messages[:2] == [f"{tmp_path / 'demo/lab'}: {told}"] * 2


def test_foreign_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match=r"thesis\.tex"):
        render(tmp_path, SMALLEST, "", 0, ("seq3_night2",))
    assert (tmp_path / "thesis.tex").read_text() == "mine"


def test_broken_off_leaves_nothing(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        assert 0 < done <= total
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(tmp_path / "lab", SMALLEST, "", 0, ("seq3_night2",), stop)
    assert list(tmp_path.iterdir()) == []


def test_scales_have_the_promised_sizes() -> None:
    for scale, low, high in (("tiny", 850, 1000), ("small", 2200, 2700), ("paper", 15_500, 17_500)):
        ranges = SCALES[scale].timing.frames.values()
        assert low < 9 * sum(np.mean(r) for r in ranges) < high
        assert all(r[0] >= 35 for r in ranges)
