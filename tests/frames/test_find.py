"""Which folders are sequences, what they are called, and what is said where there is none."""

import math
import os
import sys
from pathlib import Path

import pytest

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.folder import WANTED, Listing, list_folder, natural_key
from placerec.frames.recordings import WANTED as RECORDED


def make(root: Path, *names: str) -> None:
    """Empty files: nothing here may open an image."""
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()


def labelled(root: Path, text: str) -> None:
    root.parent.mkdir(parents=True, exist_ok=True)
    root.write_text(text, encoding="utf-8")


def failure(*sources: Path | str, format: str = "auto") -> str:
    with pytest.raises(SourceError) as error:
        find_sequences(sources, options=SourceOptions(format))
    return str(error.value)


def test_natural_order() -> None:
    names = ["img10.png", "img2.png", "img1.png", "10", "9a", "img02.png", "img"]
    assert sorted(names, key=natural_key) == ["9a", "10", "img", "img1.png", "img02.png", "img2.png", "img10.png"]


def test_folder_of_images(tmp_path: Path) -> None:
    make(
        tmp_path / "run", "b10.JPG", "b9.jpg", "a.webp", "c.PpM", "notes.txt", ".hidden.png", "x.tif", "y.TIFF", "z.pgm"
    )
    (sequence,) = find_sequences([tmp_path / "run"])
    assert [frame.name for frame in sequence.frames] == [
        "a.webp",
        "b9.jpg",
        "b10.JPG",
        "c.PpM",
        "x.tif",
        "y.TIFF",
        "z.pgm",
    ]
    assert all(math.isnan(frame.time) and frame.place == "" for frame in sequence.frames)
    assert sequence.name == "run"
    assert sequence.source == tmp_path / "run"
    assert sequence.frames[0].path == tmp_path / "run/a.webp"


