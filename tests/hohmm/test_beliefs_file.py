"""Beliefs files: what is written is read again, and what is malformed is named with its line, value and remedy."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from placerec.errors import EvaluationError, OutputError
from placerec.hohmm.beliefs import (
    COLUMNS,
    BeliefRow,
    Beliefs,
    format_header,
    format_row,
    parse_beliefs,
    read_beliefs,
    write_beliefs,
)
from placerec.words import WordStream

HEADER = "frame\ttime\tplace\tword\tselected\tbest\tkitchen\toffice"
ROW = "t1.jpeg\t0.5\tkitchen\tw07\t1\toffice\t0.25\t0.75"


def same(left: Beliefs, right: Beliefs) -> None:
    for name in ("name", "places", "frames", "truth", "words", "best"):
        assert getattr(left, name) == getattr(right, name), name
    np.testing.assert_array_equal(left.selected, right.selected)
    np.testing.assert_allclose(left.times, right.times, rtol=0, atol=5.01e-7)
    np.testing.assert_allclose(left.belief, right.belief, rtol=5.01e-9, atol=0)
    assert (left.unknown is None) == (right.unknown is None)
    if left.unknown is not None and right.unknown is not None:
        np.testing.assert_allclose(left.unknown, right.unknown, rtol=5.01e-9, atol=0)


def test_the_lines_are_those_of_the_contract() -> None:
    assert format_header(["kitchen", "office"]) == HEADER
    assert format_row(BeliefRow("t1.jpeg", 0.5, "kitchen", "w07", True, "office", [0.25, 0.75])) == ROW
    assert (
        format_row(BeliefRow("0", float("nan"), "", "w7", False, "a", [1 / 3, 2 / 3]))
        == "0\t\t\tw7\t0\ta\t0.333333333\t0.666666667"
    )


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0"),
        (12.0, "12"),
        (0.2, "0.2"),
        (1160056709.123456, "1160056709.123456"),
        (0.1 + 0.2, "0.3"),
        (1e7, "10000000"),
    ],
)
def test_times_are_written_to_the_microsecond_without_exponent(seconds: float, text: str) -> None:
    assert format_row(BeliefRow("f", seconds, "", "w", True, "a", [1.0])).split("\t")[1] == text


def test_beliefs_are_told_in_a_line() -> None:
    beliefs = parse_beliefs(f"{HEADER}\n{ROW}\n", name="seq1", source="x")
    assert repr(beliefs) == "Beliefs('seq1': 1 frame, 2 places: kitchen, office)"
    many = Beliefs.of(WordStream.of("seq1", ["w0"] * 99), tuple(f"place{i}" for i in range(200)), np.eye(99, 200))
    assert repr(many).startswith("Beliefs('seq1': 99 frames, 200 places: place0, place1, ")
    assert len(repr(many)) < 120


def test_a_very_small_belief_keeps_its_exponent() -> None:
    assert format_row(BeliefRow("f", 0.0, "", "w", True, "a", [1.23456789e-30])).endswith("\t1.23456789e-30")


def test_a_tab_in_a_text_is_refused_when_writing() -> None:
    with pytest.raises(
        OutputError, match=r"^'a\\tb' holds a tab or a line end, which a beliefs file cannot hold; rename it$"
    ):
        format_row(BeliefRow("a\tb", 0.0, "", "w", True, "a", [1.0]))
    with pytest.raises(OutputError, match="holds a tab or a line end"):
        format_header(["kitchen\n"])


words = st.text(st.characters(blacklist_characters="\t\r\n", blacklist_categories=["Cs"]), max_size=8)


@st.composite
def written(draw: st.DrawFn) -> Beliefs:
    name = words.filter(lambda text: text not in (*COLUMNS, "unknown", ""))
    places = tuple(draw(st.lists(name, min_size=1, max_size=4, unique=True)))
    count = draw(st.integers(0, 5))

    def column(strategy: st.SearchStrategy[str]) -> tuple[str, ...]:
        return tuple(draw(st.lists(strategy, min_size=count, max_size=count)))

    weights = draw(st.lists(st.floats(1e-30, 1), min_size=count * len(places), max_size=count * len(places)))
    belief = np.array(weights, dtype=np.float64).reshape(count, len(places))
    times = draw(st.lists(st.floats(0, 2e9) | st.just(np.nan), min_size=count, max_size=count))
    stream = WordStream.of("seq1", column(words), column(words), frames=column(words), times=times)
    return Beliefs(
        stream,
        places,
        selected=np.array(draw(st.lists(st.booleans(), min_size=count, max_size=count)), dtype=np.bool_),
        best=column(st.sampled_from(places)),
        belief=belief / belief.sum(axis=1, keepdims=True),
        unknown=draw(st.none() | arrays(np.float64, count, elements=st.floats(0, 1))),
    )


@given(beliefs=written())
def test_what_is_written_is_read_again(beliefs: Beliefs, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("beliefs") / "seq1.tsv"
    write_beliefs(path, beliefs)
    again = read_beliefs(path)
    same(beliefs, again)
    first = path.read_bytes()
    write_beliefs(path, again)
    assert path.read_bytes() == first


def test_a_gzipped_file_has_the_same_name_and_content(tmp_path: Path) -> None:
    beliefs = parse_beliefs(f"{HEADER}\n{ROW}\n", name="seq1", source="x")
    write_beliefs(tmp_path / "seq1.tsv.gz", beliefs)
    assert gzip.decompress((tmp_path / "seq1.tsv.gz").read_bytes()).decode() == f"{HEADER}\n{ROW}\n"
    same(beliefs, read_beliefs(tmp_path / "seq1.tsv.gz"))


def test_windows_line_ends_and_a_byte_order_mark_are_read() -> None:
    beliefs = parse_beliefs(f"\ufeff{HEADER}\r\n{ROW}\r\n", name="seq1", source="x")
    assert (beliefs.places, beliefs.frames) == (("kitchen", "office"), ("t1.jpeg",))


def test_a_file_without_frames_is_read() -> None:
    beliefs = parse_beliefs(HEADER + "\n", name="seq1", source="x")
    assert beliefs.belief.shape == (0, 2)
    assert beliefs.times.shape == beliefs.selected.shape == (0,)


def test_the_column_unknown_is_no_place_and_stands_beside_the_sum() -> None:
    beliefs = parse_beliefs(f"{HEADER}\tunknown\n{ROW}\t0.9\n", name="seq1", source="x")
    assert beliefs.places == ("kitchen", "office")
    assert beliefs.belief.tolist() == [[0.25, 0.75]]
    assert beliefs.unknown is not None
    assert beliefs.unknown.tolist() == [0.9]


@pytest.mark.parametrize(
    ("belief", "allowed"), [("0.2491", True), ("0.2489", False), ("0.2509", True), ("0.2511", False)]
)
def test_beliefs_may_miss_the_sum_of_one_by_a_thousandth(belief: str, allowed: bool) -> None:
    text = f"{HEADER}\n{ROW.replace('0.25', belief)}\n"
    if allowed:
        assert parse_beliefs(text, name="s", source="x").belief.tolist() == [[float(belief), 0.75]]
    else:
        with pytest.raises(EvaluationError, match=r"^x:2: the beliefs sum to "):
            parse_beliefs(text, name="s", source="x")


@pytest.mark.parametrize("swapped", [("frame", "time"), ("time", "place"), ("selected", "best")])
def test_columns_in_another_order_are_refused(swapped: tuple[str, str]) -> None:
    a, b = swapped
    header = HEADER.replace(a, "?").replace(b, a).replace("?", b)
    with pytest.raises(EvaluationError, match=r"^x:1: the header begins .*; the order is 'frame time place word"):
        parse_beliefs(f"{header}\n{ROW}\n", name="s", source="x")


def test_unknown_is_decided_above_a_half_and_where_the_column_is() -> None:
    belief = np.array([[0.25, 0.75], [0.5, 0.5], [0.9, 0.1]])
    places = ("kitchen", "office")
    stream = WordStream.of("s", ["w0"] * 3)
    assert Beliefs.of(stream, places, belief).best == ("office", "kitchen", "kitchen")
    unknown = np.array([0.5, 0.51, 0.0])
    assert Beliefs.of(stream, places, belief, unknown=unknown).best == ("office", "unknown", "kitchen")
    path, kept = np.array([0, 0, 1]), np.array([True, False, False])
    given = Beliefs.of(stream, places, belief, selected=kept, best=path, unknown=unknown)
    assert (given.best, given.selected.tolist()) == (("kitchen", "unknown", "office"), [True, False, False])
    decided = ROW.replace("\toffice\t", "\tunknown\t")
    assert parse_beliefs(f"{HEADER}\tunknown\n{decided}\t0.9\n", name="s", source="x").best == ("unknown",)
    with pytest.raises(EvaluationError, match="best is 'unknown', which is no place of the header"):
        parse_beliefs(f"{HEADER}\n{decided}\n", name="s", source="x")


def row(**changes: str) -> str:
    fields = dict(zip(HEADER.split("\t"), ROW.split("\t"), strict=True)) | changes
    return f"{HEADER}\n{ROW}\n" + "\t".join(fields.values()) + "\n"


MALFORMED = {
    "": "seq.tsv: is empty; a beliefs file starts with a header: frame time place word selected best PLACE...",
    "\n": "seq.tsv: is empty; a beliefs file starts with a header: frame time place word selected best PLACE...",
    "frame\tword\tplace\tkitchen\n": "seq.tsv:1: not a beliefs file: no column time, selected, best; "
    "write it with `placerec decode`",
    "time\tframe\tplace\tword\tselected\tbest\tkitchen\n": "seq.tsv:1: the header begins "
    "'time frame place word selected best'; the order is 'frame time place word selected best'",
    "frame\ttime\tplace\tword\tselected\tbest\n": "seq.tsv:1: no column for a place after 'best'; "
    "one per place is needed",
    "frame\ttime\tplace\tword\tselected\tbest\tunknown\n": "seq.tsv:1: no column for a place after 'best'; "
    "one per place is needed",
    HEADER + "\tkitchen\n": "seq.tsv:1: 'kitchen' cannot be the name of one more place; rename that column",
    HEADER + "\tword\n": "seq.tsv:1: 'word' cannot be the name of one more place; rename that column",
    HEADER + "\t\n": "seq.tsv:1: '' cannot be the name of one more place; rename that column",
    HEADER + "\tunknown\thall\n": "seq.tsv:1: 'unknown' cannot be the name of one more place; rename that column",
    f"{HEADER}\n{ROW}\n\n{ROW}\n": "seq.tsv:3: the line has 1 of the header's 8 fields; mend or remove it",
    f"{HEADER}\n{ROW}\t1\n": "seq.tsv:2: the line has 9 of the header's 8 fields; mend or remove it",
    row(selected="yes"): "seq.tsv:3: selected is 'yes'; it is 1 or 0",
    row(best="hall"): "seq.tsv:3: best is 'hall', which is no place of the header; the places are kitchen, office",
    row(time="noon"): "seq.tsv:3: time is 'noon', not a number of seconds; leave it empty where it is unknown",
    row(time="nan"): "seq.tsv:3: time is 'nan', not a number of seconds; leave it empty where it is unknown",
    row(
        kitchen="much"
    ): "seq.tsv:3: the belief in kitchen is 'much', not a number from 0 to 1; decode the sequence again",
    row(office="1.2"): "seq.tsv:3: the belief in office is '1.2', not a number from 0 to 1; decode the sequence again",
    row(
        office="-0.1"
    ): "seq.tsv:3: the belief in office is '-0.1', not a number from 0 to 1; decode the sequence again",
    row(office="nan"): "seq.tsv:3: the belief in office is 'nan', not a number from 0 to 1; decode the sequence again",
    row(office="0.748"): "seq.tsv:3: the beliefs sum to 0.998, not to 1; decode the sequence again",
}


@pytest.mark.parametrize(("text", "message"), MALFORMED.items())
def test_a_malformed_file_is_named_with_its_line(text: str, message: str) -> None:
    with pytest.raises(EvaluationError) as raised:
        parse_beliefs(text, name="seq", source="seq.tsv")
    assert str(raised.value) == message


def test_a_row_may_miss_1_by_its_rounding() -> None:
    parse_beliefs(row(office="0.7495"), name="seq", source="seq.tsv")


def test_an_absent_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match=r"seq9\.tsv: no such file"):
        read_beliefs(tmp_path / "seq9.tsv")
