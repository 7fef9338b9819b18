"""Runs of robots as they are published: a folder a camera, times in lists; what is read of them, and its times."""

import logging
from pathlib import Path

import pytest

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences

STAMPS = [1305031102.175 + i * 0.5 for i in range(12)]
NUMBERED = [f"{i:06d}.png" for i in range(12)]
STEPS = [i * 0.5 for i in range(12)]


def lay(folder: Path, names: list[str]) -> None:
    """Empty files: nothing here may open an image."""
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).touch()


def one(source: Path, **options: object) -> Sequence:
    (sequence,) = find_sequences([source], options=SourceOptions(**options))  # type: ignore[arg-type]
    assert {frame.place for frame in sequence.frames} == {""}
    return sequence


def steps(sequence: Sequence) -> list[float]:
    return [round(frame.time - sequence.frames[0].time, 6) for frame in sequence.frames]


def cameras(sequence: Sequence) -> set[Path]:
    return {frame.path.parent for frame in sequence.frames}


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    run = tmp_path / "tum/fr1"
    for camera in ("rgb", "depth"):
        lay(run / camera, [f"{t:.6f}.png" for t in STAMPS])
        lines = [f"{t:.6f} {camera}/{t:.6f}.png\n" for t in STAMPS]
        (run / f"{camera}.txt").write_text("# color images\n# timestamp filename\n" + "".join(lines))
    return run


@pytest.fixture
def kitti(tmp_path: Path) -> Path:
    run = tmp_path / "kitti/00"
    for camera in range(4):
        lay(run / f"image_{camera}", NUMBERED)
    (run / "times.txt").write_text("".join(f"{t:e}\n" for t in STEPS))
    return run


@pytest.fixture
def euroc(tmp_path: Path) -> Path:
    run = tmp_path / "euroc/MH_01"
    for camera in ("cam0", "cam1"):
        names = [f"{round(t * 1000)}000000.png" for t in STAMPS]
        lay(run / f"mav0/{camera}/data", names)
        lines = [f"{name[:-4]},{name}\r\n" for name in names]
        (run / f"mav0/{camera}/data.csv").write_text("#timestamp [ns],filename\n" + "".join(lines))
    return run


def test_tum_rgb_d(tum: Path) -> None:
    for source in (tum, tum.parent):
        sequence = one(source)
        assert (sequence.name, sequence.source, cameras(sequence)) == ("fr1", tum, {tum / "rgb"})
        assert [frame.time for frame in sequence.frames] == pytest.approx(STAMPS)
    # The list says when, whatever images are called.
    lay(tum.parent / "fr2/rgb", NUMBERED)
    lines = [f"{i / 4} rgb/{name}\n" for i, name in enumerate(reversed(NUMBERED))]
    (tum.parent / "fr2/rgb.txt").write_text("".join(lines))
    assert [frame.name for frame in one(tum.parent / "fr2").frames] == NUMBERED[::-1]
    assert [frame.name for frame in one(tum.parent / "fr2/rgb").frames] == NUMBERED[::-1]


