"""Word selection: properties, the readings' table, and on-line = batch."""

import itertools

import pytest
from hypothesis import given, strategies as st

from placerec.errors import StreamError
from placerec.words import Selection, parse_selection, select, selector

words_of_a_stream = st.lists(st.sampled_from(["w0", "w1", "w2"]), max_size=40)
selections = st.one_of(
    st.just(Selection("none")),
    st.just(Selection("unique")),
    st.builds(Selection, st.sampled_from(["subsample", "compress"]), st.integers(1, 6)),
)


def kept(words: list[str], rule: str) -> list[str]:
    return [word for word, keep in zip(words, select(words, parse_selection(rule)), strict=True) if keep]


@given(words_of_a_stream, selections)
def test_online_is_batch(words: list[str], selection: Selection) -> None:
    keep = selector(selection)
    assert [keep(word) for word in words] == select(words, selection).tolist()


@given(words_of_a_stream, selections, st.integers(0, 40))
def test_later_words_change_nothing(words: list[str], selection: Selection, cut: int) -> None:
    assert select(words[:cut], selection).tolist() == select(words, selection)[:cut].tolist()


@given(words_of_a_stream)
def test_unique_is_one_word_a_run(words: list[str]) -> None:
    assert kept(words, "unique") == [word for word, _ in itertools.groupby(words)]


@given(words_of_a_stream, st.integers(2, 4))
def test_unique_does_not_see_a_robot_stand_still(words: list[str], times: int) -> None:
    repeated = [word for word in words for _ in range(times)]
    assert kept(repeated, "unique") == kept(words, "unique")


@given(words_of_a_stream, st.integers(1, 5))
def test_compress_shortens_runs_to_their_mth(words: list[str], m: int) -> None:
    runs = [(word, len(list(run))) for word, run in itertools.groupby(words)]
    expected = [word for word, length in runs for _ in range(-(-length // m))]
    assert kept(words, f"compress:{m}") == expected


@given(words_of_a_stream, st.integers(1, 5))
def test_subsample_takes_one_of_s_from_the_first(words: list[str], s: int) -> None:
    assert kept(words, f"subsample:{s}") == words[::s]


@pytest.mark.parametrize("rule", ["none", "subsample:1", "compress:1"])
def test_rules_that_keep_everything(rule: str) -> None:
    words = ["a", "a", "b", "b", "b", "a"]
    assert kept(words, rule) == words


@pytest.mark.parametrize(("length", "words"), [(1, 1), (2, 1), (3, 1), (4, 2), (7, 3)])
def test_compress_3_as_in_the_readings(length: int, words: int) -> None:
    assert len(kept(["a"] * length, "compress:3")) == words


@pytest.mark.parametrize("text", ["", "all", "subsample", "subsample:0", "compress:x", "unique:2", "subsample:-1"])
def test_unknown_rules_are_refused(text: str) -> None:
    with pytest.raises(StreamError, match=f"selection {text!r} is unknown"):
        parse_selection(text)


@given(selections)
def test_a_rule_is_read_back_from_its_text(selection: Selection) -> None:
    assert parse_selection(str(selection)) == selection
