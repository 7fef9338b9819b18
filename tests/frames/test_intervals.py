"""NAME.labels: which frames of a recording get which place, where the file is looked for, and what is wrong in it."""

import logging
import re
import tempfile
from itertools import pairwise
from pathlib import Path

import pytest
from helpers.recordings import START, STEP, pictures, raw, stream, write_bag, write_video
from hypothesis import given, strategies as st

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.intervals import Interval, Intervals, read_intervals

LABELS = """\ufeff# run through the house
0.5 1   kitchen   # by the window

1\t1.2 hall
0 0.2 hall\r
1.55 7e1 office
"""


def places(path: Path, labels: Path | None = None, every: int = 1, clock: str = "auto") -> list[str]:
    options = SourceOptions(labels=labels, every=every, label_clock=clock)
    (sequence,) = find_sequences([path], options=options)
    return [frame.place for frame in sequence.frames]


def failure(text: str, tmp_path: Path) -> str:
    path = tmp_path / "bad.labels"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SourceError) as error:
        read_intervals(path)
    return str(error.value).removeprefix(f"{path}:")


def test_an_interval_holds_its_start_and_not_its_end(tmp_path: Path) -> None:
    path = write_video(tmp_path / "run.mp4")
    (tmp_path / "labels").write_text(LABELS, encoding="utf-8")
    expected = ["hall"] * 2 + [""] * 3 + ["kitchen"] * 5 + ["hall"] * 2 + [""] * 4 + ["office"] * 4
    assert places(path, tmp_path / "labels") == expected
    assert places(path, tmp_path / "labels", every=3) == expected[::3]
    assert places(path) == [""] * 20


@given(
    cuts=st.lists(st.integers(0, 40), min_size=2, max_size=12, unique=True).map(sorted),
    times=st.lists(st.integers(0, 40), max_size=20).map(sorted),
    named=st.lists(st.sampled_from(["", "hall", "office"]), min_size=11, max_size=11),
)
def test_places_against_a_plain_search(cuts: list[int], times: list[int], named: list[str]) -> None:
    some = [Interval(start, end, place, 1) for start, end, place in zip(cuts, cuts[1:], named, strict=False) if place]
    found = Intervals(Path("x"), tuple(some)).places([0.0, *map(float, times)])
    plain = [next((one.place for one in some if one.start <= t < one.end), "") for t in [0, *times]]
    assert found == plain


def test_an_interval_that_ends_at_the_first_frame_is_counted_from_it() -> None:
    """It does not hold its end, and so no frame at all otherwise."""
    one = Intervals(Path("x"), (Interval(0, 10, "hall", 1),))
    assert one.places([10.0, 15.0, 20.0]) == ["hall", "hall", ""]
    assert one.places([9.0, 10.0]) == ["hall", ""]


def test_seconds_of_a_bag_are_its_stamps_or_those_since_its_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_bag(tmp_path / "run", {"/c": stream()})
    labels = tmp_path / "run.labels"
    expected = [""] * 5 + ["hall"] * 5 + ["office"] * 10
    labels.write_text("0.45 0.95 hall\n0.95 100 office\n")
    caplog.set_level(logging.INFO)
    assert places(path) == expected
    assert f"{labels}: its seconds are counted from the first frame" in caplog.messages
    caplog.clear()
    zero = START // 10**9
    labels.write_text(f"{zero}.45 {zero}.95 hall\n{zero}.95 {zero + 100} office\n")
    assert places(path) == expected
    assert caplog.messages == []
    labels.write_text(f"{zero + 50} {zero + 51} hall\n")
    assert places(path) == [""] * 20
    assert caplog.messages == [f"{labels}: labels none of the 20 frames"]


