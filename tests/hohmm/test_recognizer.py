"""The recognizer: on-line and off-line agree with each other and with the plain twin, and do not look ahead."""

import logging
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from helpers.filter_cases import transitions
from helpers.small_models import WORDS, corpora, models_of, novelty, selections
from hypothesis import given, settings, strategies as st

from placerec import reference
from placerec.errors import ModelError, StreamError
from placerec.hohmm import (
    Belief,
    Calibration,
    Recognizer,
    SeparateEmissions,
    SequenceDecoder,
    Transition,
    filter,
    fixed_transition,
    learned_transition,
)
from placerec.hohmm.transitions import Per
from placerec.hohmm.unknown import UnknownModel
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.words import Selection, WordStream

streams = st.lists(st.sampled_from(WORDS), max_size=30)


def as_twin(model: BackoffModel) -> reference.Model:
    """The very numbers of a model, for the plain twin."""
    p: dict[tuple[str, ...], float] = {}
    weight: dict[tuple[str, ...], float] = {}
    for n in range(1, model.order + 1):
        for text, log10_p, backoff in zip(
            model.trie.texts(n), model.log10_probs[n - 1].tolist(), model.backoffs[n - 1].tolist(), strict=True
        ):
            p[tuple(text.split(" "))] = 10**log10_p
            if not math.isnan(backoff):
                weight[tuple(text.split(" "))] = 10**backoff
    return p, weight


@settings(max_examples=60)
@given(corpora, streams, st.integers(1, 4), st.sampled_from([0.5, 0.9, 0.99, 1.0]))
def test_batch_is_the_plain_twin(corpus: list[list[list[str]]], words: list[str], order: int, stay: float) -> None:
    models = models_of(corpus, order)
    recognizer = Recognizer(models, transition=fixed_transition(len(models), stay))
    twin = reference.belief(words, [as_twin(model) for model in models.values()], order, stay)
    assert recognizer.decode(WordStream.of("run", words)).belief == pytest.approx(
        np.array(twin).reshape(len(words), len(models)), abs=1e-12
    )


@settings(max_examples=60)
@given(corpora, streams, st.integers(1, 4), selections)
def test_online_is_batch(corpus: list[list[list[str]]], words: list[str], order: int, selection: Selection) -> None:
    recognizer = Recognizer(models_of(corpus, order), selection=selection)
    batch = recognizer.decode(WordStream.of("run", words))
    for _ in range(2):  # A reset forgets everything.
        recognizer.reset()
        online = [recognizer.update(word) for word in words]
        assert [belief.selected for belief in online] == batch.selected.tolist()
        for belief, row in zip(online, batch.belief, strict=True):
            assert belief.probability == pytest.approx(row, abs=1e-14)


@settings(max_examples=40)
@given(corpora, streams, streams, selections)
def test_later_words_never_change_earlier_beliefs(
    corpus: list[list[list[str]]], words: list[str], later: list[str], selection: Selection
) -> None:
    recognizer = Recognizer(models_of(corpus, 3), selection=selection)
    short = recognizer.decode(WordStream.of("run", words)).belief
    long = recognizer.decode(WordStream.of("run", words + later)).belief
    assert np.array_equal(long[: len(words)], short)


def test_words_that_no_model_lists_hold_the_belief(caplog: pytest.LogCaptureFixture) -> None:
    recognizer = Recognizer(models_of([[["a", "b"]], [["c"]]], 2))
    found = recognizer.decode(WordStream.of("run", ["a", "zebra", "b"]))
    known = recognizer.decode(WordStream.of("run", ["a", "b"]))
    assert found.selected.tolist() == [True, False, True]
    assert np.array_equal(found.belief[[0, 2]], known.belief)
    assert np.array_equal(found.belief[1], found.belief[0])
    assert "run: words that the models do not list: 1 skipped, 'zebra' first" in caplog.text
    with pytest.raises(ModelError, match="the word 'zebra' is not in the models' vocabulary"):
        recognizer.update("zebra")


def test_models_of_different_words_are_refused() -> None:
    models = models_of([[["a"]]], 2) | {
        "other": estimate(count_ngrams([["z"]], 2, markers=False), smoothing("lidstone"), non_events=["</s>"])
    }
    with pytest.raises(ModelError, match=r"^the model of 'place0' lists the word 'a' and that of 'other' does not"):
        Recognizer(models)


