"""`-`: a list of images on standard input."""

import io
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from placerec.errors import SourceError
from placerec.frames import Sequence, SourceOptions, find_sequences

Listed = Callable[..., Sequence]


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> Listed:
    def listed(text: str | bytes, every: int = 1) -> Sequence:
        data = text if isinstance(text, bytes) else text.encode()
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(data)))
        (sequence,) = find_sequences(["-"], options=SourceOptions(every=every))
        return sequence

    return listed


def test_paths_alone(given: Listed) -> None:
    sequence = given("b/2.png\n\nb/1.png\r\na/1.png")
    assert (sequence.name, sequence.recording) == ("stdin", None)
    assert [frame.name for frame in sequence.frames] == ["b/2.png", "b/1.png", "a/1.png"]
    assert [frame.path for frame in sequence.frames] == [Path("b/2.png"), Path("b/1.png"), Path("a/1.png")]
    assert all(math.isnan(frame.time) and not frame.place for frame in sequence.frames)
    assert [frame.name for frame in given("1\n2\n3\n4\n5\n", every=2).frames] == ["1", "3", "5"]


def test_seconds_and_places(given: Listed) -> None:
    sequence = given("a.png\t2.5\thall\nb.png\t-1e1\nc d.png\t2\tkitchen\n")
    rows = [(frame.name, frame.time, frame.place) for frame in sequence.frames]
    assert rows == [("b.png", -10, ""), ("c d.png", 2, "kitchen"), ("a.png", 2.5, "hall")]
    untimed = given("a.png\t\thall\nb.png\n")
    assert [(math.isnan(frame.time), frame.place) for frame in untimed.frames] == [(True, "hall"), (True, "")]


def test_a_name_that_is_not_utf8_is_refused_before_the_work(given: Listed) -> None:
    """No file of ours could name it."""
    with pytest.raises(SourceError) as error:
        given(b"a.png\nk\xfcche.png\n")
    assert str(error.value) == r"<stdin>:2: the name b'k\xfcche.png' is not UTF-8; rename the file"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "<stdin>: names no image; give the path of an image a line"),
        ("a\nb\na\n", "<stdin>:3: a is named in line 1 already; remove one"),
        ("a\t1\tk\tx\n", r"<stdin>:1: 'a\t1\tk\tx' is not 'path [TAB seconds [TAB place]]'"),
        ("\t1\n", r"<stdin>:1: '\t1' is not 'path [TAB seconds [TAB place]]'"),
        ("a\0b\n", r"<stdin>:1: 'a\x00b' is not 'path [TAB seconds [TAB place]]'"),
        ("a\tsoon\n", "<stdin>:1: 'soon' is not a number of seconds; mend it"),
        ("a\tnan\n", "<stdin>:1: 'nan' is not a number of seconds; mend it"),
        ("a\t1\nb\n", "<stdin>:2: some lines have seconds and others do not; give all or none"),
        ("a\t1\tliving room\n", "<stdin>:1: place 'living room' holds white space; rename it"),
        (
            "a\t1\tHall\nb\t2\thall\n",
            "<stdin>:2: place 'hall' differs only in case from 'Hall' (<stdin>:1); rename one",
        ),
    ],
)
def test_lines_that_are_wrong(given: Listed, text: str, message: str) -> None:
    with pytest.raises(SourceError) as error:
        given(text)
    assert str(error.value) == message


def test_it_can_be_named_once_and_must_be_open(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SourceError, match="-: is given twice"):
        find_sequences(["-", "-"])
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(SourceError, match="reads standard input, and that is closed"):
        find_sequences(["-"])


def test_a_rate_gives_times_and_a_part_is_cut_by_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def listed(text: str, **options: float) -> list[tuple[str, float]]:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        (sequence,) = find_sequences(["-"], options=SourceOptions(**options))  # type: ignore[arg-type]
        return [(frame.name, frame.time) for frame in sequence.frames]

    assert listed("b\na\nc\n", rate=4) == [("b", 0), ("a", 0.25), ("c", 0.5)]
    assert listed("b\na\nc\n", rate=4, begin=0.25) == [("a", 0.25), ("c", 0.5)]
    assert listed("b\t7\na\t9\n", rate=4, end=1) == [("b", 7)]
    with pytest.raises(SourceError, match="<stdin>: its frames have no times, by which --from and --to go"):
        listed("b\na\n", end=1)
