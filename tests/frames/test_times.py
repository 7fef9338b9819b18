"""Times of images: from names, from a rate; and parts of a sequence by them."""

import math
from pathlib import Path

import numpy as np
import pytest
from helpers.recordings import START, STEP, find_one, grays, pictures, read_images, stream, write_bag, write_video

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.times import times_at_rate


def times(folder: Path, names: list[str], **options: float) -> list[float]:
    folder.mkdir()
    for name in names:
        (folder / name).touch()
    (sequence,) = find_sequences([folder], options=SourceOptions(**options))  # type: ignore[arg-type]
    return [frame.time for frame in sequence.frames]


@pytest.mark.parametrize("unit", [1000, 10**6, 10**9])
def test_names_that_are_numbers_since_1970(tmp_path: Path, unit: int) -> None:
    stamps = [1305031102.25, 1305031102.5, 1305031103.75]
    assert times(tmp_path / "run", [f"{round(4 * t) * unit // 4}.png" for t in reversed(stamps)]) == stamps


def test_a_list_in_the_folder(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / "run" / name).touch()
    # What a table of that name holds is not known.
    (tmp_path / "run/data.csv").write_text("1.png,kitchen\n")
    (tmp_path / "run.txt").write_text("notes\n")
    (sequence,) = find_sequences([tmp_path / "run"])
    assert all(math.isnan(frame.time) for frame in sequence.frames)
    (tmp_path / "run/times.txt").write_text("# timestamp [ms]\n\n500\n250\n750.5\n")
    (sequence,) = find_sequences([tmp_path / "run"])
    assert [(frame.name, frame.time) for frame in sequence.frames] == [
        ("b.png", 0.25),
        ("a.png", 0.5),
        ("c.png", 0.7505),
    ]


def test_names_that_are_seconds(tmp_path: Path) -> None:
    assert times(tmp_path / "a", ["1305031103.5.png", "1305031102.25.png"]) == [1305031102.25, 1305031103.5]
    assert times(tmp_path / "b", ["t12.5.jpg", "t9.25.jpg"]) == [9.25, 12.5]


@pytest.mark.parametrize(
    "names", [["1305031102250000.png", "1.png"], ["20230101120000.png"], ["000123.png"], ["0000000000001.png"]]
)
def test_other_names_are_no_times(tmp_path: Path, names: list[str]) -> None:
    assert all(map(math.isnan, times(tmp_path / "run", names)))


def test_photographs_of_a_telephone_in_folders_of_places_are_no_runs(tmp_path: Path) -> None:
    for place in ("kitchen", "office"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "1699999999999.jpg").touch()
    assert [found.frames[0].place for found in find_sequences([tmp_path])] == ["kitchen", "office"]


def test_a_rate_gives_times(tmp_path: Path) -> None:
    assert times(tmp_path / "a", ["frame_000123.png", "frame_000124.png", "frame_000127.png"], rate=2) == [0, 0.5, 2]
    assert times(tmp_path / "b", ["a.png", "b.png", "c3.png"], rate=4) == [0, 0.25, 0.5]
    assert times(tmp_path / "c", ["t9.25.jpg", "t9.5.jpg"], rate=100) == [9.25, 9.5]
    assert times_at_rate(["a2.png", "b1.png"], 1).tolist() == [0, 1]
    assert times_at_rate([], 1).tolist() == []
    for rate in (0, -1, math.inf, math.nan):
        with pytest.raises(SourceError, match="is not possible; give one above 0"):
            SourceOptions(rate=rate)


def test_labels_of_images_without_times_ask_for_a_rate(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "run").mkdir()
    for i in range(6):
        (tmp_path / f"run/{i}.png").touch()
    labels = tmp_path / "run.labels"
    labels.write_text("0 1 hall\n1 2 office\n")
    (sequence,) = find_sequences([tmp_path / "run"])
    assert [frame.place for frame in sequence.frames] == [""] * 6
    assert caplog.messages == [f"{labels}: labels by times, and {tmp_path / 'run'} has none; give --rate HZ"]
    (sequence,) = find_sequences([tmp_path / "run"], options=SourceOptions(rate=2, every=2))
    assert [(frame.name, frame.place) for frame in sequence.frames] == [
        ("0.png", "hall"),
        ("2.png", "office"),
        ("4.png", ""),
    ]


