"""Beliefs and streams as tables of columns, and as a notebook shows them."""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.small_world import beliefs_of, run_through

from placerec.hohmm import Beliefs, write_beliefs
from placerec.hohmm.beliefs_html import beliefs_html
from placerec.words import WordStream, write_stream
from placerec.words.stream import WordColumn

PLACES = ("hall", "kitchen")


def table(path: Path) -> dict[str, list[str]]:
    header, *rows = [line.split("\t") for line in path.read_text().splitlines()]
    return dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))


def as_text(columns: dict[str, Any]) -> dict[str, list[str]]:
    """Columns as files hold them."""

    def cell(value: object) -> str:
        if isinstance(value, bool | np.bool_):
            return str(int(value))
        if isinstance(value, float):
            return "" if np.isnan(value) else f"{value:.9g}"
        return str(value)

    return {name: [cell(value) for value in column] for name, column in columns.items()}


def beliefs(n: int = 6, unknown: bool = False) -> Beliefs:
    belief = np.stack([np.linspace(0, 1, n), 1 - np.linspace(0, 1, n)], axis=1)
    truth = ["kitchen"] * (n // 2) + [""] + ["hall"] * (n - n // 2 - 1)
    stream = WordStream.of("run", [f"w{i % 10}" for i in range(n)], truth, times=np.arange(n) / 2)
    return Beliefs.of(stream, PLACES, belief, unknown=np.linspace(0.1, 0.9, n) if unknown else None)


@pytest.mark.parametrize("unknown", [False, True])
def test_the_columns_of_beliefs_are_those_of_their_file(tmp_path: Path, unknown: bool) -> None:
    found = beliefs(unknown=unknown)
    write_beliefs(tmp_path / "run.tsv", found)
    assert as_text(found.to_dict()) == table(tmp_path / "run.tsv")
    assert list(found.to_dict())[-1] == ("unknown" if unknown else "kitchen")


def test_the_columns_of_a_stream_are_those_of_its_file(tmp_path: Path) -> None:
    plain = run_through("run", 0)
    far = np.linspace(1, 2, len(plain)).round(3)
    several = WordStream(
        "run", plain.table, plain.words, plain.distances, {"pn20": WordColumn(tuple(reversed(plain.words)), far)}
    )
    for stream in (plain, several):
        write_stream(stream, tmp_path / "run.tsv")
        assert as_text(stream.to_dict()) == table(tmp_path / "run.tsv")
    assert list(several.to_dict())[-2:] == ["word.pn20", "distance.pn20"]


class Elements(HTMLParser):
    """The tags that are open at the end, and what was read of texts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.styles: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.styles += [value or "" for name, value in attrs if name == "style"]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def stops(style: str) -> list[tuple[float, float, float]]:
    """Opacity, begin and end in percent of each piece of a gradient."""
    return [
        (float(a), float(b), float(c)) for a, b, c in re.findall(r"rgba\(\d+,\d+,\d+,(\S+?)\) (\S+?)% (\S+?)%", style)
    ]


def test_a_notebook_shows_a_strip_for_each_place() -> None:
    shown = Elements(beliefs()._repr_html_())
    assert shown.open == []
    assert shown.texts == ["run", ": 6 frames; 100.0 % of 5 labelled ones right", *PLACES]
    hall, hall_true, kitchen, kitchen_true = [stops(style) for style in shown.styles if "gradient" in style]
    assert [level for level, _, _ in hall] == [0, 0.2, 0.4, 0.6, 0.8, 1]
    assert [level for level, _, _ in kitchen] == [1, 0.8, 0.6, 0.4, 0.2, 0]
    assert hall_true == [(0, 0, 66.67), (1, 66.67, 100)]
    assert kitchen_true == [(1, 0, 50), (0, 50, 100)]
    for strip in (hall, hall_true, kitchen, kitchen_true):
        assert (strip[0][1], strip[-1][2]) == (0, 100)
        assert [end for _, _, end in strip[:-1]] == [begin for _, begin, _ in strip[1:]]


def test_unknown_has_a_strip_and_takes_from_the_places() -> None:
    shown = Elements(beliefs_html(beliefs(unknown=True)))
    assert shown.texts[-1] == "unknown"
    hall, _, _, _, unknown, _ = [stops(style) for style in shown.styles if "gradient" in style]
    assert [level for level, _, _ in unknown] == [0.1, 0.26, 0.42, 0.58, 0.74, 0.9]
    assert hall[-1][0] == 0.1


def test_a_long_sequence_of_many_places_stays_small() -> None:
    places = [f"place{i:03d}" for i in range(60)]
    truth = [places[i * 60 // 50000] for i in range(50000)]
    belief = np.random.default_rng(0).dirichlet([0.05] * 60, 50000)
    text = beliefs_html(beliefs_of("run", places, truth, truth, belief))
    assert len(text) < 300_000
    assert "<p>and 40 more places</p>" in text
    assert Elements(text).open == []


def test_names_are_escaped_and_nothing_is_an_empty_table() -> None:
    odd = beliefs_of("<b>&", ["<i>", "hall"], ["<i>"], ["<i>"])
    assert Elements(beliefs_html(odd)).texts[:1] == ["<b>&"]
    none = WordStream.of("run", [])
    assert Elements(beliefs_html(Beliefs.of(none, PLACES, np.zeros((0, 2))))).texts == ["run", ": 0 frames"]
