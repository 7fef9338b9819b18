"""Where labels are written, and that what did not change stays as it is, to the byte."""

from pathlib import Path

import numpy as np
import pytest
from helpers.recordings import find_one, stream, write_bag, write_video
from hypothesis import given, strategies as st

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences
from placerec.frames.label_files import LabelFile, label_file, runs

IMAGES = tuple(f"i{number}.png" for number in range(8))
TIMES = tuple(np.arange(8) / 10)
PLACES = st.lists(st.sampled_from(["", "hall", "lab"]), min_size=8, max_size=8)


def folder_of(path: Path, images: tuple[str, ...] = IMAGES) -> Path:
    path.mkdir(parents=True)
    for name in images:
        (path / name).touch()
    return path


def only(path: Path, **options: object) -> Sequence:
    (sequence,) = find_sequences([path], options=SourceOptions(**options))  # type: ignore[arg-type]
    return sequence


def test_a_list_keeps_the_lines_that_say_what_is_so() -> None:
    file = LabelFile(Path("places.lst"), IMAGES)
    base = "\ufeffi1.png   hall\r\n\r\ni0.png hall\r\ngone.png attic\r\ni3.png\tlab"
    places = file.places(base)
    assert places == ["hall", "hall", "", "lab", "", "", "", ""]
    assert file.text(places, base) == base
    assert file.text(["hall", "attic", "", "lab", "", "", "", ""], base) == base.replace("  hall", "  attic")
    grown = file.text(["hall", "hall", "hall", "lab", "lab", "", "", ""], base)
    assert grown == base.replace("i1.png   hall\r\n", "i1.png   hall\r\ni2.png hall\r\n") + "\r\ni4.png lab\r\n"
    assert file.text([""] * 8, base) == "\ufeff\r\ngone.png attic\r\n"
    assert file.text(["lab", *[""] * 7]) == "i0.png lab\n"


def test_intervals_keep_the_lines_that_are_whole() -> None:
    file = LabelFile(Path("run.labels"), None, TIMES)
    base = "# by hand\n.5 .80 lab # twice\n0 0.25 hall\n90 91 attic\n"
    places = file.places(base)
    assert places == ["hall", "hall", "hall", "", "", "lab", "lab", "lab"]
    assert file.text(places, base) == base
    moved = file.text(["hall", "hall", "", "", "", "lab", "lab", "lab"], base)
    assert moved == "0 0.2 hall\n# by hand\n.5 .80 lab # twice\n90 91 attic\n"
    filled = file.text(["hall", "hall", "hall", "attic", "attic", "lab", "lab", "lab"], base)
    assert filled == base.replace("hall\n", "hall\n0.3 0.5 attic\n")
    assert file.text([*[""] * 6, "lab", "lab"]) == "0.6 0.8 lab\n"
    assert file.text([""] * 8, base) == "# by hand\n90 91 attic\n"


@given(PLACES, PLACES)
def test_what_is_written_is_read_and_undone(first: list[str], second: list[str]) -> None:
    for file in (LabelFile(Path("places.lst"), IMAGES), LabelFile(Path("run.labels"), None, TIMES)):
        base = file.text(first)
        changed = file.text(second, base)
        assert file.places(base) == first
        assert file.places(changed) == second
        assert file.text(first, base) == base
        assert file.text(second, changed) == changed
        assert file.text(second) == file.text(second, "")


def test_names_that_cannot_be_and_frames_that_cannot_be_told_apart_are_refused() -> None:
    file = LabelFile(Path("run.labels"), None, (0.0, 0.5, 0.5))
    with pytest.raises(SourceError, match=r"run\.labels: frames at one time cannot be in two places"):
        file.text(["", "hall", "lab"])
    with pytest.raises(SourceError, match="the place 'a b' holds white space; name it otherwise"):
        file.text(["a b", "", ""])
    with pytest.raises(SourceError, match="place 'Hall' differs only in case from 'hall'"):
        file.text(["hall", "Hall", "Hall"])


def test_where_labels_of_folders_lie(tmp_path: Path) -> None:
    plain = folder_of(tmp_path / "run1")
    assert label_file(only(plain)) == LabelFile(plain / "places.lst", IMAGES)
    cold = folder_of(tmp_path / "run2/std_cam").parent
    assert label_file(only(cold)) == LabelFile(cold / "localization/places.lst", IMAGES)
    (cold / "places.lst").write_text("i0.png hall\n")
    assert label_file(only(cold)).path == cold / "places.lst"
    (tmp_path / "run1.labels").write_text("0 0.25 hall\n")
    timed = label_file(only(plain, rate=10))
    assert timed == LabelFile(tmp_path / "run1.labels", None, TIMES)
    assert timed.places("0 0.25 hall\n") == ["hall"] * 3 + [""] * 5


def test_where_labels_of_recordings_lie_and_how_they_count(tmp_path: Path) -> None:
    video = find_one(write_video(tmp_path / "run.mp4"))
    file = label_file(video)
    assert (file.path, file.images, file.times[:2]) == (tmp_path / "run.labels", None, (0.0, 0.1))
    file.path.write_text(file.text(["hall"] * 5 + [""] * 5 + ["lab"] * 10))
    assert file.path.read_text() == "0 0.5 hall\n1 2 lab\n"
    assert [frame.place for frame in find_one(video.source).frames] == ["hall"] * 5 + [""] * 5 + ["lab"] * 10
    pytest.importorskip("rosbags")
    bag = find_one(write_bag(tmp_path / "drive", {"/c": stream()}))
    since = label_file(bag)
    assert since.times[:2] == (0.0, 0.1)
    since.path.write_text(since.text(["hall"] * 20))
    assert {frame.place for frame in find_one(bag.source).frames} == {"hall"}
    # As stamps are written, so they are read.
    stamps = label_file(bag, SourceOptions(label_clock="stamps"))
    assert stamps.times[0] == 1_700_000_000
    since.path.write_text(stamps.text(["lab"] * 20))
    assert since.path.read_text() == "1700000000 1700000002 lab\n"
    assert label_file(find_one(bag.source)).times[0] == 1_700_000_000
    named = SourceOptions(labels=tmp_path)
    assert label_file(find_one(video.source, labels=tmp_path), named).path == tmp_path / "run.labels"


def test_what_no_file_can_label(tmp_path: Path) -> None:
    part = SourceOptions(every=2)
    with pytest.raises(SourceError, match="is read in part"):
        label_file(only(folder_of(tmp_path / "run1"), every=2), part)
    for place in ("hall", "lab"):
        folder_of(tmp_path / "rooms" / place)
    first, _ = find_sequences([tmp_path / "rooms"])
    with pytest.raises(SourceError, match="is a folder of one place; for a drive say --format sequences"):
        label_file(first)


def test_runs_of_equal_values() -> None:
    assert [*runs(["a", "a", "", "b"])] == [(0, 2, "a"), (2, 3, ""), (3, 4, "b")]
    assert [*runs([])] == []
