"""Explanations: the numbers are the filter's and the models' own, and contributions are what they are said to be."""

import math
from typing import Any

import numpy as np
import pytest
from helpers.filter_cases import cases
from helpers.small_models import WORDS, models_of, novelty, selections
from hypothesis import given, settings, strategies as st

from placerec.errors import ModelError
from placerec.hohmm import Recognizer, Transition, explain, filter_stream, fixed_transition
from placerec.hohmm.evidence import Evidence
from placerec.hohmm.explain import WINDOW, contributions
from placerec.hohmm.prediction import predicted_beliefs
from placerec.words import Selection, WordStream

CORPUS = [[["a", "b", "a", "b", "b"]], [["c", "d", "c"]], [["a", "d"], ["b"]]]


@settings(max_examples=30)
@given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=30), st.integers(1, 4), selections)
def test_the_numbers_are_those_of_the_filter_and_the_models(words: list[str], order: int, selection: Selection) -> None:
    models = models_of(CORPUS, order)
    recognizer = Recognizer(models, explain=True, selection=selection)
    stream = WordStream.of("run", words)
    beliefs = recognizer.decode(stream)
    found = list(recognizer.explain_stream(stream))
    at = np.flatnonzero(beliefs.selected).tolist()
    assert [one["frame"] for one in found] == [beliefs.frames[i] for i in at]
    before = [1 / 3] * 3
    chosen = [words[i] for i in at]
    for t, (i, one) in enumerate(zip(at, found, strict=True)):
        assert (one["word"], one["best"]) == (words[i], beliefs.best[i])
        assert one["history"] == chosen[max(0, t - order + 1) : t]
        places = one["places"]
        assert [place["after"] for place in places.values()] == pytest.approx(beliefs.belief[i], rel=1e-5, abs=1e-300)
        assert [place["before"] for place in places.values()] == pytest.approx(before, rel=1e-5)
        before = list(beliefs.belief[i] @ recognizer.transition.matrix)
        for name, place in places.items():
            assert place["log10_p"] == pytest.approx(models[name].log10_p(words[i], one["history"]), rel=1e-5)
            assert len(place["backoffs"]) == len(one["history"]) + 1 - place["order"]
            answer = [*one["history"], words[i]][-place["order"] :]
            listed = models[name].trie.texts(place["order"]).index(" ".join(answer))
            paid = place["log10_p"] - float(models[name].log10_probs[place["order"] - 1][listed])
            assert sum(place["backoffs"]) == pytest.approx(paid, abs=1e-4)


def evidence(log10_p: Any, elapsed: Any) -> Evidence:
    n = len(log10_p)
    return Evidence(np.ones(n, bool), np.arange(n), log10_p[None], elapsed)


def both(log10_p: Any, transition: Transition, elapsed: Any) -> tuple[Any, Any]:
    after = filter_stream(log10_p, transition, elapsed).belief
    return predicted_beliefs(after, transition, elapsed), after


@settings(max_examples=50)
@given(st.lists(st.tuples(*[st.floats(-3, 0)] * 3), min_size=1, max_size=8), st.floats(0.4, 0.999), st.data())
def test_contributions_are_the_derivatives_of_the_odds(
    rows: list[tuple[float, float, float]], stay: float, data: st.DataObject
) -> None:
    log10_p, transition = np.array(rows), fixed_transition(3, stay)
    T = len(rows)
    elapsed = np.array(data.draw(st.lists(st.integers(0, 3), min_size=T, max_size=T)), float)
    pair = np.tile([2, 0], (T, 1))
    (found,) = contributions(evidence(log10_p, elapsed), transition, *both(log10_p, transition, elapsed), pair)
    nudge = 1e-4
    for s in range(T):
        odds = []
        for factor in (1 - nudge, 1 + nudge):
            changed = log10_p.copy()
            changed[s] *= factor
            last = filter_stream(changed, transition, elapsed).belief[-1]
            odds.append(math.log10(last[2] / last[0]))
        assert found[T - 1, T - 1 - s] == pytest.approx((odds[1] - odds[0]) / (2 * nudge), abs=1e-5)


def test_without_changes_of_place_contributions_are_likelihood_ratios() -> None:
    rng = np.random.default_rng(0)
    log10_p, elapsed = -rng.random((30, 2)), np.ones(30)
    still = Transition(np.eye(2))
    (found,) = contributions(
        evidence(log10_p, elapsed), still, *both(log10_p, still, elapsed), np.tile([0, 1], (30, 1))
    )
    ratios = log10_p[:, 0] - log10_p[:, 1]
    for t in range(30):
        assert found[t] == pytest.approx([ratios[t - k] if k <= t else 0 for k in range(WINDOW)], abs=1e-9)


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    log10_p, elapsed, transition = -3 * rng.random((70, 3)), np.ones(70), fixed_transition(3, 0.9)
    case = (
        evidence(log10_p, elapsed),
        transition,
        *both(log10_p, transition, elapsed),
        np.tile([0, 1], (70, 1)),
    )
    whole = contributions(*case)
    monkeypatch.setattr(explain, "CHUNK", 7)
    assert np.array_equal(contributions(*case), whole)