def test_transitions_between_other_places_are_refused() -> None:
    with pytest.raises(ModelError, match=r"^transitions between 3 places for 2 models"):
        Recognizer(models_of([[["a"]], [["c"]]], 2), transition=fixed_transition(3))


def timed(words: list[str], times: list[float]) -> WordStream:
    return WordStream.of("run", words, times=times)


@st.composite
def situations(draw: st.DrawFn) -> tuple[dict[str, BackoffModel], Selection, Transition, float | None, WordStream]:
    """Models, a rule, transitions of any kind and unit, perhaps a largest gap, and a stream with unlisted words."""
    models = models_of(draw(corpora), draw(st.integers(1, 3)))
    per: Per = draw(st.sampled_from(get_args(Per)))
    if per == "second":
        transition = fixed_transition(len(models), draw(st.sampled_from([0.5, 0.99, 1.0])), per)
    else:
        kind = draw(transitions(len(models)))
        transition = Transition(kind.matrix, per, kind.change)
    words = draw(st.lists(st.sampled_from([*WORDS, "unlisted"]), max_size=30))
    steps = draw(st.lists(st.sampled_from([0.0, 0.25, 1.0, 7.5]), min_size=len(words), max_size=len(words)))
    gap = draw(st.sampled_from([None, 0.5, 5.0]))
    return models, draw(selections), transition, gap, timed(words, np.cumsum(steps).tolist())


@given(situations())
def test_online_is_batch_for_all_options(
    situation: tuple[dict[str, BackoffModel], Selection, Transition, float | None, WordStream],
) -> None:
    models, selection, transition, gap, stream = situation
    found = Recognizer(models, selection=selection, transition=transition, max_gap=gap)
    batch = found.decode(stream)
    for i, (word, time) in enumerate(zip(stream.words, stream.times.tolist(), strict=True)):
        belief = found.update(word, time) if word in found else found.skip(time)
        assert belief.probability == pytest.approx(batch.belief[i], abs=1e-12)
        assert belief.selected == batch.selected[i]


FAR = Calibration(2.5, 1, 0.0, 0.0)