@pytest.mark.parametrize("kind", ["video", "bag", "bag in disorder"])
def test_a_part_of_a_recording_has_the_frames_of_the_whole(tmp_path: Path, kind: str) -> None:
    messages = stream()
    if kind == "video":
        path = write_video(tmp_path / "run.mp4")
    else:
        if kind != "bag":
            for i in range(0, 20, 4):
                messages[i].stored, messages[i + 1].stored = messages[i + 1].stored, messages[i].stored
        path = write_bag(tmp_path / "run", {"/c": messages})
    (tmp_path / "run.labels").write_text("0 0.8 hall\n0.8 2 office\n")
    whole = find_one(path)
    images = read_images(whole)
    for every in (1, 2, 3):
        for begin, end, chosen in ((0.5, 1.2, slice(5, 12)), (0.45, None, slice(5, None)), (0.0, 1.5, slice(0, 15))):
            part = find_one(path, begin=begin, end=end, every=every)
            assert part.frames == whole.frames[chosen][::every]
            assert all(map(np.array_equal, read_images(part), images[chosen][::every]))
            assert all(map(np.array_equal, read_images(part, 2), images[chosen][::every][2:]))
    if kind != "video":
        assert all(map(np.array_equal, images, grays(pictures())))
        assert [frame.time for frame in whole.frames] == [(START + i * STEP) / 1e9 for i in range(20)]


def test_a_part_of_images(tmp_path: Path) -> None:
    assert times(tmp_path / "a", [f"t1{i}.5.jpg" for i in range(5)], begin=1, end=3) == [11.5, 12.5]
    with pytest.raises(SourceError) as error:
        times(tmp_path / "b", ["1.png"], begin=1)
    where = tmp_path / "b"
    assert str(error.value) == f"{where}: its frames have no times, by which --from and --to go; give --rate HZ"
    assert times(tmp_path / "c", [f"{i}.png" for i in range(5)], begin=1, end=2, rate=2) == [1, 1.5]
    # Differences of seconds since 1970 are off in the seventh digit.
    stamps = [f"1305031102.{i}00000" for i in range(1, 10)]
    assert times(tmp_path / "d", [f"{stamp}.png" for stamp in stamps], begin=0.3, end=0.6) == [*map(float, stamps[3:6])]


def test_a_camera_has_no_parts() -> None:
    for options in (SourceOptions(begin=1), SourceOptions(end=1)):
        with pytest.raises(SourceError, match="not known before; leave out --from and --to"):
            find_sequences(["camera:0"], options=options, endless=True)


def test_a_part_without_frames(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name, count in (("a", 2), ("b", 9)):
        (tmp_path / name).mkdir()
        for i in range(count):
            (tmp_path / name / f"t1{i}.5.jpg").touch()
    (sequence,) = find_sequences([tmp_path], options=SourceOptions(begin=5))
    assert (sequence.name, len(sequence.frames)) == ("b", 4)
    assert f"{tmp_path / 'a'}: has no frame from second 5; left out" in caplog.messages
    with pytest.raises(SourceError) as error:
        find_sequences([tmp_path / "a"], options=SourceOptions(begin=5, end=7))
    assert str(error.value) == (
        f"{tmp_path / 'a'}: has no frame from second 5 to 7; choose another part (--from, --to)"
    )
    for begin, end in ((-1, None), (3, 3), (4, 2), (math.nan, None)):
        with pytest.raises(SourceError, match="is no part of a run; give 0 <= from < to"):
            SourceOptions(begin=begin, end=end)