def test_of_stamps_that_are_not_since_1970_it_is_said_how_labels_were_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A simulation starts at 12.3 s: both readings of the labels are possible, and the wrong one shifts them."""
    shifted = [raw(picture, "bgr8", 123 * 10**8 + i * STEP) for i, picture in enumerate(pictures())]
    path = write_bag(tmp_path / "run", {"/c": shifted})
    labels = tmp_path / "run.labels"
    labels.write_text("0 1 hall\n1 30 office\n")
    by_stamps, from_start = ["office"] * 20, ["hall"] * 10 + ["office"] * 10
    caplog.set_level(logging.INFO)
    assert places(path) == by_stamps
    said = f"{labels}: its seconds are the frames', of which the first is 12.3; if not, say --label-clock start"
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [("WARNING", said)]
    caplog.clear()
    assert places(path, clock="start") == from_start
    assert places(path, clock="stamps") == by_stamps
    assert caplog.messages == []
    labels.write_text("0 1 hall\n1 12 office\n")
    assert places(path) == from_start
    assert caplog.messages == [
        f"{labels}: its seconds are counted from the first frame; if not, say --label-clock stamps"
    ]
    labels.write_text("12.3 100 hall\n")
    caplog.clear()
    assert places(path) == ["hall"] * 20
    assert caplog.records[0].levelname == "WARNING"
    with pytest.raises(SourceError, match="label clock 'sun' is not known; choose one of auto, stamps, start"):
        SourceOptions(label_clock="sun")


def test_where_labels_are_looked_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = pictures(4)
    for name in ("a/run.mp4", "b/run.mp4", "a/other.mp4"):
        write_video(tmp_path / name, frames=short)
    (tmp_path / "a/run.labels").write_text("0 1 hall\n")
    given = tmp_path / "given"
    given.mkdir()
    (given / "b-run.labels").write_text("0 1 office\n")
    beside = {sequence.name: sequence.frames[0].place for sequence in find_sequences([tmp_path])}
    assert beside == {"other": "", "a-run": "hall", "b-run": ""}
    caplog.clear()
    named = find_sequences([tmp_path], options=SourceOptions(labels=given))
    assert {sequence.name: sequence.frames[0].place for sequence in named} == {
        "other": "",
        "a-run": "",
        "b-run": "office",
    }
    assert f"{tmp_path / 'a/other.mp4'}: no {given / 'other.labels'}; its frames have no label" in caplog.messages
    one = tmp_path / "a/run.labels"
    with pytest.raises(SourceError) as error:
        find_sequences([tmp_path], options=SourceOptions(labels=one))
    assert str(error.value) == f"{one}: is one file for several recordings; name a folder that holds other.labels"
    assert places(tmp_path / "b/run.mp4", one) == ["hall"] * 4
    monkeypatch.chdir(tmp_path / "a")
    assert places(Path("run.mp4")) == ["hall"] * 4
    with pytest.raises(SourceError, match="nowhere: no such file"):
        SourceOptions(labels=tmp_path / "nowhere")


def test_labels_and_topics_that_are_for_no_source_are_told_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run/a.png").touch()
    labels = tmp_path / "x.labels"
    labels.touch()
    find_sequences([tmp_path / "run"], options=SourceOptions(labels=labels, topic="/c"))
    assert f"{labels}: labels by times, and {tmp_path / 'run'} has none; give --rate HZ" in caplog.messages
    (tmp_path / "run/places.lst").write_text("a.png hall\n")
    find_sequences([tmp_path / "run"], options=SourceOptions(labels=labels))
    assert f"{labels}: every source has labels of its own; not read" in caplog.messages
    assert "topic /c: no source is a bag" in caplog.messages


def test_places_that_differ_only_in_case_are_twins_of_those_of_images(tmp_path: Path) -> None:
    write_video(tmp_path / "run.mp4", frames=pictures(3))
    (tmp_path / "run.labels").write_text("0 1 Hall\n")
    (tmp_path / "seq").mkdir()
    (tmp_path / "seq/a.png").touch()
    (tmp_path / "seq/places.lst").write_text("a.png hall\n")
    with pytest.raises(SourceError, match=r"place 'hall' differs only in case from 'Hall' \(.*run\.labels:1\)"):
        find_sequences([tmp_path])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1 a\n1 2\n", "2: '1 2' is not 'start end place'; a place's name holds no white space"),
        ("0 1 living room\n", "1: '0 1 living room' is not 'start end place'; a place's name holds no white space"),
        ("0:30 1:00 a\n", "1: '0:30' is not a number of seconds; mend it"),
        ("0 nan a\n", "1: 'nan' is not a number of seconds; mend it"),
        ("inf 1 a\n", "1: 'inf' is not a number of seconds; mend it"),
        ("\n2 1 a\n", "2: the interval 2 to 1 ends before it starts; mend it"),
        ("1 1 a\n", "1: the interval 1 to 1 ends before it starts; mend it"),
        ("0 5 a\n7 9 b\n4.5 6 b\n", "3: 4.5 to 6 overlaps 0 to 5 of line 1; change one of them"),
        ("0 5 a\n0 5 a\n", "2: 0 to 5 overlaps 0 to 5 of line 1; change one of them"),
        ("0 1 a/b\n", "1: place 'a/b' holds a /; rename it"),
        ("0 1 word\n", "1: place 'word' is the name of a column in placerec's files; rename it"),
    ],
)
def test_what_is_wrong_in_a_file(tmp_path: Path, text: str, message: str) -> None:
    assert failure(text, tmp_path) == message


@given(st.text(alphabet="0123456789.-e# \tab/\r\n\x00\ufeff", max_size=60))
def test_any_text_is_read_or_refused_by_file_and_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "x.labels")
        path.write_text(text, encoding="utf-8", newline="")
        found: tuple[Interval, ...] = ()
        said = f"{path}:1: "
        try:
            found = read_intervals(path).intervals
        except SourceError as error:
            said = str(error)
        assert re.match(rf"{re.escape(str(path))}:\d+: [^\n]*$", said)
        assert all(before.end <= one.start for before, one in pairwise(found))


def test_an_empty_file_labels_nothing(tmp_path: Path) -> None:
    write_video(tmp_path / "run.mp4", frames=pictures(3))
    (tmp_path / "run.labels").write_text("# nothing yet\n")
    assert places(tmp_path / "run.mp4") == [""] * 3
    (tmp_path / "run.labels").write_bytes(b"0 1 k\xfcche\n")
    with pytest.raises(SourceError, match=r"run\.labels:1: byte 0xfc is not UTF-8"):
        places(tmp_path / "run.mp4")