def test_a_folder_is_listed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hundreds of thousands of names come from a disk, or over a network."""
    make(tmp_path, "run/1.png", "run/2.png")
    listed: list[Path] = []

    def listing(folder: Path) -> Listing:
        listed.append(folder)
        return list_folder(folder)

    monkeypatch.setattr("placerec.frames.find.list_folder", listing)
    find_sequences([tmp_path])
    assert listed == [tmp_path, tmp_path / "run"]


@pytest.mark.parametrize("place", ["places.lst", "localization/places.lst"])
def test_folder_of_images_with_labels(tmp_path: Path, place: str) -> None:
    make(tmp_path / "run", "img1.png", "img2.png", "img10.png")
    labelled(tmp_path / "run" / place, "img10.png CR\nimg1.png KT\n")
    for source in (tmp_path, tmp_path / "run"):
        (sequence,) = find_sequences([source])
        assert [frame.place for frame in sequence.frames] == ["KT", "", "CR"]


def test_folder_of_stamped_images_is_sorted_by_time(tmp_path: Path) -> None:
    make(tmp_path / "run", "t10.500000.jpeg", "t9.5.jpeg", "t9.25.jpeg")
    (sequence,) = find_sequences([tmp_path])
    assert [frame.time for frame in sequence.frames] == [9.25, 9.5, 10.5]
    assert sequence.frames[0].place == ""  # stamped images are a run, and its folder no place


def test_search_is_deep_sorted_and_leaves_out_what_is_hidden(tmp_path: Path) -> None:
    for name in ("lab/part_a/seq10", "lab/part_a/seq2", "lab/.cache/seq3", "other"):
        make(tmp_path / name / "std_cam", "t1.000000.jpeg")
    make(tmp_path / "lab/part_a/seq2/omni_cam", "t1.000000.jpeg")
    assert [sequence.name for sequence in find_sequences([tmp_path])] == ["seq2", "seq10", "other"]


def test_links_are_followed_but_not_in_circles_nor_twice(tmp_path: Path) -> None:
    make(tmp_path / "data/run1/std_cam", "t1.000000.jpeg")
    make(tmp_path / "elsewhere/run2/std_cam", "t1.000000.jpeg")
    os.symlink(tmp_path / "data", tmp_path / "data/circle")
    os.symlink(tmp_path / "data/run1", tmp_path / "data/latest")
    os.symlink(tmp_path / "elsewhere/run2", tmp_path / "data/linked")
    os.symlink(tmp_path / "nowhere", tmp_path / "data/broken")
    assert [sequence.name for sequence in find_sequences([tmp_path / "data"])] == ["linked", "run1"]


def test_images_beside_sequences_are_left_out_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path, "map.png", "run/std_cam/t1.000000.jpeg")
    assert [sequence.name for sequence in find_sequences([tmp_path])] == ["run"]
    assert caplog.messages == [f"{tmp_path}: holds sequences; 1 image beside them not read"]


def test_a_list_without_images_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path, "run/images/a.png")
    labelled(tmp_path / "run/localization/places.lst", "a.png KT\n")
    (sequence,) = find_sequences([tmp_path / "run"])
    assert (sequence.name, sequence.frames[0].place) == ("images", "")
    where = tmp_path / "run/localization/places.lst"
    assert caplog.messages == [f"{where}: no std_cam/ and no images beside it; not read"]


@pytest.fixture
def rooms(tmp_path: Path) -> Path:
    make(tmp_path / "home", "kitchen/img10.png", "kitchen/img9.png", "bath/1.jpg", "empty/notes.txt")
    return tmp_path / "home"


def test_one_folder_per_place(rooms: Path, caplog: pytest.LogCaptureFixture) -> None:
    (bath, kitchen) = find_sequences([rooms])
    assert (bath.name, kitchen.name) == ("bath", "kitchen")
    assert [(frame.name, frame.place) for frame in kitchen.frames] == [
        ("img9.png", "kitchen"),
        ("img10.png", "kitchen"),
    ]
    assert [frame.place for frame in bath.frames] == ["bath"]
    assert caplog.messages == [
        f"{rooms}: read as one folder per place (bath, kitchen); if they are sequences, say --format sequences",
        f"{rooms / 'empty'}: holds no image; not read as a place",
    ]


def test_the_same_folders_as_sequences(rooms: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = find_sequences([rooms], options=SourceOptions("sequences"))
    assert [(sequence.name, {frame.place for frame in sequence.frames}) for sequence in found] == [
        ("bath", {""}),
        ("kitchen", {""}),
    ]
    assert caplog.messages == []


def test_places_can_be_asked_for(tmp_path: Path) -> None:
    make(tmp_path, "kitchen/t2.000000.jpeg", "kitchen/t1.000000.jpeg", "bath/t3.000000.jpeg")
    assert {frame.place for sequence in find_sequences([tmp_path]) for frame in sequence.frames} == {""}
    (bath, kitchen) = find_sequences([tmp_path], options=SourceOptions("places"))
    assert [(frame.time, frame.place) for frame in (*bath.frames, *kitchen.frames)] == [
        (3.0, "bath"),
        (1.0, "kitchen"),
        (2.0, "kitchen"),
    ]
    expected = f"no folder of a place there; looked for {tmp_path / 'bath'}/PLACE/ with {WANTED}"
    assert failure(tmp_path / "bath", format="places") == f"{tmp_path / 'bath'}: {expected}"


def test_a_list_or_a_run_anywhere_is_no_folder_per_place(rooms: Path) -> None:
    make(rooms, "corridor/std_cam/1.png")
    assert {frame.place for sequence in find_sequences([rooms]) for frame in sequence.frames} == {""}


def test_a_folder_in_a_folder_of_its_name_is_no_place(tmp_path: Path) -> None:
    make(tmp_path, "run/run/1.png")
    (sequence,) = find_sequences([tmp_path / "run"])
    assert (sequence.name, sequence.frames[0].place) == ("run", "")


def test_place_folders_have_place_names(tmp_path: Path) -> None:
    make(tmp_path, "living room/1.png", "bath/1.png")
    folder = tmp_path / "living room"
    assert failure(tmp_path) == f"{folder}: place 'living room' holds white space; rename the folder"


def test_twin_places_of_two_sequences(tmp_path: Path) -> None:
    make(tmp_path, "a/1.png", "a/2.png", "b/1.png")
    labelled(tmp_path / "a/places.lst", "1.png hall\n2.png Kitchen\n")
    labelled(tmp_path / "b/places.lst", "\n1.png kitchen\n")
    assert failure(tmp_path) == (
        f"{tmp_path / 'b/places.lst'}:2: place 'kitchen' differs only in case from 'Kitchen' "
        f"({tmp_path / 'a/places.lst'}:2); rename one"
    )


def test_equal_names_get_their_parents(tmp_path: Path) -> None:
    for lab in ("freiburg", "ljubljana"):
        make(tmp_path / lab / "seq1_cloudy1/std_cam", "t1.000000.jpeg")
    make(tmp_path / "ljubljana/seq2_cloudy1/std_cam", "t1.000000.jpeg")
    make(tmp_path / "saarbruecken/seq1_cloudy1/seq1_cloudy1/std_cam", "t1.000000.jpeg")
    assert [sequence.name for sequence in find_sequences([tmp_path])] == [
        "freiburg-seq1_cloudy1",
        "ljubljana-seq1_cloudy1",
        "seq2_cloudy1",
        "saarbruecken-seq1_cloudy1",
    ]


def test_names_that_stay_equal(tmp_path: Path) -> None:
    for part in ("a", "b"):
        make(tmp_path / part / "lab/seq1/std_cam", "t1.000000.jpeg")
    one, two = tmp_path / "a/lab/seq1", tmp_path / "b/lab/seq1"
    assert failure(tmp_path) == f"{two}: is named lab-seq1, as {one} is; rename one of them"


def test_a_name_made_longer_may_meet_another(tmp_path: Path) -> None:
    for name in ("a/s", "b/s", "c/a-s"):
        make(tmp_path / name / "std_cam", "t1.000000.jpeg")
    assert failure(tmp_path) == f"{tmp_path / 'c/a-s'}: is named a-s, as {tmp_path / 'a/s'} is; rename one of them"


def test_the_same_sequence_twice(tmp_path: Path) -> None:
    make(tmp_path, "run/std_cam/t1.000000.jpeg")
    run = tmp_path / "run"
    assert failure(run, run) == f"{run}: is given twice; name each sequence once"
    assert failure(tmp_path, f"{tmp_path}/run/../run") == (
        f"{tmp_path}/run/../run: is given twice (also as {run}); name each sequence once"
    )
    assert failure(run / "std_cam", run) == f"{run}: is given twice; name each sequence once"


def test_several_sources_keep_their_order(tmp_path: Path) -> None:
    for name in ("b", "a"):
        make(tmp_path / name / "std_cam", "t1.000000.jpeg")
    assert [sequence.name for sequence in find_sequences([tmp_path / "b", str(tmp_path / "a")])] == ["b", "a"]
    assert [sequence.name for sequence in find_sequences(str(tmp_path))] == ["a", "b"]
    assert find_sequences([]) == []


def test_the_current_folder_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path / "run", "1.png", "2.png")
    monkeypatch.chdir(tmp_path / "run")
    (sequence,) = find_sequences(["."])
    assert (sequence.name, len(sequence.frames), sequence.frames[0].place) == ("run", 2, "")
    monkeypatch.chdir(tmp_path)
    # One folder alone is no set of places.
    (sequence,) = find_sequences(["."])
    assert (sequence.name, sequence.frames[0].place) == ("run", "")


def test_sources_that_are_none(tmp_path: Path) -> None:
    make(tmp_path, "notes/readme.txt", "seq/std_cam/readme.txt")
    (tmp_path / "void").mkdir()
    looked = f"no sequence there; looked for std_cam/, {WANTED}, {RECORDED}, 6 folders deep"
    assert WANTED == "images (*.jpg *.jpeg *.png *.bmp *.webp *.tif *.tiff *.pgm *.ppm)"
    assert failure(tmp_path / "absent") == f"{tmp_path / 'absent'}: no such file or folder"
    assert failure(tmp_path / "void") == f"{tmp_path / 'void'}: {looked}"
    assert failure(tmp_path / "notes") == f"{tmp_path / 'notes'}: {looked}"
    make(tmp_path, "run/1.JPG")
    assert failure(tmp_path / "run/1.JPG") == (
        f"{tmp_path / 'run/1.JPG'}: is one image; name its folder, or a list of images (`-`)"
    )
    make(tmp_path, "tokens/run1.tsv")
    streams = "holds no images, but .tsv files; train-lm and decode take token streams"
    assert failure(tmp_path / "tokens") == f"{tmp_path / 'tokens'}: {streams}"
    (tmp_path / "tokens/run1.tsv").unlink()
    text = f"is a file of no kind that is read; name a folder of {WANTED}, or {RECORDED}"
    assert failure(tmp_path / "notes/readme.txt") == f"{tmp_path / 'notes/readme.txt'}: {text}"
    assert failure(tmp_path) == f"{tmp_path / 'seq/std_cam'}: holds no image; looked for {WANTED}"
    assert failure(tmp_path, format="cold") == "format 'cold' is not known; choose one of auto, sequences, places"


def test_too_deep(tmp_path: Path) -> None:
    make(tmp_path, "1/2/3/4/5/6/std_cam/t1.000000.jpeg", "a/2/3/4/5/6/7/std_cam/t1.000000.jpeg")
    assert [sequence.name for sequence in find_sequences([tmp_path])] == ["6"]


def test_images_that_are_not_read_are_counted_once_a_folder(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path / "phone", *(f"{i}.jpg" for i in range(8)), *(f"{i}.HEIC" for i in range(8, 12)), "a.gif")
    make(tmp_path / "cold/std_cam", "t1.5.jpeg", "t2.5.avif")
    make(tmp_path / "raw", "1.dng", "2.dng")
    make(tmp_path / "tum/rgb", "1.png", "2.jp2")
    make(tmp_path / "tum/depth", "1.png")
    remedy = "convert them to JPEG or PNG"
    find_sequences([tmp_path])
    assert caplog.messages == [
        f"{tmp_path / 'raw'}: not read: 2 *.dng; {remedy}",
        f"{tmp_path / 'cold/std_cam'}: not read: 1 *.avif; {remedy}",
        f"{tmp_path / 'phone'}: not read: 4 *.HEIC, 1 *.gif; {remedy}",
        f"{tmp_path / 'tum/rgb'}: not read: 1 *.jp2; {remedy}",
    ]
    caplog.clear()
    make(tmp_path / "home", "kitchen/1.jpg", "kitchen/2.heic", "office/1.jpg")
    find_sequences([tmp_path / "home"])
    assert caplog.messages[1:] == [f"{tmp_path / 'home/kitchen'}: not read: 1 *.heic; {remedy}"]


def test_labels_that_are_not_read_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path / "run", "1.png", "labels.csv", "Places_2.json", "notes.txt", "groundtruth.txt")
    find_sequences([tmp_path / "run"])
    said = f"{tmp_path / 'run'}: Places_2.json, labels.csv not read; labels are in places.lst or run.labels"
    assert caplog.messages == [said]
    caplog.clear()
    labelled(tmp_path / "run/places.lst", "1.png hall\n")
    find_sequences([tmp_path / "run"])
    assert caplog.messages == []


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="there names are text")
def test_names_that_are_no_text_are_skipped_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path / "run", "1.jpg", "a\nb.jpg", "a\tb.jpg", "e\u0301 \u200d.jpg")
    for name in (b"3\xff.jpg", b"4\xff.jpg"):
        (tmp_path / os.fsdecode(b"run/" + name)).touch()
    (sequence,) = find_sequences([tmp_path / "run"])
    assert [frame.name for frame in sequence.frames] == ["1.jpg", "e\u0301 \u200d.jpg"]
    assert caplog.messages == [
        rf"{tmp_path / 'run'}: not read: 4 images whose names are no text, as b'3\xff.jpg'; rename them"
    ]
    make(tmp_path, "two\nlines/1.jpg")
    assert failure(tmp_path / "two\nlines").endswith("its name is not UTF-8, or holds a tab or a line end; rename it")