def test_kitti(kitti: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    sequence = one(kitti)
    assert (sequence.name, cameras(sequence), steps(sequence)) == ("00", {kitti / "image_2"}, STEPS)
    named = "image_0, image_1, image_2, image_3"
    assert f"{kitti}: of its cameras {named}, image_2 is read; for another say --camera" in caplog.messages
    caplog.clear()
    assert cameras(one(kitti, camera="image_0")) == {kitti / "image_0"}
    assert not any("camera" in message for message in caplog.messages)
    with pytest.raises(SourceError) as error:
        one(kitti, camera="image_7")
    assert str(error.value) == f"{kitti}: has no camera image_7; its cameras are: {named}"
    # Frames that were taken out are known by their numbers.
    for name in NUMBERED[:3] + NUMBERED[5:7]:
        (kitti / "image_2" / name).unlink()
    assert [frame.time for frame in one(kitti).frames] == [1.5, 2.0, 3.5, 4.0, 4.5, 5.0, 5.5]
    (kitti / "times.txt").write_text("0\n1\n")
    with pytest.raises(SourceError, match=r"times\.txt: has 2 times for 7 images; mend it, or remove it"):
        one(kitti)


def test_kitti_raw(tmp_path: Path) -> None:
    run = tmp_path / "2011_09_26_drive_0001_sync"
    for camera in ("image_00", "image_02"):
        lay(run / camera / "data", NUMBERED)
        lines = [f"2011-09-26 13:02:{25 + i // 2}.{i % 2 * 5}00000001\n" for i in range(12)]
        (run / camera / "timestamps.txt").write_text("".join(lines))
    sequence = one(tmp_path)
    assert (sequence.name, cameras(sequence), steps(sequence)) == (run.name, {run / "image_02/data"}, STEPS)
    assert sequence.frames[0].time == pytest.approx(1317042145)
    (run / "image_02/timestamps.txt").write_text("2011-13-26 13:02:25.5\n" * 12)
    with pytest.raises(SourceError, match=r"timestamps\.txt:1: '2011-13-26 13:02:25\.5' is no date; mend it"):
        one(tmp_path)


def test_euroc(euroc: Path) -> None:
    for source in (euroc, euroc.parent, euroc / "mav0"):
        sequence = one(source)
        assert (sequence.name, cameras(sequence)) == ("MH_01", {euroc / "mav0/cam0/data"})
        assert steps(sequence) == STEPS
    assert cameras(one(euroc, camera="cam1")) == {euroc / "mav0/cam1/data"}
    assert one(euroc / "mav0/cam1").name == "cam1"
    (euroc / "mav0/cam0/data.csv").write_text("#timestamp [ns],filename\n1305031102175000000,1305031102175000000.png\n")
    with pytest.raises(SourceError, match=r"data\.csv: gives 11 images no time \(first: 1305031102675000000\.png\)"):
        one(euroc)
    (euroc / "mav0/cam0/data.csv").write_text("#timestamp [ns],filename\nnow,1.png\n1,2.png\nsoon,3.png\n")
    with pytest.raises(SourceError, match=r"data\.csv:4: 'soon' is not a number of seconds; mend it"):
        one(euroc)


def test_nclt_and_robotcar(tmp_path: Path) -> None:
    micro = [f"{round(t * 10**6)}.tiff" for t in STAMPS]
    for number in range(6):
        lay(tmp_path / f"nclt/2012-01-08/lb3/Cam{number}", micro)
    sequence = one(tmp_path / "nclt")
    assert (sequence.name, cameras(sequence)) == ("2012-01-08", {tmp_path / "nclt/2012-01-08/lb3/Cam5"})
    assert [frame.time for frame in sequence.frames] == pytest.approx(STAMPS)
    for camera in ("mono_left", "mono_right", "stereo/left", "stereo/centre", "stereo/right"):
        lay(tmp_path / "car/2014-05-06" / camera, [f"{name[:-5]}.png" for name in micro])
    sequence = one(tmp_path / "car")
    assert (sequence.name, cameras(sequence)) == ("2014-05-06", {tmp_path / "car/2014-05-06/stereo/left"})
    assert cameras(one(tmp_path / "car", camera="mono_left")) == {tmp_path / "car/2014-05-06/mono_left"}


def test_seven_scenes(tmp_path: Path) -> None:
    for number in (1, 2):
        names = [f"frame-{i:06d}.{kind}.png" for i in range(5) for kind in ("color", "depth")]
        lay(tmp_path / f"chess/seq-0{number}", [*names, "frame-000000.pose.txt"])
    found = find_sequences([tmp_path / "chess"], options=SourceOptions(rate=30))
    assert [sequence.name for sequence in found] == ["seq-01", "seq-02"]
    for sequence in found:
        assert [frame.name for frame in sequence.frames] == [f"frame-{i:06d}.color.png" for i in range(5)]
        assert [frame.place for frame in sequence.frames] == [""] * 5
        assert [frame.time for frame in sequence.frames] == [i / 30 for i in range(5)]


def test_sensor_and_run_folders_are_no_places(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("a/seq-01", "a/seq-02", "b/kitchen", "c/run1", "c/run2", "d/kitchen/@eaDir", "d/office/@eaDir"):
        lay(tmp_path / name, ["1.png"])
    for name in ("d/kitchen/1.png", "d/office/1.png"):
        (tmp_path / name).touch()
    for name in "abc":
        assert {frame.place for found in find_sequences([tmp_path / name]) for frame in found.frames} == {""}
    assert caplog.messages == []
    # What a network drive leaves in every folder is not looked at.
    assert [found.frames[0].place for found in find_sequences([tmp_path / "d"])] == ["kitchen", "office"]
    asked = find_sequences([tmp_path / "b"], options=SourceOptions("places"))
    assert [found.frames[0].place for found in asked] == ["kitchen"]


def test_folders_with_lists_of_times_are_no_places(tmp_path: Path) -> None:
    for name in ("monday", "tuesday"):
        lay(tmp_path / name, NUMBERED)
        (tmp_path / name / "times.txt").write_text("".join(f"{t}\n" for t in STEPS))
    found = find_sequences([tmp_path])
    assert [(sequence.name, steps(sequence)) for sequence in found] == [("monday", STEPS), ("tuesday", STEPS)]
    assert {frame.place for sequence in found for frame in sequence.frames} == {""}


def test_one_camera_in_all_names_is_no_run_of_several(tmp_path: Path) -> None:
    for place in ("kitchen", "office"):
        lay(tmp_path / place, [f"{i}.color.png" for i in range(3)])
    found = find_sequences([tmp_path])
    assert [{frame.place for frame in sequence.frames} for sequence in found] == [{"kitchen"}, {"office"}]


def test_depth_is_never_read_unless_it_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lay(tmp_path / "run/depth", ["1.png"])
    with pytest.raises(SourceError, match="no sequence there"):
        find_sequences([tmp_path / "run"])
    assert caplog.messages == [f"{tmp_path / 'run/depth'}: depth is no picture; not read"]
    assert len(one(tmp_path / "run/depth").frames) == 1


def test_a_folder_called_as_cameras_are_may_be_a_place_among_others(tmp_path: Path) -> None:
    for name in ("left", "kitchen"):
        lay(tmp_path / "home" / name, ["1.png"])
    assert [found.frames[0].place for found in find_sequences([tmp_path / "home"])] == ["kitchen", "left"]
    lay(tmp_path / "alone/left", ["1.png"])
    assert one(tmp_path / "alone").name == "alone"


@pytest.mark.parametrize("splits", [("train", "val"), ("train", "val", "test")])
def test_folders_of_places_in_a_folder_a_split(tmp_path: Path, splits: tuple[str, ...]) -> None:
    for split in splits:
        for place in ("kitchen", "office"):
            lay(tmp_path / split / place, ["1.png", "2.png"])
    for format in ("auto", "places"):
        found = find_sequences([tmp_path], options=SourceOptions(format))
        names = [f"{split}-{place}" for split in sorted(splits) for place in ("kitchen", "office")]
        assert [sequence.name for sequence in found] == names
        assert [{frame.place for frame in sequence.frames} for sequence in found] == [{"kitchen"}, {"office"}] * len(
            splits
        )
    sequences = find_sequences([tmp_path], options=SourceOptions("sequences"))
    assert {frame.place for sequence in sequences for frame in sequence.frames} == {""}


def test_a_camera_where_there_is_no_choice_is_told_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lay(tmp_path / "run", ["1.png"])
    one(tmp_path / "run", camera="left")
    assert "camera left: no source is a run of several cameras" in caplog.messages


def test_labels_of_a_run_are_intervals_by_its_times(tum: Path, kitti: Path) -> None:
    (kitti.parent / "00.labels").write_text("0 2 hall\n2 4.5 office\n")
    (sequence,) = find_sequences([kitti])
    assert [frame.place for frame in sequence.frames] == ["hall"] * 4 + ["office"] * 5 + [""] * 3
    labels = kitti.parent / "others.labels"
    labels.write_text("0 3 hall\n")
    (sequence,) = find_sequences([tum], options=SourceOptions(labels=labels))
    assert [frame.place for frame in sequence.frames] == ["hall"] * 6 + [""] * 6
    (tum / "places.lst").write_text(f"{STAMPS[0]:.6f}.png kitchen\n")
    (sequence,) = find_sequences([tum], options=SourceOptions(labels=kitti.parent))
    assert [frame.place for frame in sequence.frames] == ["kitchen"] + [""] * 11
