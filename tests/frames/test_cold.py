"""COLD's layout, with the dirt that the real data has (readings 4.1 and 4.5)."""

import logging
import math
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences, read_gray
from placerec.frames.layouts import seconds_in
from placerec.frames.places import read_places

# Lines of the nine real label files, as their SOURCE.md counts them.
LINES = {
    "freiburg/seq1_cloudy1": 1459,
    "freiburg/seq2_cloudy1": 2146,
    "freiburg/seq3_cloudy1": 2236,
    "ljubljana/seq1_cloudy1": 2112,
    "ljubljana/seq2_cloudy1": 2267,
    "saarbruecken/seq1_cloudy1": 997,
    "saarbruecken/seq2_cloudy1": 2815,
    "saarbruecken/seq3_cloudy1": 858,
    "saarbruecken/seq4_cloudy1": 1371,
}
LABELS = {
    "saarbruecken/seq3_cloudy1": {"CR-B": 319, "PA-B": 94, "1PO-B": 131, "TL-B": 314},
    "saarbruecken/seq4_cloudy1": {"CR-B": 695, "PA-B": 85, "1PO-B": 115, "TL-B": 302, "KT-B": 174},
}


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("t1152903982.078005_x2.289920_y-0.274201_a0.002522.jpeg", 1152903982.078005),
        ("t1151922584.426561_x0.762576_y-4.34677_a1.36297.jpeg", 1151922584.426561),
        (
            "t1152212857.193444_x0.3068230_y-0.0158034_a-0.0096662.jpeg",
            1152212857.193444,
        ),
        ("t1151922584.426561_x2_y-1e-05_a+1.5E+1.jpeg", 1151922584.426561),
        ("t1000000000.000000_x0_y0_a0.png", 1e9),
        ("t1151922584.426561.jpeg", 1151922584.426561),
        ("t12.jpeg", None),  # a counter, no clock
        ("t1.5_x1_y2.jpeg", None),
        ("t1.5_x1_y2_a3.jpeg.part.jpeg", None),
        ("t1.5_x1_y2_a.jpeg", None),
        ("xt1.5_x1_y2_a3.jpeg", None),
        ("frame0001.jpeg", None),
        ("t1.5", None),
    ],
)
def test_names_of_all_laboratories(name: str, seconds: float | None) -> None:
    assert seconds_in(name) == seconds


@pytest.mark.parametrize("sequence", sorted(LINES))
def test_real_label_files(shared: Path, sequence: str) -> None:
    labels = read_places(shared / "cold_labels/COLD" / sequence / "localization/places.lst")
    assert len(labels.places) == LINES[sequence]
    assert sorted(labels.lines.values()) == list(range(1, LINES[sequence] + 1))
    for name in labels.places:
        seconds = seconds_in(name)
        assert seconds is not None
        assert seconds > 1.1e9
    if sequence in LABELS:
        assert Counter(labels.places.values()) == LABELS[sequence]


def test_real_label_files_with_their_images(shared: Path, tmp_path: Path) -> None:
    for sequence in LABELS:
        source = shared / "cold_labels/COLD" / sequence / "localization/places.lst"
        folder = tmp_path / sequence
        (folder / "std_cam").mkdir(parents=True)
        (folder / "localization").mkdir()
        (folder / "localization/places.lst").write_bytes(source.read_bytes())
        for name in read_places(source).places:
            (folder / "std_cam" / name).touch()
    found = {f"saarbruecken/{s.name}": s for s in find_sequences([tmp_path])}
    assert found.keys() == LABELS.keys()
    for name, run in found.items():
        assert Counter(frame.place for frame in run.frames) == LABELS[name]
        times = [frame.time for frame in run.frames]
        assert times == sorted(times)


POSED = [
    "t1000.000000_x2.289920_y-0.274201_a0.002522.jpeg",  # Freiburg
    "t1000.205000_x0.762576_y-4.34677_a1.36297.jpeg",  # Ljubljana
    "t1000.410000_x2_y-1e-05_a0.jpeg",  # Ljubljana: %g
    "t1000.615000_x0.3068230_y-0.0158034_a-0.0096662.jpeg",  # Saarbruecken
    "t1000.820000.jpeg",  # no pose known
    "t1070.000000_x1_y1_a1.jpeg",  # after a gap of more than a minute
    "t9999.500000_x1_y1_a1.jpeg",
    "t10000.000000_x1_y1_a1.jpeg",  # before the last but one as text, after it in time
]
# CR flickers to PA for one frame; the seventh image has no line.
PLACES = ["CR-B", "PA-B", "CR-B", "CR-B", "PA-B", "PA-B", "", "TL-B"]


