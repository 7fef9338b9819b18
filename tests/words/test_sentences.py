"""Sentences: one per visit, cut where the place, the labels or time break off."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import given, strategies as st

from placerec.words import (
    Selection,
    WordStream,
    format_sentences,
    parse_selection,
    place_steps,
    place_triples,
    read_sentences,
    sentences_per_place,
    time_gaps,
    visits,
)


def stream(words: str, places: str, times: list[float] | None = None) -> WordStream:
    """A stream of one-letter words and places; `-` is unlabelled."""
    return WordStream.of("run", words.split(), ["" if p == "-" else p for p in places.split()], times=times)


def test_a_visit_ends_where_the_place_changes_or_the_label_stops() -> None:
    seen = stream("a b c d e f g", "K K L - L L K")
    assert visits(seen, Selection()) == [("K", ["a", "b"]), ("L", ["c"]), ("L", ["e", "f"]), ("K", ["g"])]
    assert sentences_per_place([seen], Selection()) == {"K": [["a", "b"], ["g"]], "L": [["c"], ["e", "f"]]}


def test_a_gap_in_time_ends_a_visit() -> None:
    times = [0, 0.2, 0.4, 60, 60.2, 61.2]
    # The median step is 0.2 s: 59.6 s is a gap, 1 s is not (yet: ten times the median is 2 s).
    assert visits(stream("a b c d e f", "K K K K K K", times), Selection()) == [
        ("K", ["a", "b", "c"]),
        ("K", ["d", "e", "f"]),
    ]


def test_steps_are_counted_inside_labelled_runs() -> None:
    seen = stream("a b c d e f g", "K K L - L L K")
    assert place_steps(seen, ["K", "L"]).tolist() == [[1, 1], [1, 1]]
    assert place_steps(seen, ["J", "K", "L"]).tolist() == [[0, 0, 0], [0, 1, 1], [0, 1, 1]]
    times = [0, 0.2, 0.4, 60, 60.2, 61.2]
    assert place_steps(stream("a b c d e f", "K K L K K L", times), ["K", "L"]).tolist() == [[2, 2], [0, 0]]
    assert place_steps(stream("", ""), []).tolist() == []


def test_triples_are_visits_one_after_the_other() -> None:
    def listed(labels: str, times: list[float] | None = None) -> dict[str, int]:
        found = place_triples(stream(" ".join("a" * len(labels.split())), labels, times), ["J", "K", "L"])
        return {"".join("JKL"[i] for i in route): int(found[tuple(route)]) for route in np.argwhere(found).tolist()}

    assert listed("J J K K K L J K L") == {"JKL": 2, "KLJ": 1, "LJK": 1}
    assert listed("J K J K") == {"JKJ": 1, "KJK": 1}
    # Without a label, or after a gap in time, nobody knows where one came from.
    assert listed("J K - L J K") == {"LJK": 1}
    assert listed("J K L J K L", [0, 1, 60, 61, 62, 63]) == {"LJK": 1, "JKL": 1}
    assert listed("J K K") == {}


@given(st.lists(st.tuples(st.sampled_from(["", "K", "L"]), st.sampled_from([0.0, 1.0, 1.0, 1.5, 99.0])), max_size=30))
def test_a_change_of_place_without_a_break_is_a_step_between_two_visits(frames: list[tuple[str, float]]) -> None:
    """Frames that stay are steps as well: one less in each visit than it has frames."""
    places = [place for place, _ in frames]
    times = np.cumsum([step for _, step in frames])
    seen = WordStream.of("run", ["a"] * len(frames), places, times=times)
    steps = place_steps(seen, ["K", "L"])
    assert steps.trace() == sum(len(words) - 1 for _, words in visits(seen, Selection()))
    changes = [pair for i, pair in enumerate(pairwise(places)) if "" not in pair and not time_gaps(times)[i + 1]]
    assert steps[0, 1] == changes.count(("K", "L"))
    assert steps[1, 0] == changes.count(("L", "K"))


def test_selection_runs_over_the_sequence_before_it_is_cut() -> None:
    seen = stream("a a a b b", "K K L L L")
    # The third a is a repetition, whatever place it is in.
    assert sentences_per_place([seen], parse_selection("unique")) == {"K": [["a"]], "L": [["b"]]}


def test_a_place_without_selected_words_is_still_there() -> None:
    assert sentences_per_place([stream("a a a b", "K L M M")], parse_selection("unique")) == {
        "K": [["a"]],
        "L": [],
        "M": [["b"]],
    }


@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from(["", "K", "L"])), max_size=30))
def test_no_selection_keeps_every_labelled_word_in_order(frames: list[tuple[str, str]]) -> None:
    seen = WordStream.of("run", [word for word, _ in frames], [place for _, place in frames])
    joined = [(place, word) for place, words in visits(seen, Selection()) for word in words]
    assert joined == [(place, word) for word, place in frames if place]


def test_unknown_times_are_no_gaps() -> None:
    assert not time_gaps(np.full(5, np.nan)).any()
    assert time_gaps(np.array([0.0, 1, np.nan, 100, 101, 200])).tolist() == [False] * 5 + [True]


def test_text_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "K.txt"
    sentences = [["a", "b"], ["c"]]
    path.write_text("## a comment, as in SRILM\n\n" + format_sentences(sentences))
    assert read_sentences(path) == sentences


def test_real_labels_give_the_visits_of_the_recording(shared: Path) -> None:
    from placerec.frames.places import read_places

    listed = read_places(shared / "cold_labels/COLD/saarbruecken/seq4_cloudy1/localization/places.lst")
    places = [listed.places[name] for name in sorted(listed.places)]
    found = [place for place, _ in visits(WordStream.of("seq4", ["w0"] * len(places), places), Selection())]
    assert found[0] == "CR-B"
    assert set(found) == {"CR-B", "PA-B", "TL-B", "1PO-B", "KT-B"}
    assert all(a != b for a, b in pairwise(found))
    assert len(places) == 1371
