"""Token streams and vocabularies: round trips, and errors that name the line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.errors import StreamError
from placerec.frames.table import FrameTable
from placerec.words import (
    Selection,
    WordStream,
    format_sentences,
    read_stream,
    read_vocabulary,
    select,
    write_stream,
    write_vocabulary,
)
from placerec.words.stream import RESERVED, read_dictionaries

names = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1, max_size=5).filter(
    lambda name: (
        not name.startswith(("##", "."))
        and not set(name) & set("/\\")
        and name not in ("frame", "time", "place", "word", "distance", "selected", "best", "unknown", *RESERVED)
    )
)
seconds = st.one_of(st.just(float("nan")), st.integers(0, 10**15).map(lambda microseconds: microseconds / 1e6))
lines_of_a_stream = st.lists(
    st.tuples(names, seconds, st.one_of(st.just(""), names), names, st.floats(0, 1e6)), max_size=8
)


@given(lines_of_a_stream)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, lines: list[tuple[str, float, str, str, float]]
) -> None:
    frames, times, places, words, distances = zip(*lines, strict=True) if lines else ((), (), (), (), ())
    stream = WordStream.of("run", words, places, frames=frames, times=times, distances=distances)
    path = tmp_path_factory.getbasetemp() / "run.tsv"
    write_stream(stream, path)
    back = read_stream(path)
    assert (back.name, back.frames, back.places, back.words) == ("run", frames, places, words)
    assert np.allclose(back.times, stream.times, rtol=0, atol=1e-6, equal_nan=True)
    assert np.allclose(back.distances, stream.distances, rtol=1e-5)


def test_file_is_as_the_contract_says(tmp_path: Path) -> None:
    frames = ("t1.5.jpeg", "t2.jpeg")
    far = [0.25, np.nan]
    stream = WordStream.of("run", ["w07", "w11"], ["kitchen", ""], frames=frames, times=[1.5, np.nan], distances=far)
    write_stream(stream, tmp_path / "run.tsv")
    assert (tmp_path / "run.tsv").read_bytes() == (
        b"frame\ttime\tplace\tword\tdistance\nt1.5.jpeg\t1.5\tkitchen\tw07\t0.25\nt2.jpeg\t\t\tw11\t\n"
    )


def test_readers_need_only_the_word_column(tmp_path: Path) -> None:
    path = tmp_path / "run.tsv"
    path.write_bytes(b"\xef\xbb\xbfscore\tword\r\n0.5\tw1\r\n0.6\tw2\r\n")
    stream = read_stream(path)
    assert stream.words == ("w1", "w2")
    assert stream.places == ("", "")
    assert np.isnan(stream.times).all()


def test_plain_text_is_a_stream_of_words(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("w1 w2\nw1\n")
    assert read_stream(path).words == ("w1", "w2", "w1")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frame\ttime\n0\t1\n", ":1: the header 'frame\\ttime' has no column 'word'"),
        ("frame\n0\n", ":1: the header 'frame' has no column 'word'"),
        ("place\ttime\nhall\t1\n", ":1: the header 'place\\ttime' has no column 'word'"),
        ("frame\tword\n0\tw1\textra\n", ":2: 3 fields found, 2 expected as in the header"),
        ("time\tword\nnoon\tw1\n", ":2: time 'noon' is not a number"),
        ("time\tword\n1\tw1\n\n2\tw 2\n", ":4: the word 'w 2' is empty or holds white space"),
        ("place\tword\na/b\tw1\n", ":2: place 'a/b' holds a /; rename it"),
        ("place\tword\nbest\tw1\n", ":2: place 'best' is the name of a column in placerec's files; rename it"),
        ("place\tword\nhall\t<s>\n", ":2: the word '<s>' has a meaning of its own in language models; rename it"),
    ],
)
def test_errors_name_line_and_value(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.tsv"
    path.write_text(text)
    with pytest.raises(StreamError) as error:
        read_stream(path)
    assert str(error.value) == f"{path}{message}"


def test_vocabulary_round_trip_and_errors(tmp_path: Path) -> None:
    path = tmp_path / "vocab.txt"
    write_vocabulary(["w1", "w0"], path)
    assert path.read_bytes() == b"w1\nw0\n"
    assert read_vocabulary(path) == ("w1", "w0")
    for text, message in [
        ("", ": holds no word; one word a line is expected"),
        ("a\nb\na\n", ":3: the word 'a' is listed already, on line 1"),
        ("a b\n", ":1: the word 'a b' is empty or holds white space"),
        ("</s>\n", ":1: the word '</s>' has a meaning of its own in language models; rename it"),
    ]:
        path.write_text(text)
        with pytest.raises(StreamError) as error:
            read_vocabulary(path)
        assert str(error.value) == f"{path}{message}"


def test_a_string_where_a_list_of_words_belongs_is_refused() -> None:
    """Letter by letter it would be taken otherwise."""
    taken: list[Callable[[], object]] = [
        lambda: select("a b c", Selection()),
        lambda: WordStream.of("run", "a b c"),
        lambda: WordStream.of("run", ["a", "b"], "hk"),
        lambda: format_sentences("a b c"),
        lambda: format_sentences(["a b c"]),
        lambda: write_vocabulary("a b c", "vocab.txt"),
    ]
    for take in taken:
        with pytest.raises(StreamError, match=r" is a string; a list of words, not a string, is needed here"):
            take()
    with pytest.raises(StreamError, match=r"^'(a ){20}\.\.\.' is a string"):
        select("a " * 1000, Selection())


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(StreamError, match=r"^run: 2 words and 1 distances of 2 frames"):
        WordStream.of("run", ["a", "b"], distances=[1.0])
    with pytest.raises(StreamError, match=r"^run: 2 words and 2 distances of 3 frames"):
        WordStream.of("run", ["a", "b"], frames=["0", "1", "2"])


def test_a_stream_is_told_in_a_line() -> None:
    stream = WordStream.of("run", ["a", "b"] * 5000, ["hall", ""] * 5000)
    assert repr(stream) == "WordStream('run': 10000 frames, 2 words, 1 place)"


def test_a_renamed_stream_has_its_name_in_its_table() -> None:
    stream = WordStream.of("run", ["a"]).renamed("lab-run")
    assert stream.name == "lab-run"
    assert stream.table == FrameTable.of("lab-run", ["0"])


def test_parts_of_a_stream_are_joined_in_order() -> None:
    first, second = WordStream.of("run", ["a"], ["hall"], times=[1]), WordStream.of("run", ["b"], [""], times=[2])
    whole = WordStream.concat([first, second])
    assert (whole.name, whole.words, whole.places, whole.times.tolist()) == ("run", ("a", "b"), ("hall", ""), [1, 2])


@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("frame\tword\tdistance", ("",)),
        ("word.pn10\tword\tword.plain20", ("", "pn10", "plain20")),
        ("word.pn10 is a word of a text", ("",)),
    ],
)
def test_the_first_line_alone_tells_the_dictionaries(tmp_path: Path, header: str, names: tuple[str, ...]) -> None:
    (tmp_path / "run.tsv").write_bytes(header.encode() + b"\n\xff is no UTF-8\n")
    assert read_dictionaries(tmp_path / "run.tsv") == names


def test_a_dictionary_cannot_be_called_as_a_folder_of_models_is(tmp_path: Path) -> None:
    (tmp_path / "run.tsv").write_text("word\tword.counts\nw1\tw2\n")
    for read in (read_dictionaries, read_stream):
        with pytest.raises(
            StreamError, match=r"run\.tsv:1: the name 'counts' of a dictionary is taken; rename the col"
        ):
            read(tmp_path / "run.tsv")
