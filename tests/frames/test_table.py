"""Tables of frames, and the frames of a folder: what they hold, their order, parts of them, parts put together."""

import math
import re
import tracemalloc
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.errors import SourceError
from placerec.frames.folder import FileFrames, natural_key, read_frames
from placerec.frames.sequence import Frame
from placerec.frames.table import FrameTable, Labels, Texts

NAMES = st.lists(st.text(st.sampled_from("a0019-. é"), min_size=1, max_size=8), unique=True)


def plain_key(name: str) -> tuple[list[str | int], str]:
    """The order as one would write it: text as text, numbers as numbers."""
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], name


@given(NAMES)
def test_names_are_in_natural_order(names: list[str]) -> None:
    assert sorted(names, key=natural_key) == sorted(names, key=plain_key)


TEXTS = st.lists(st.text(max_size=5) | st.sampled_from(["\udcff.png", "a\x00b"]))
COLUMNS = st.sampled_from([Texts, Labels])


@given(COLUMNS, TEXTS)
def test_strings_come_back(column: type[Texts] | type[Labels], texts: list[str]) -> None:
    kept = column(texts)
    assert list(kept) == [kept[i] for i in range(len(texts))] == texts
    assert [kept[i - len(texts)] for i in range(len(texts))] == texts
    assert kept == tuple(texts)
    assert kept != (*texts, "one more")
    assert kept != ("another", *texts[1:])


@given(COLUMNS, TEXTS, TEXTS, st.data())
def test_columns_are_cut_and_joined_as_lists_are(
    column: type[Texts] | type[Labels], texts: list[str], more: list[str], data: st.DataObject
) -> None:
    part = data.draw(st.slices(len(texts)))
    kept = column(texts)
    assert kept[part] == kept.take(part) == texts[part]
    mask = np.array(data.draw(st.lists(st.booleans(), min_size=len(texts), max_size=len(texts))), bool)
    rows = np.flatnonzero(mask)[::-1]
    assert kept.take(rows) == [texts[row] for row in rows]
    assert kept.take(mask) == [texts[row] for row in np.flatnonzero(mask)]
    parts: Any = [kept.take(part), column(more), column()]
    assert column.concat(parts) == texts[part] + more
    assert column.concat([]) == []


def test_labels_are_told_by_their_number_in_a_list_of_names() -> None:
    labels = Labels(["hall", "", "kitchen", "hall", "attic"])
    assert labels.codes(["kitchen", "hall"]).tolist() == [1, -1, 0, 1, -1]
    assert labels.codes([]).tolist() == [-1] * 5


@given(st.lists(st.sampled_from("abc"), max_size=9))
def test_rows_of_a_sequence_are_found_in_order(names: list[str]) -> None:
    table = FrameTable.concat(FrameTable.of(name, [f"{row}.png"], [row]) for row, name in enumerate(names))
    assert {name: rows.tolist() for name, rows in table.by_sequence().items()} == {
        name: [row for row, its in enumerate(names) if its == name] for name in names
    }
    assert list(table.by_sequence()) == list(dict.fromkeys(names))
    for name, rows in table.by_sequence().items():
        part = table.take(rows)
        assert part == FrameTable.of(name, [f"{row}.png" for row in rows], rows.astype(float))
        assert part.renamed("run") != part
        assert part.renamed("run").sequences == ("run",) * len(rows)


def test_columns_of_different_lengths_are_refused() -> None:
    for columns in ({"times": [1.0]}, {"places": ["hall"]}):
        with pytest.raises(SourceError, match=r"^run: 2 names, [12] times and [12] places of frames"):
            FrameTable.of("run", ["a", "b"], **columns)


def test_a_table_is_told_in_a_line() -> None:
    table = FrameTable.of("run", map(str, range(3)), places=["hall", "", "hall"])
    assert repr(table) == "FrameTable(3 frames, 1 sequence, 1 place)"
    assert table.labelled.tolist() == [True, False, True]


def test_a_frame_takes_its_name_and_a_few_bytes() -> None:
    names = [f"t{1.1e9 + row / 3:.6f}_x0.012345_y1.012345_a0.100000.jpeg" for row in range(10000)]
    places = ["hall" if row % 100 < 50 else "kitchen" for row in range(10000)]
    tracemalloc.start()
    table = FrameTable.of("run", names, np.arange(10000.0), places)
    used = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert used / len(table) < len(names[0]) + 20


@given(st.integers(0, 9), st.slices(9))
def test_a_part_is_a_part_of_the_frames(count: int, part: slice) -> None:
    names, places = [f"{i}.png" for i in range(count)], ["hall" if i % 3 else "" for i in range(count)]
    frames = FileFrames(Path("run"), FrameTable.of("", names, np.arange(float(count)), places))
    plain = [Frame(name, float(i), places[i], Path("run") / name) for i, name in enumerate(names)]
    assert list(frames) == plain
    assert list(frames[part]) == plain[part]
    assert list(frames[part][::2]) == plain[part][::2]
    assert deepcopy(frames[part]) == frames[part]
    assert len(frames[part]) == len(plain[part])


def test_frames_are_equal_if_what_they_are_made_of_is() -> None:
    frames = read_frames(Path("run"), ["b.png", "a.png"], place="hall")
    assert math.isnan(frames[0].time)
    assert frames == read_frames(Path("run"), ["a.png", "b.png"], place="hall")
    assert hash(frames) == hash(read_frames(Path("run"), ["a.png", "b.png"], place="hall"))
    for other in (
        read_frames(Path("run"), ["a.png", "c.png"], place="hall"),
        read_frames(Path("run"), ["a.png", "b.png"], place="attic"),
        read_frames(Path("other"), ["a.png", "b.png"], place="hall"),
        frames[:1],
        tuple(frames),
    ):
        assert frames != other
