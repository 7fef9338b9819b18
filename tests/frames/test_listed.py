"""Frames of a folder in compact form: what they are, their order, parts of them."""

import math
import re
from copy import deepcopy
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from placerec.frames.folder import natural_key, read_frames
from placerec.frames.listed import FileFrames, Labels, Texts
from placerec.frames.sequence import Frame

NAMES = st.lists(st.text(st.sampled_from("a0019-. é"), min_size=1, max_size=8), unique=True)


def plain_key(name: str) -> tuple[list[str | int], str]:
    """The order as one would write it: text as text, numbers as numbers."""
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], name


@given(NAMES)
def test_names_are_in_natural_order(names: list[str]) -> None:
    assert sorted(names, key=natural_key) == sorted(names, key=plain_key)


@given(st.lists(st.text(max_size=5) | st.sampled_from(["\udcff.png", "a\x00b"])))
def test_strings_come_back(texts: list[str]) -> None:
    assert list(Texts(texts)) == list(Labels(texts)) == texts
    assert [Texts(texts)[i] for i in range(len(texts))] == [Labels(texts)[i] for i in range(len(texts))] == texts


@given(st.integers(0, 9), st.slices(9))
def test_a_part_is_a_part_of_the_frames(count: int, part: slice) -> None:
    names, places = [f"{i}.png" for i in range(count)], ["hall" if i % 3 else "" for i in range(count)]
    frames = FileFrames(Path("run"), names, map(float, range(count)), places)
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
