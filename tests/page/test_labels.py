"""Labels while a page changes them: written whole, kept where nothing changed, never over what others write."""

import time
from pathlib import Path
from typing import Any

import pytest
from helpers.recordings import write_video
from helpers.small_world import write_images

from placerec.errors import PageError, SourceError
from placerec.frames import Sequence, find_sequences
from placerec.frames.folder import FileFrames
from placerec.frames.table import FrameTable
from placerec.page.labels import ChangedError, DriveLabels, places_of, stretches_of

HALL, KITCHEN = ["hall"] * 6, ["kitchen"] * 6


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_images(tmp_path / "seq1", 0)


def labels_of(path: Path) -> DriveLabels:
    (sequence,) = find_sequences([path])
    return DriveLabels(sequence)


def test_labels_are_written_and_undone_to_the_byte(folder: Path) -> None:
    path = folder / "localization/places.lst"
    before = path.read_bytes()
    drive = labels_of(folder)
    version, places = drive.state()
    assert places == HALL + KITCHEN
    changed = drive.save(["attic"] * 12, version)
    assert changed != version
    assert {line.split()[1] for line in path.read_text().splitlines()} == {"attic"}
    assert drive.save(places, changed) == version
    assert path.read_bytes() == before


def test_an_unlabelled_drive_gets_a_file_and_loses_it_again(folder: Path) -> None:
    path = folder / "localization/places.lst"
    path.unlink()
    drive = labels_of(folder)
    assert drive.state() == ("", [""] * 12)
    version = drive.save([*HALL, *[""] * 6], "")
    assert len(path.read_text().splitlines()) == 6
    assert drive.save([""] * 12, version) == ""
    assert not path.exists()


def test_what_others_write_is_noticed_and_kept(folder: Path) -> None:
    path = folder / "localization/places.lst"
    one, other = labels_of(folder), labels_of(folder)
    version, places = one.state()
    newer = other.save(["attic", *places[1:]], version)
    assert one.version() == newer
    with pytest.raises(ChangedError, match=r"places\.lst: was changed meanwhile by somebody else"):
        one.save([""] * 12, version)
    assert one.state() == (newer, ["attic", *places[1:]])
    # An editor's own lines stay when the page goes on.
    path.write_text(path.read_text() + "gone.jpeg   cellar\n")
    after, seen = one.state()
    one.save(["attic", "attic", *seen[2:]], after)
    assert path.read_text().endswith("gone.jpeg   cellar\n")


def test_what_cannot_be_read_or_written_changes_nothing(folder: Path) -> None:
    path = folder / "localization/places.lst"
    drive = labels_of(folder)
    version, places = drive.state()
    before = path.read_bytes()
    with pytest.raises(SourceError, match="the place 'a/b' holds a /; name it otherwise"):
        drive.save(["a/b"] * 12, version)
    assert path.read_bytes() == before
    path.write_text("no label\nx\n")
    with pytest.raises(SourceError, match=r"places\.lst:2: no label in 'x'"):
        drive.state()
    with pytest.raises(ChangedError):
        drive.save(places, version)


def test_a_video_is_labelled_by_its_times(tmp_path: Path) -> None:
    drive = labels_of(write_video(tmp_path / "run.mp4"))
    drive.save([*["hall"] * 12, *[""] * 4, *["lab"] * 4], "")
    assert (tmp_path / "run.labels").read_text() == "0 1.2 hall\n1.6 2 lab\n"


def test_stretches_are_places_and_back() -> None:
    places = ["", "hall", "hall", "lab", ""]
    assert stretches_of(places) == [(1, 3, "hall"), (3, 4, "lab")]
    assert places_of([list(one) for one in stretches_of(places)], 5) == places
    assert places_of([], 2) == ["", ""]
    wrongs: list[Any] = [
        "hall",
        {},
        [[0, 1]],
        [[0, 1, 2]],
        [[0, 1.0, "hall"]],
        [[0, True, "x"]],
        [[1, 1, "a"]],
        [[0, 1, "a" * 200]],
    ]
    for wrong in wrongs:
        with pytest.raises(PageError, match="is no"):
            places_of(wrong, 5)


def test_a_hundred_thousand_frames_are_read_and_saved_in_seconds(tmp_path: Path) -> None:
    """The frames' files are not needed for it, and take longer to make."""
    names = [f"i{number:06d}.jpg" for number in range(100_000)]
    (tmp_path / "places.lst").write_text("".join(f"{name} hall\n" for name in names))
    begun = time.process_time()
    table = FrameTable.of("long", names, places=["hall"] * len(names))
    drive = DriveLabels(Sequence("long", FileFrames(tmp_path, table), tmp_path))
    version, places = drive.state()
    assert len(places) == len(names)
    drive.save(["lab"] * 500 + places[500:], version)
    assert time.process_time() - begun < 10
    lines = (tmp_path / "places.lst").read_text().splitlines()
    assert [line.endswith("lab") for line in lines] == [True] * 500 + [False] * 99_500
