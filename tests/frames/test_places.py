"""places.lst and the names of places."""

from pathlib import Path

import pytest

from placerec.errors import SourceError
from placerec.frames.places import check_place, check_twins, read_places


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "places.lst"


@pytest.mark.parametrize("name", ["CR-B", "2PO1-A", "living_room", "Küche", "厨房", "a.b", "Frame", "words", "-1"])
def test_names_that_can_be_places(name: str) -> None:
    assert check_place(name) is None


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is empty"),
        (".hidden", "starts with a dot"),
        ("..", "starts with a dot"),
        ("a/b", "holds a /"),
        ("a\\b", "holds a \\"),
        ("a\tb", "holds white space"),
        ("living room", "holds white space"),
        ("a\u00a0b", "holds white space"),
        ("a\nb", "holds white space"),
        ("a\x07b", "holds the control character U+0007"),
        ("a\u200bb", "holds the control character U+200B"),
        *(
            (column, "is the name of a column in placerec's files")
            for column in ("frame", "time", "place", "word", "distance", "selected", "best", "unknown")
        ),
    ],
)
def test_names_that_cannot(name: str, reason: str) -> None:
    assert check_place(name) == reason


def test_twins_that_differ_in_case() -> None:
    check_twins([("Kitchen", "a"), ("Kitchen", "b"), ("kitchen2", "c")])
    with pytest.raises(SourceError) as error:
        check_twins([("Kitchen", "a:1"), ("Hall", "a:2"), ("kitchen", "b:7")])
    assert str(error.value) == "b:7: place 'kitchen' differs only in case from 'Kitchen' (a:1); rename one"
    with pytest.raises(SourceError, match="differs only in case"):
        check_twins([("K\u00fcche", "a:1"), ("Ku\u0308che", "a:2")])


def test_mark_line_ends_blank_lines_and_spaces(path: Path) -> None:
    path.write_bytes("\ufeff\r\nb.jpeg  KT \r\n \r\nmy image.jpeg\tCR\r\n\na.jpeg KT\na.jpeg KT".encode())
    labels = read_places(path)
    assert labels.places == {"b.jpeg": "KT", "my image.jpeg": "CR", "a.jpeg": "KT"}
    assert labels.lines == {"b.jpeg": 2, "my image.jpeg": 4, "a.jpeg": 6}


def test_an_empty_list(path: Path) -> None:
    path.write_bytes(b"")
    assert read_places(path).places == {}


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (b"a.jpeg KT\nb.jpeg\n", 2, "no label in 'b.jpeg'; a line is '<file name> <label>'"),
        (b"a.jpeg KT\n\nb.jpeg  \r\n", 3, "no label in 'b.jpeg'; a line is '<file name> <label>'"),
        (b"my image.jpeg\n", 1, "no label in 'my image.jpeg'; a line is '<file name> <label>'"),
        (b"a.jpeg living room\n", 1, "place 'living room' holds white space; rename it"),
        (b"a.jpeg KT\nb.jpeg up/down\n", 2, "place 'up/down' holds a /; rename it"),
        (b"a.jpeg .KT\n", 1, "place '.KT' starts with a dot; rename it"),
        (b"a.jpeg best\n", 1, "place 'best' is the name of a column in placerec's files; rename it"),
        (
            b"a.jpeg KT\nb.jpeg KT\na.jpeg KT\na.jpeg CR\n",
            4,
            "a.jpeg is labelled CR, but KT in line 1; remove one of the lines",
        ),
        (b"a.jpeg KT\nb.jpeg K\xfcche\n", 2, "byte 0xfc is not UTF-8; save the file as UTF-8"),
    ],
)
def test_errors_name_file_line_and_remedy(path: Path, text: bytes, line: int, message: str) -> None:
    path.write_bytes(text)
    with pytest.raises(SourceError) as error:
        read_places(path, {"a.jpeg", "b.jpeg", "my image.jpeg"})
    assert str(error.value) == f"{path}:{line}: {message}"
