"""The filter: worked by hand, equal to the plain twin, the same on-line, and never NaN."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from placerec import reference
from placerec.errors import ModelError
from placerec.hohmm import Recognizer, filter_stream, fixed_transition
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.words import Selection, WordStream

WORDS = ["a", "b", "c", "d"]
streams = st.lists(st.sampled_from(WORDS), max_size=30)
corpora = st.lists(st.lists(st.lists(st.sampled_from(WORDS), max_size=6), max_size=4), min_size=1, max_size=4)
selections = st.sampled_from([Selection(), Selection("subsample", 3), Selection("compress", 2), Selection("unique")])


def models_of(corpus: list[list[list[str]]], order: int) -> dict[str, BackoffModel]:
    return {
        f"place{i}": estimate(
            count_ngrams(sentences, order, vocabulary=WORDS, markers=False),
            smoothing("witten-bell"),
            non_events=["</s>"],
        )
        for i, sentences in enumerate(corpus)
    }


def as_twin(model: BackoffModel) -> reference.Model:
    """The very numbers of a model, for the plain twin."""
    p: dict[tuple[str, ...], float] = {}
    weight: dict[tuple[str, ...], float] = {}
    for n in range(1, model.order + 1):
        for text, log10_p, backoff in zip(
            model.trie.texts(n), model.log10_ps[n - 1].tolist(), model.backoffs[n - 1].tolist(), strict=True
        ):
            p[tuple(text.split(" "))] = 10**log10_p
            if not math.isnan(backoff):
                weight[tuple(text.split(" "))] = 10**backoff
    return p, weight


def test_two_steps_by_hand() -> None:
    # Uniform start, no prediction before the first word: 0.8 : 0.2 becomes 0.8, 0.2.
    # Prediction with stay 0.9: 0.9 * 0.8 + 0.1 * 0.2 = 0.74; then 0.74 * 0.1 : 0.26 * 0.5 = 0.074 : 0.13.
    log10_p = np.log10([[0.8, 0.2], [0.1, 0.5]])
    found = filter_stream(log10_p, fixed_transition(2, 0.9)).belief
    assert found == pytest.approx(np.array([[0.8, 0.2], [0.074 / 0.204, 0.13 / 0.204]]), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(corpora, streams, st.integers(1, 4), st.sampled_from([0.5, 0.9, 0.99, 1.0]))
def test_batch_is_the_plain_twin(corpus: list[list[list[str]]], words: list[str], order: int, stay: float) -> None:
    models = models_of(corpus, order)
    recognizer = Recognizer(models, transition=fixed_transition(len(models), stay))
    twin = reference.belief(words, [as_twin(model) for model in models.values()], order, stay)
    assert recognizer.decode(WordStream.of("run", words)).belief == pytest.approx(
        np.array(twin).reshape(len(words), len(models)), abs=1e-12
    )


@settings(max_examples=60, deadline=None)
@given(corpora, streams, st.integers(1, 4), selections)
def test_online_is_batch(corpus: list[list[list[str]]], words: list[str], order: int, selection: Selection) -> None:
    recognizer = Recognizer(models_of(corpus, order), selection=selection)
    batch = recognizer.decode(WordStream.of("run", words))
    for _ in range(2):  # A reset forgets everything.
        recognizer.reset()
        online = [recognizer.update(word) for word in words]
        assert [belief.selected for belief in online] == batch.selected.tolist()
        assert [belief.best for belief in online] == list(batch.best)
        for belief, row in zip(online, batch.belief, strict=True):
            assert belief.probability == pytest.approx(row, abs=1e-14)


@settings(max_examples=40, deadline=None)
@given(corpora, streams, streams, selections)
def test_later_words_never_change_earlier_beliefs(
    corpus: list[list[list[str]]], words: list[str], later: list[str], selection: Selection
) -> None:
    recognizer = Recognizer(models_of(corpus, 3), selection=selection)
    short = recognizer.decode(WordStream.of("run", words)).belief
    long = recognizer.decode(WordStream.of("run", words + later)).belief
    assert np.array_equal(long[: len(words)], short)


@given(st.integers(0, 5), st.lists(st.sampled_from([-math.inf, -500.0, -3.0, 0.0]), min_size=12, max_size=12))
def test_never_nan(places: int, values: list[float]) -> None:
    log10_p = np.array(values).reshape(4, 3)
    for stay in (0.0, 1 / 3, 0.99, 1.0):
        found = filter_stream(log10_p, fixed_transition(3, stay))
        assert np.isfinite(found.belief).all()
        assert found.belief.sum(axis=1) == pytest.approx(np.ones(4))


def test_where_no_place_explains_the_word_the_prediction_is_kept() -> None:
    log10_p = np.array([[-1.0, -2.0], [-np.inf, -np.inf]])
    found = filter_stream(log10_p, fixed_transition(2, 0.9))
    first = np.array([10, 1]) / 11
    assert found.unexplained == 1
    assert found.belief[1] == pytest.approx(0.9 * first + 0.1 * first[::-1])


def test_bounds_of_the_prediction() -> None:
    # readings 1.3: after a prediction every place has at least (1 - p_e) / (C - 1), and none more than p_e.
    transition = fixed_transition(5, 0.99)
    sure = np.array([1 - 4e-12, 1e-12, 1e-12, 1e-12, 1e-12])
    predicted = sure @ transition.over(1)
    assert predicted.min() >= 0.0025 - 1e-12
    assert predicted.max() <= 0.99


def test_staying_at_chance_forgets_and_staying_for_certain_multiplies() -> None:
    log10_p = np.log10([[0.9, 0.1], [0.2, 0.8], [0.5, 0.3]])
    forgets = filter_stream(log10_p, fixed_transition(2, 0.5)).belief[-1]
    assert forgets == pytest.approx(np.array([5, 3]) / 8)
    product = np.prod(10**log10_p, axis=0)
    assert filter_stream(log10_p, fixed_transition(2, 1.0)).belief[-1] == pytest.approx(product / product.sum())


def test_one_place_is_certain() -> None:
    assert filter_stream(np.full((3, 1), -2.0), fixed_transition(1)).belief.tolist() == [[1.0]] * 3


def test_permuted_places_permute_beliefs() -> None:
    models = models_of([[["a", "b"]], [["c"]], [["d", "a"]]], 2)
    words = ["a", "c", "c", "a", "d"]
    straight = Recognizer(models).decode(WordStream.of("run", words)).belief
    backwards = Recognizer(dict(reversed(models.items()))).decode(WordStream.of("run", words)).belief
    assert backwards[:, ::-1] == pytest.approx(straight, abs=1e-14)


def test_standing_still_changes_nothing_under_unique() -> None:
    models = models_of([[["a", "b", "c"]], [["c", "d"]]], 2)
    recognizer = Recognizer(models, selection=Selection("unique"))
    once = recognizer.decode(WordStream.of("run", ["a", "c", "d"])).belief
    thrice = recognizer.decode(WordStream.of("run", ["a"] * 3 + ["c"] * 3 + ["d"] * 3)).belief
    assert np.array_equal(thrice[2::3], once)


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


def test_wrong_transitions_are_refused() -> None:
    with pytest.raises(ModelError, match=r"^stay probability 1\.5 is not between 0 and 1"):
        fixed_transition(3, 1.5)
