"""VPC's layout: ranges of image numbers in HOME/label.txt, floors as sequences; and the real labels of six homes."""

import re
import tempfile
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from placerec.errors import SourceError
from placerec.frames import find_sequences
from placerec.frames.layouts import find_vpc_list, read_labels

LABELS = """1/
6
1       2       bathroom
3       3     transition
4       6       living_room
-1      -1      end
0/
3
1 3 workspace
-1      -1 end
-1      -1      end

NOTES:
a) segments 1 - 9 of the 1st floor | nobody knows what this is
"""


def home(folder: Path, text: str = LABELS, floors: dict[str, int] | None = None) -> Path:
    for floor, count in (floors or {"1": 6, "0": 3}).items():
        (folder / floor).mkdir(parents=True)
        for number in range(1, count + 1):
            (folder / floor / f"{number:08d}.jpg").touch()
    (folder / "label.txt").write_text(text)
    return folder


def failure(folder: Path) -> str:
    with pytest.raises(SourceError) as error:
        find_sequences([folder])
    return str(error.value)


def test_floors_are_sequences(tmp_path: Path) -> None:
    home(tmp_path / "Home1")
    cellar, ground = find_sequences([tmp_path])
    assert (cellar.name, ground.name) == ("Home1-0", "Home1-1")
    assert [frame.place for frame in cellar.frames] == ["workspace"] * 3
    assert [frame.place for frame in ground.frames] == ["bathroom"] * 2 + [""] + ["living_room"] * 3
    assert ground.frames[3].name == "00000004.jpg"
    (alone,) = find_sequences([tmp_path / "Home1/1"])
    assert alone == ground


def test_a_floor_named_from_within(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home(tmp_path / "Home1") / "1")
    (sequence,) = find_sequences(["."])
    assert sequence.name == "Home1-1"
    assert [frame.place for frame in sequence.frames] == ["bathroom"] * 2 + [""] + ["living_room"] * 3


def test_every_third_number_of_a_film(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = home(tmp_path / "Home1", floors={"1": 6})
    for number in (2, 3, 5, 6):
        (folder / f"1/{number:08d}.jpg").unlink()
    (folder / "1/preview.jpg").touch()
    (sequence,) = find_sequences([folder])
    assert [frame.place for frame in sequence.frames] == ["bathroom", "living_room", ""]
    assert f"{folder / 'label.txt'}:2: 6 images are promised, 2 are there" in caplog.messages


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 2", "3: '1 2' is not 'first last category'; mend it"),
        ("1 two hall", "3: '1 two hall' is not 'first last category'; mend it"),
        ("1 2 living room", "3: '1 2 living room' is not 'first last category'; mend it"),
        ("2 1 hall", "3: the range 2 to 1 ends before it starts; mend it"),
        ("1 2 a/b", "3: place 'a/b' holds a /; rename it"),
        ("1 3 hall", "4: image 3 is labelled in line 3; change one"),
        ("1 99999999999999 hall", "4: image 3 is labelled in line 3; change one"),
    ],
)
def test_lines_that_are_wrong(tmp_path: Path, line: str, message: str) -> None:
    folder = home(tmp_path / "Home1", LABELS.replace("1       2       bathroom", line))
    assert failure(folder) == f"{folder / 'label.txt'}:{message}"


def test_another_label_txt_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run/a.jpg").touch()
    for content in (b"", b"kitchen\n1/\n", b"\xff\xfe\0\1", b"2/\n1 1 hall\n"):
        (tmp_path / "label.txt").write_bytes(content)
        (sequence,) = find_sequences([tmp_path / "run"])
        assert (sequence.name, sequence.frames[0].place) == ("run", "")


@given(st.lists(st.text(alphabet="0123456789-/ \tend", max_size=12), max_size=8).map("\n".join))
def test_any_text_is_read_or_refused_by_file_and_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "label.txt")
        path.write_text(f"1/\n{text}", encoding="utf-8")
        images = [f"{number:08d}.jpg" for number in range(1, 30)]
        found: set[str] = set()
        said = f"{path}:1: "
        try:
            found = set(read_labels(path, "1", images).places)
        except SourceError as error:
            said = str(error)
        assert re.match(rf"{re.escape(str(path))}:\d+: [^\n]*$", said)
        assert found <= set(images)


def test_real_labels(shared: Path, tmp_path: Path) -> None:
    """Every image of every floor of the six homes has the label that a plain reading of its line gives."""
    homes = sorted((shared / "cold_labels/VPC").iterdir())
    assert [one.name for one in homes] == [f"Home{i}" for i in range(1, 7)]
    seen: Counter[str] = Counter()
    for one in homes:
        path = one / "label.txt"
        blocks = path.read_text().split("/\n")
        floors = [block.split()[-1] for block in blocks[:-1]]
        for floor, block in zip(floors, blocks[1:], strict=True):
            lines = [line.split() for line in block.splitlines()]
            count = int(lines[0][0])
            images = [f"{number:08d}.jpg" for number in range(1, count + 1)]
            assert find_vpc_list(one / floor) == path
            found = read_labels(path, floor, images).places
            expected = {}
            for first, last, place in lines[1 : next(i for i, line in enumerate(lines) if line[-1:] == ["end"])]:
                for number in range(int(first), int(last) + 1):
                    if place != "transition":
                        expected[f"{number:08d}.jpg"] = place
            assert found == expected
            seen.update(found.values())
    assert len(seen) == 11
    assert seen["bathroom"] > 4000
    assert "end" not in seen