@given(situations(), st.data())
def test_online_is_batch_for_what_is_asked_beside_the_places(
    situation: tuple[dict[str, BackoffModel], Selection, Transition, float | None, WordStream], data: st.DataObject
) -> None:
    models, selection, transition, gap, stream = situation
    n = len(stream)
    far = data.draw(st.lists(st.sampled_from([math.nan, 0.0, 0.5, 1.5, 9.0]), min_size=n, max_size=n))
    stream = replace(stream, distances=np.array(far, float))
    found = Recognizer(
        models, selection=selection, transition=transition, max_gap=gap, calibration=FAR, unknown=novelty(len(models))
    )
    plain = Recognizer(models, selection=selection, transition=transition, max_gap=gap).decode(stream)
    batch = found.decode(stream)
    assert batch.belief == pytest.approx(FAR.apply(plain.belief), abs=1e-12)
    assert batch.unknown is not None
    for i, (word, time) in enumerate(zip(stream.words, stream.times.tolist(), strict=True)):
        belief = found.update(word, time, far[i]) if word in found else found.skip(time)
        assert belief.probability == pytest.approx(batch.belief[i], abs=1e-10)
        assert belief.unknown == pytest.approx(batch.unknown[i], abs=1e-10)
    # Later words change nothing.
    cut = timed(list(stream.words[: n // 2]), stream.times[: n // 2].tolist())
    earlier = found.decode(replace(cut, distances=stream.distances[: n // 2]))
    assert earlier.unknown is not None
    assert np.array_equal(earlier.unknown, batch.unknown[: n // 2])


def test_what_is_unknown_is_held_smoothed_lagged_and_begins_anew() -> None:
    models = models_of([[["a", "b"]], [["c"]]], 2)
    found = Recognizer(models, selection=Selection("unique"), max_gap=10, unknown=novelty(2))
    bare = timed(["zebra", "a", "a", "c", "a", "zebra", "a"], [0, 1, 2, 3, 4, 60, 61])
    stream = replace(bare, distances=np.array([9, 9, 9, 9, 0.1, 0.1, 9]))
    filtered, smoothed = found.decode(stream).unknown, found.decode(stream, smooth=True).unknown
    assert filtered is not None
    assert smoothed is not None
    assert filtered[[0, 5]] == pytest.approx(1 / 3)
    assert filtered[1] == filtered[2] > 1 / 3
    # Alone after the gap: what one frame says is its evidence and nothing else.
    assert smoothed[[0, 5]] == pytest.approx(1 / 3)
    assert smoothed[6] == pytest.approx(filtered[6])
    assert smoothed[4] == pytest.approx(filtered[4])
    # A near frame comes after frame 3, and a far one after frame 1.
    assert smoothed[3] < filtered[3]
    assert smoothed[1] > filtered[1]
    assert found.decode(stream, lag=0).unknown == pytest.approx(filtered)
    assert found.decode(stream, lag=9).unknown == pytest.approx(smoothed)
    path = found.decode(stream, viterbi=True)
    assert path.unknown is not None
    assert np.array_equal(path.unknown, filtered)
    assert [best == "unknown" for best in path.best] == (filtered > 0.5).tolist()
    assert "unknown" in path.best
    found.reset()
    found.update("a", 0, 9.0)
    assert found.update("c", 1, 9.0).best == "unknown"


@settings(max_examples=25)
@given(situations(), st.integers(0, 40))
def test_lags_go_from_the_filter_to_smoothing(
    situation: tuple[dict[str, BackoffModel], Selection, Transition, float | None, WordStream], lag: int
) -> None:
    models, selection, transition, gap, stream = situation
    found = Recognizer(models, selection=selection, transition=transition, max_gap=gap)
    filtered, smoothed = found.decode(stream), found.decode(stream, smooth=True)
    assert found.decode(stream, lag=0).belief == pytest.approx(filtered.belief, abs=1e-11)
    assert found.decode(stream, lag=len(stream)).belief == pytest.approx(smoothed.belief, abs=1e-11)
    lagged = found.decode(stream, lag=lag).belief
    for i in range(len(stream)):
        cut = timed(list(stream.words[: i + lag + 1]), stream.times[: i + lag + 1].tolist())
        assert lagged[i] == pytest.approx(found.decode(cut, smooth=True).belief[i], abs=1e-11)
    path = found.decode(stream, viterbi=True)
    assert np.array_equal(path.belief, filtered.belief)
    # A gap begins anew, with no word of its own.
    changes = [a == b for a, b in zip(path.best, path.best[1:], strict=False)].count(False)
    assert changes <= path.selected.sum() or gap is not None


def test_a_gap_begins_a_new_sequence(caplog: pytest.LogCaptureFixture) -> None:
    models = models_of([[["a", "b", "a"]], [["c", "d"]]], 3)
    words, times = ["a", "b", "b", "b", "c"], [0.0, 1.0, 2.0, 62.0, 63.0]
    found = Recognizer(models, selection=Selection("unique"), max_gap=10)
    with caplog.at_level(logging.INFO):
        whole = found.decode(timed(words, times))
    assert "run: gaps of more than 10 s: 1" in caplog.text
    # The word after the gap is selected though it is the one before, and has no context.
    assert whole.selected.tolist() == [True, True, False, True, True]
    assert np.array_equal(whole.belief[:3], found.decode(timed(words[:3], times[:3])).belief)
    assert np.array_equal(whole.belief[3:], found.decode(timed(words[3:], times[3:])).belief)
    for word, time, row in zip(words, times, whole.belief, strict=True):
        with caplog.at_level(logging.INFO):
            assert found.update(word, time).probability == pytest.approx(row, abs=1e-14)
    assert "60 s without a frame: a new sequence begins" in caplog.text


def test_frames_without_a_word_count_as_time() -> None:
    models = models_of([[["a"]], [["c"]]], 1)
    stay = 0.9
    after = {per: Recognizer(models, transition=fixed_transition(2, stay, per)) for per in ("update", "frame")}
    for one in after.values():
        one.update("a")
        one.skip()
        one.skip()
        one.update("c")
    once = Recognizer(models, transition=fixed_transition(2, stay))
    cubed = Recognizer(models, transition=Transition(np.linalg.matrix_power(fixed_transition(2, stay).matrix, 3)))
    for expected, found in ((once, after["update"]), (cubed, after["frame"])):
        expected.update("a")
        assert found.belief().probability == pytest.approx(expected.update("c").probability, abs=1e-14)


@pytest.mark.parametrize("options", [{"max_gap": 2.0}, {"transition": fixed_transition(2, per="second")}])
def test_times_that_are_needed_must_be_there(options: dict[str, object]) -> None:
    found = Recognizer(models_of([[["a"]], [["c"]]], 2), **options)  # type: ignore[arg-type]
    with pytest.raises(StreamError, match=r"^run: frame '1' has no time, which "):
        found.decode(timed(["a", "c"], [0.0, math.nan]))
    with pytest.raises(StreamError, match=r"^run: time goes back from 5\.000000 to 4\.000000 s at frame '2'"):
        found.decode(timed(["a", "c", "a"], [0.0, 5.0, 4.0]))
    before = found.update("a", 5.0).probability
    with pytest.raises(ModelError, match=r"^the frame has no time, which "):
        found.update("c")
    with pytest.raises(ModelError, match=r"^time goes back from 5\.000000 to 4\.000000 s"):
        found.update("c", 4.0)
    assert np.array_equal(found.belief().probability, before)
    assert found.skip().probability == pytest.approx(before)


def test_times_that_are_not_needed_may_be_anything() -> None:
    found = Recognizer(models_of([[["a"]], [["c"]]], 2))
    assert len(found.decode(timed(["a", "c", "a"], [5.0, math.nan, 1.0])).best) == 3
    for time in (5.0, math.nan, None, 1.0):
        found.update("a", time)


@settings(max_examples=40)
@given(corpora, streams, st.permutations(WORDS))
def test_permuted_words_change_nothing(corpus: list[list[list[str]]], words: list[str], order: list[str]) -> None:
    other = dict(zip(WORDS, order, strict=True))
    renamed = [[[other[word] for word in visit] for visit in place] for place in corpus]
    found = Recognizer(models_of(corpus, 3)).decode(WordStream.of("run", words)).belief
    again = Recognizer(models_of(renamed, 3)).decode(WordStream.of("run", [other[word] for word in words])).belief
    assert again == pytest.approx(found, abs=1e-6)  # Models hold single precision.


@settings(max_examples=40)
@given(corpora, streams, st.data())
def test_permuted_places_permute_the_columns(
    corpus: list[list[list[str]]], words: list[str], data: st.DataObject
) -> None:
    models = models_of(corpus, 2)
    order = data.draw(st.permutations(range(len(models))))
    counts = np.random.default_rng(len(words)).integers(0, 9, (len(models), len(models)))
    places = list(models)
    straight = Recognizer(models, transition=learned_transition(counts))
    permuted = Recognizer(
        {places[i]: models[places[i]] for i in order}, transition=learned_transition(counts[np.ix_(order, order)])
    )
    for options in ({}, {"smooth": True}, {"lag": 2}):
        expected = straight.decode(WordStream.of("run", words), **options).belief[:, order]
        assert permuted.decode(WordStream.of("run", words), **options).belief == pytest.approx(expected, abs=1e-12)


@settings(max_examples=40)
@given(corpora, st.lists(st.tuples(st.sampled_from(WORDS), st.integers(1, 5)), max_size=12))
def test_unique_is_blind_to_a_robot_that_stands_still(
    corpus: list[list[list[str]]], runs: list[tuple[str, int]]
) -> None:
    found = Recognizer(models_of(corpus, 3), selection=Selection("unique"))
    once = found.decode(WordStream.of("run", [word for word, _ in runs])).belief
    often = found.decode(WordStream.of("run", [word for word, length in runs for _ in range(length)])).belief
    assert np.array_equal(often, np.repeat(once, [length for _, length in runs], axis=0))


def test_scorers_of_their_own_give_the_same() -> None:
    models = models_of([[["a", "b", "c"]], [["c", "d"]]], 3)
    words = ["a", "b", "c", "c", "d", "a", "b"]
    separate = SeparateEmissions([model.score for model in models.values()], 3)
    one, other = Recognizer(models), Recognizer(models, emissions=separate)
    stream = WordStream.of("run", words)
    assert np.array_equal(one.decode(stream).belief, other.decode(stream).belief)
    for word in words:
        assert np.array_equal(one.update(word).probability, other.update(word).probability)


def test_memory_does_not_grow_with_the_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(filter, "PREDICTORS", 5)
    found = Recognizer(models_of([[["a", "b"]], [["c"]]], 3), transition=fixed_transition(2, per="second"))
    for i in range(40):
        found.update(WORDS[i % 4], i**2 / 7)
        assert len(found._filter._predictors) <= 5


def test_what_decides_cannot_be_assigned_but_changed_in_a_copy() -> None:
    """Once assigned, the transitions were those of `decode`, and `update` went on with the former ones."""
    models = models_of([[["a", "b", "b"]], [["c", "a"]]], 2)
    recognizer = Recognizer(models)
    stream = timed(["a", "c", "b", "a"], [0, 1, 2, 30])
    for name in ("places", "selection", "transition", "dictionary", "max_gap", "emissions", "calibration", "unknown"):
        remedy = "" if name == "places" else rf"; changed\({name}=\.\.\.\) gives another one"
        with pytest.raises(AttributeError, match=rf"^{name} of a Recognizer is fixed{remedy}$"):
            setattr(recognizer, name, None)
    recognizer.update("a")
    settings: list[dict[str, Any]] = [
        {"transition": fixed_transition(2, 0.6)},
        {"selection": Selection("subsample", 2), "max_gap": 5.0},
        {"calibration": FAR, "unknown": novelty(2)},
        {"emissions": recognizer.changed(transition=fixed_transition(2, 0.7)).emissions},
    ]
    for setting in settings:
        changed, made = recognizer.changed(**setting), Recognizer(models, **setting)
        expected = made.decode(stream)
        for found in (changed.decode(stream), SequenceDecoder.decode(changed, stream)):
            assert found.belief == pytest.approx(expected.belief, abs=1e-14)
            assert found.unknown == (None if expected.unknown is None else pytest.approx(expected.unknown, abs=1e-12))
    # The recognizer itself goes on as if nothing had happened.
    assert np.array_equal(recognizer.belief().probability, Recognizer(models).update("a").probability)
    with pytest.raises(ModelError, match=r"^transitions between 3 places for 2 models"):
        recognizer.changed(transition=fixed_transition(3))
    with pytest.raises(TypeError, match=r"^'models' is no setting of a Recognizer: selection, transition, dict"):
        recognizer.changed(models=models)


@pytest.mark.parametrize("path", ["frame.png", "run/000001", "run\\1", Path("run/frame.JPG")])
def test_the_path_of_an_image_is_no_word(path: str | Path) -> None:
    recognizer = Recognizer(models_of([[["a"]], [["c"]]], 2))
    with pytest.raises(
        ModelError, match=rf"; for an image, give its grey levels: read_gray\({re.escape(repr(str(path)))}"
    ):
        recognizer.update(path)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"^the word 'frame' is not in the models' vocabulary$"):
        recognizer.update("frame")


def test_the_repr_says_what_it_is_in_one_line() -> None:
    models = models_of([[["a"]]] * 4, 2)
    recognizer = Recognizer(models, transition=fixed_transition(4, per="frame"), max_gap=10)
    assert repr(recognizer) == (
        "Recognizer(4 places: place0, place1, place2, place3; 4 words; transitions per frame, selection none, "
        "gaps above 10 s)"
    )
    assert repr(recognizer.update("a", 0.0)) == "Belief('place0', 0.25, word='a')"
    asked = recognizer.changed(unknown=UnknownModel(4, 0.5, None)).update("a", 0.0)
    assert repr(asked) == f"Belief('place0', 0.25, unknown {asked.unknown:.3g}, word='a')"
    assert repr(recognizer.transition) == "Transition(4 places, per frame)"


@pytest.mark.parametrize(("unknown", "best"), [(None, "a"), (0.5, "a"), (np.nextafter(0.5, 1), "unknown")])
def test_a_new_place_is_best_above_one_half(unknown: float | None, best: str) -> None:
    assert Belief(("a", "b"), np.array([0.5, 0.5]), "w", True, unknown).best == best