@given(cases())
def test_contributions_are_finite_whatever_is_impossible(case: Any) -> None:
    log10_p, transition, _ = case
    places = log10_p.shape[1]
    pair = np.zeros((len(log10_p), 2), np.int64)
    pair[:, 1] = places - 1
    found = contributions(
        evidence(log10_p, case.steps),
        transition,
        *both(log10_p, transition, case.steps),
        pair[:, : min(places, 2)],
    )
    assert np.isfinite(found).all()


def test_words_argue_once_each_the_strongest_first() -> None:
    models = models_of(CORPUS, 1)
    recognizer = Recognizer(models, explain=True)
    last = list(recognizer.explain_stream(WordStream.of("run", ["a", "b", "c", "a", "b"])))[-1]
    assert (last["best"], last["rival"]) == ("place0", "place2")
    found = {side: [(one["word"], one["frames"]) for one in last[side]] for side in ("for", "against")}
    assert found["for"] == [("b", ["1", "4"]), ("a", ["0", "3"])]
    strengths = [one["log10_odds"] for one in last["for"]]
    assert strengths == sorted(strengths, reverse=True)
    turned = list(recognizer.explain_stream(WordStream.of("run", ["a", "a", "c", "c", "d"])))[-1]
    assert turned["best"] == "place1"
    assert turned["for"][0]["word"] == "c"
    assert [one["word"] for one in turned["against"]] == ["a"]
    assert turned["against"][0]["log10_odds"] < 0


def test_one_place_has_no_rival() -> None:
    models = models_of(CORPUS[:1], 2)
    (only,) = list(Recognizer(models, explain=True).explain_stream(WordStream.of("run", ["a"])))
    assert (only["rival"], only["for"], only["against"]) == (None, [], [])


def test_what_speaks_for_a_new_place_is_told_too() -> None:
    models = models_of(CORPUS, 2)
    recognizer = Recognizer(models, explain=True, unknown=novelty(3))
    stream = WordStream.of("run", ["a", "b", "c"], distances=[0.5, 9.0, np.nan])
    unknown = recognizer.decode(stream).unknown
    found = [one["unknown"] for one in list(recognizer.explain_stream(stream))]
    assert [one["after"] for one in found] == pytest.approx(unknown, rel=1e-5)
    assert found[0]["before"] == pytest.approx(1 / 4)
    for one in found:
        odds = [p / (1 - p) for p in (one["before"], one["after"])]
        assert math.log10(odds[1] / odds[0]) == pytest.approx(one["log10_ratio"], abs=1e-4)
    assert found[1]["log10_ratio"] > 0


def test_a_sequence_without_a_listed_word_decides_nothing() -> None:
    models = models_of(CORPUS, 2)
    for transition in (fixed_transition(3), Transition(np.full((3, 3), 1 / 3))):
        recognizer = Recognizer(models, explain=True, transition=transition, unknown=novelty(3))
        stream = WordStream.of("run", ["zebra", "zebra"])
        assert list(recognizer.explain_stream(stream)) == []
        assert recognizer.decode(stream).unknown == pytest.approx([0.25, 0.25])
        assert recognizer.decode(stream, smooth=True).unknown == pytest.approx([0.25, 0.25])


@given(st.lists(st.sampled_from([*WORDS, "unlisted"]), max_size=60), st.integers(1, 3), selections, st.booleans())
def test_a_robot_is_told_what_a_recording_is_told(
    words: list[str], order: int, selection: Selection, asks_unknown: bool
) -> None:
    unknown = novelty(3) if asks_unknown else None
    recognizer = Recognizer(models_of(CORPUS, order), selection=selection, unknown=unknown, explain=True)
    stream = WordStream.of("run", words, times=np.arange(len(words)) / 4, distances=np.arange(len(words)) % 3 / 2)
    expected = {one["frame"]: one for one in recognizer.explain_stream(stream)}
    for frame, time, word, distance in zip(stream.frames, stream.times, words, stream.distances, strict=True):
        belief = recognizer.update(word, time, distance) if word in recognizer else recognizer.skip(time)
        if belief.selected:
            found, told = recognizer.explain(), expected.pop(frame)
            for one in (found, told):
                numbers = [[row.pop(name) for name in ("log10_p", "before", "after")] for row in one["places"].values()]
                numbers += [[*one.pop("unknown", {}).values()]]
                numbers += [[argument.pop("log10_odds") for argument in (*one["for"], *one["against"])]]
                one["numbers"] = [number for row in numbers for number in row]
            assert found.pop("numbers") == pytest.approx(told.pop("numbers"), rel=1e-4, abs=1e-5)
            assert found == told
    assert not expected


def test_who_keeps_nothing_cannot_explain() -> None:
    models = models_of(CORPUS, 2)
    with pytest.raises(ModelError, match=r"^no word was selected yet"):
        Recognizer(models, explain=True).explain()
    recognizer = Recognizer(models)
    recognizer.update("a")
    for ask in (recognizer.explain, lambda: next(recognizer.explain_stream(WordStream.of("run", ["a"])))):
        with pytest.raises(ModelError, match=r"^this recognizer keeps nothing to explain with; make it with explain="):
            ask()