@pytest.fixture
def dirty(tmp_path: Path) -> Path:
    """An unpacked tar with a second folder of the same name, an unsorted CRLF list, a truncated JPEG."""
    folder = tmp_path / "seq3_cloudy1" / "seq3_cloudy1"
    for part in ("std_cam", "omni_cam", "odom_scans", "localization"):
        (folder / part).mkdir(parents=True)
    picture = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
    for name in POSED:
        assert cv2.imwrite(str(folder / "std_cam" / name), picture)
        assert cv2.imwrite(str(folder / "omni_cam" / name), picture)
    cut = folder / "std_cam" / POSED[3]
    cut.write_bytes(cut.read_bytes()[:-200])
    (folder / "std_cam" / "._t1000.000000.jpeg").touch()
    (folder / "odom_scans/odom.tdf").touch()
    lines = [f"{name} {place}" for name, place in zip(POSED, PLACES, strict=True) if place]
    lines.insert(3, "t1000.500000_x1_y1_a1.jpeg CR-B")
    (folder / "localization/places.lst").write_bytes("\r\n".join([*reversed(lines), "", ""]).encode())
    return tmp_path


def test_dirt(dirty: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        (sequence,) = find_sequences([dirty])
    assert sequence.name == "seq3_cloudy1"
    assert sequence.source == dirty / "seq3_cloudy1/seq3_cloudy1"
    assert [frame.name for frame in sequence.frames] == POSED
    assert [frame.place for frame in sequence.frames] == PLACES
    assert [frame.time for frame in sequence.frames] == [
        1000,
        1000.205,
        1000.41,
        1000.615,
        1000.82,
        1070,
        9999.5,
        10000,
    ]
    places = sequence.source / "localization/places.lst"
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("WARNING", f"{places}: 1 of its images are missing (first: t1000.500000_x1_y1_a1.jpeg in line 5)"),
        ("INFO", f"{places}: 1 of 8 images have no label"),
    ]


def test_dirt_decodes_but_for_the_truncated_image(dirty: Path) -> None:
    (sequence,) = find_sequences([dirty])
    for k, frame in enumerate(sequence.frames):
        if k == 3:
            with pytest.raises(SourceError, match="truncated"):
                read_gray(frame.path)
        else:
            assert read_gray(frame.path).shape == (24, 32)


def test_sequence_folder_and_std_cam_itself_are_the_same_sequence(dirty: Path) -> None:
    inner = dirty / "seq3_cloudy1/seq3_cloudy1"
    expected = find_sequences([dirty])
    for source in (dirty / "seq3_cloudy1", inner, inner / "std_cam"):
        assert find_sequences([source]) == expected
        assert find_sequences([source], options=SourceOptions("sequences")) == expected


def test_equal_times_go_by_name(tmp_path: Path) -> None:
    names = ["t5.000000_x1_y0_a0.jpeg", "t5.000000_x3_y0_a0.jpeg", "t5.000000_x2_y0_a0.jpeg", "t1.000000.jpeg"]
    frames = _sequence(tmp_path / "s", names).frames
    assert [frame.name for frame in frames] == [names[k] for k in (3, 0, 2, 1)]


def test_without_a_list_nothing_is_labelled(tmp_path: Path) -> None:
    frames = _sequence(tmp_path / "s", ["t2.000000.jpeg", "t1.000000.jpeg"]).frames
    assert [(frame.time, frame.place) for frame in frames] == [(1.0, ""), (2.0, "")]


def test_names_without_times_keep_natural_order(tmp_path: Path) -> None:
    frames = _sequence(tmp_path / "s", ["img10.jpeg", "img2.jpeg"]).frames
    assert [frame.name for frame in frames] == ["img2.jpeg", "img10.jpeg"]
    assert all(math.isnan(frame.time) for frame in frames)


def test_one_image_without_a_time_among_others(tmp_path: Path) -> None:
    with pytest.raises(SourceError) as error:
        _sequence(tmp_path / "s", ["t2.000000.jpeg", "t1.000000.jpeg", "map.png"])
    where = tmp_path / "s/std_cam/map.png"
    assert str(error.value) == f"{where}: no time stamp in its name, and 2 images there have one; remove it"


def test_sets_in_this_layout(shared: Path) -> None:
    home = find_sequences([shared / "data/go2home"])
    assert len(home) == 13
    assert home[0].name == "run01_kitchen_174636"
    places = Counter(frame.place for sequence in home for frame in sequence.frames)
    assert places == {"bedroom": 592, "doorway": 321, "kitchen": 108, "living_room": 164}
    corridor = find_sequences([shared / "data/rtabmap_corridor"])
    assert [(sequence.name, len(sequence.frames)) for sequence in corridor] == [("lap1", 39), ("lap2", 45)]
    assert read_gray(corridor[0].frames[0].path).shape == (240, 320)


def _sequence(folder: Path, names: list[str]) -> Sequence:
    (folder / "std_cam").mkdir(parents=True)
    for name in names:
        (folder / "std_cam" / name).touch()
    (sequence,) = find_sequences([folder])
    return sequence
