"""Words of several dictionaries in one filter: on-line and off-line agree, and alpha weighs each word."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from helpers.several_dictionaries import FURTHER, several_words, words_in
from helpers.small_models import selections
from helpers.small_world import PLACES, VOCABULARY
from hypothesis import given, settings, strategies as st

from placerec.errors import ModelError
from placerec.evaluation.metrics import evaluate
from placerec.hohmm import Recognizer, filter_stream, learned_transition
from placerec.hohmm.evidence import DictionaryModels, evidence_in
from placerec.hohmm.unknown import UnknownModel
from placerec.hohmm.weights import (
    ALPHAS,
    MEMORIES,
    HeldOut,
    ViewWorth,
    Weights,
    choose_weights,
    losses,
    shares_of,
)
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.lm.backoff import unite_models
from placerec.words import Selection, WordStream, sentences_per_place
from placerec.words.stream import FIRST, WordColumn

TRAINING = [several_words(f"run{seed}", seed) for seed in (1, 2, 3)]
STEPS = np.array([[30, 2, 1], [1, 40, 3], [2, 1, 25]])
SHARES = shares_of(np.array([60, 80, 40]))


def models_in(dictionary: str, words: Sequence[str]) -> dict[str, BackoffModel]:
    """A model of each place over the words of a dictionary."""
    sentences = sentences_per_place([stream.in_dictionary(dictionary) for stream in TRAINING], Selection())
    counts = {place: count_ngrams(sentences[place], 2, vocabulary=words, markers=False) for place in PLACES}
    return {place: estimate(counts[place], smoothing("witten-bell"), non_events=("</s>",)) for place in PLACES}


FIRST_MODELS = models_in(FIRST, VOCABULARY)
FURTHER_MODELS = {name: models_in(name, words_in(name)) for name in FURTHER}


def recognizer(**settings_: object) -> Recognizer:
    """A recognizer of three dictionaries."""
    given_: dict[str, object] = {"transition": learned_transition(STEPS, 0.03, SHARES), "alpha": 0.25}
    return Recognizer(FIRST_MODELS, further=FURTHER_MODELS, **(given_ | settings_))  # type: ignore[arg-type]


def given_words(stream: WordStream) -> list[tuple[str, ...]]:
    """The words of each frame in all dictionaries."""
    return list(zip(*(stream.in_dictionary(name).words for name in stream.dictionaries), strict=True))


@settings(max_examples=30, deadline=None)
@given(
    st.integers(4, 30), selections, st.sampled_from([0.02, 0.25, 1.0]), st.sampled_from([0.0, 0.1, 1.0]), st.booleans()
)
def test_online_is_batch(seed: int, selection: Selection, alpha: float, memory: float, asked: bool) -> None:
    unknown = [UnknownModel(12, 0.7, None), UnknownModel(9, 0.5, None), UnknownModel(6, 0.9, None)] if asked else None
    transition = learned_transition(STEPS, memory, SHARES)
    made = recognizer(selection=selection, alpha=alpha, transition=transition, unknown=unknown)
    stream = several_words("test", seed, 24)
    batch = made.decode(stream)
    made.reset()
    online = [made.update(words) for words in given_words(stream)]
    assert [belief.selected for belief in online] == batch.selected.tolist()
    for belief, row in zip(online, batch.belief, strict=True):
        assert belief.probability == pytest.approx(row, abs=1e-12)
    if asked:
        assert batch.unknown is not None
        assert [belief.unknown for belief in online] == pytest.approx(batch.unknown.tolist(), abs=1e-12)


@given(st.permutations(range(3)))
def test_the_order_in_which_the_words_of_a_frame_are_given_does_not_count(order: list[int]) -> None:
    made, other = recognizer(), recognizer()
    for words in given_words(several_words("test", 5, 12)):
        belief = other.update([words[k] for k in order]).probability
        assert made.update(words).probability.tobytes() == belief.tobytes()


def test_the_belief_is_the_prediction_times_all_words_to_the_power_of_alpha() -> None:
    stream = several_words("test", 7)
    transition = learned_transition(STEPS, 0.1, SHARES)
    found = recognizer(alpha=0.4, transition=transition).decode(stream).belief
    log10_p = sum(
        unite_models([*models.values()]).score(stream.in_dictionary(name).words)
        for name, models in {FIRST: FIRST_MODELS, **FURTHER_MODELS}.items()
    )
    belief = np.full(3, 1 / 3)
    for t, row in enumerate(np.asarray(log10_p)):
        if t:
            remembered = belief @ learned_transition(STEPS).matrix
            belief = 0.9 * remembered + 0.1 * SHARES
        belief = belief * 10 ** (0.4 * row)
        belief /= belief.sum()
        assert found[t] == pytest.approx(belief, abs=1e-12)


def test_one_dictionary_and_alpha_1_are_the_filter_of_the_paper() -> None:
    stream = several_words("test", 8).in_dictionary(FIRST)
    plain = Recognizer(FIRST_MODELS, transition=learned_transition(STEPS))
    log10_p = unite_models([*FIRST_MODELS.values()]).score(stream.words)
    expected = filter_stream(log10_p, learned_transition(STEPS)).belief
    assert plain.decode(stream).belief.tobytes() == expected.tobytes()
    assert plain.changed(alpha=1.0).decode(stream).belief.tobytes() == expected.tobytes()


def test_a_dictionary_that_a_stream_has_no_words_of_is_silent(caplog: pytest.LogCaptureFixture) -> None:
    stream = several_words("test", 9)
    with caplog.at_level(logging.WARNING):
        found = recognizer().decode(stream.in_dictionary(FIRST)).belief
    assert "test: has no column word.plain20, word.pn10; what there is decides alone" in caplog.text
    alone = Recognizer(FIRST_MODELS, alpha=0.25, transition=learned_transition(STEPS, 0.03, SHARES))
    assert found == pytest.approx(alone.decode(stream.in_dictionary(FIRST)).belief, abs=1e-15)


def test_words_that_are_not_listed_are_left_out_and_the_others_count(caplog: pytest.LogCaptureFixture) -> None:
    stream = several_words("test", 10)
    strange = ("strange", *stream.further["pn10"].words[1:])
    further = dict(stream.further) | {"pn10": WordColumn(strange, stream.further["pn10"].distances)}
    mixed = WordStream(stream.name, stream.table, stream.words, stream.distances, further)
    with caplog.at_level(logging.WARNING):
        batch = recognizer().decode(mixed)
    assert "1 skipped, 'strange' first" in caplog.text
    made = recognizer()
    online = [made.answer(words) for words in given_words(mixed)]
    for belief, row in zip(online, batch.belief, strict=True):
        assert belief.probability == pytest.approx(row, abs=1e-12)
    with pytest.raises(ModelError, match="'strange' is not in the models' vocabulary"):
        made.update(("w01", "strange"))
    with pytest.raises(ModelError, match="are of one dictionary; give one a frame"):
        made.update(("w01", "w02"))


def test_what_cannot_be_one_recognizer_is_refused() -> None:
    with pytest.raises(ModelError, match="the word 'w00' of the dictionary 'again' is one of another, too"):
        Recognizer(FIRST_MODELS, further={"again": FIRST_MODELS})
    with pytest.raises(ModelError, match="'pn10' are of other places"):
        Recognizer(FIRST_MODELS, further={"pn10": {"hall": FURTHER_MODELS["pn10"]["hall"]}})
    for alpha in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(ModelError, match="is no exponent above 0"):
            recognizer(alpha=alpha)


def test_a_decision_names_the_words_of_all_dictionaries() -> None:
    made = recognizer(explain=True)
    stream = several_words("test", 11)
    for words in given_words(stream):
        made.update(words)
    last, batch = made.explain(), list(made.explain_stream(stream))
    assert len(batch) == len(stream)
    assert last["dictionaries"] == batch[-1]["dictionaries"]
    assert list(last["dictionaries"]) == ["word", "word.plain20", "word.pn10"]
    total = sum(one["places"]["hall"]["log10_p"] for one in last["dictionaries"].values())
    assert last["places"]["hall"]["log10_p"] == pytest.approx(0.25 * total, rel=1e-4)
    named = {one["word"].partition(".")[0] for side in ("for", "against") for one in last[side]}
    assert named <= {"plain20", "pn10", *VOCABULARY}
    assert named


def held(stream: WordStream) -> HeldOut:
    """A run as the models of the training runs see it."""
    every = {FIRST: FIRST_MODELS, **FURTHER_MODELS}
    dictionaries = [
        DictionaryModels(name, unite_models([*models.values()]), frozenset(next(iter(models.values())).words))
        for name, models in every.items()
    ]
    (part,) = evidence_in(stream, dictionaries, selection=Selection(), per="frame", max_gap=None)
    return HeldOut(part, stream.table.places.codes(PLACES), STEPS, SHARES)


@pytest.mark.parametrize(("memory", "alpha"), [(0.0, 1.0), (0.1, 0.25), (1.0, 0.04), (0.003, 1.5)])
def test_the_loss_of_weights_is_the_log_loss_of_decoding_with_them(memory: float, alpha: float) -> None:
    stream = several_words("test", 12)
    loss = losses(held(stream))[MEMORIES.index(memory), ALPHAS.index(alpha)]
    made = recognizer(alpha=alpha, transition=learned_transition(STEPS, memory, SHARES))
    assert loss / len(stream) == pytest.approx(evaluate([made.decode(stream)]).log_loss, rel=1e-9)


def test_the_weights_with_the_least_loss_are_chosen() -> None:
    sequences = [held(several_words("a", 13)), held(several_words("b", 14))]
    total = np.sum([losses(one) for one in sequences], axis=0)
    found = choose_weights(sequences, 3)
    assert total[MEMORIES.index(found.memory), ALPHAS.index(found.alpha)] == total.min()
    assert found.frames == 120
    assert found.log_loss == pytest.approx(total.min() / 120, rel=1e-5)
    assert found.unweighted == pytest.approx(total[0, ALPHAS.index(1.0)] / 120, rel=1e-5)


def test_it_is_told_what_the_words_of_each_view_are_worth() -> None:
    one, two, three = (
        replace(held(several_words(name, 13 + group)), group=group, views=("plain", "plain", "pn"))
        for group, name in enumerate("abc")
    )
    found = choose_weights([one, two, three], 3)
    assert list(found.views) == ["plain", "pn"]
    for view, dictionaries in (("plain", [2]), ("pn", [0, 1])):
        alone = [
            replace(each, evidence=replace(each.evidence, own=each.evidence.own[dictionaries]), views=())
            for each in (one, two, three)
        ]
        assert found.views[view].without == choose_weights(alone, 3).log_loss
        better = sum(
            bool(losses(less).min() < losses(each).min()) for less, each in zip(alone, (one, two, three), strict=True)
        )
        assert (found.views[view].better, found.views[view].groups) == (better, 3)


def test_of_a_view_that_a_sequence_lacks_nothing_is_told() -> None:
    one = replace(held(several_words("a", 13)), views=("plain", "pn", "half"))
    other = replace(held(several_words("b", 14)), group=1, views=("plain", "pn", "pn"))
    assert list(choose_weights([one, other], 3).views) == ["plain", "pn"]
    alone = replace(held(several_words("a", 13)), views=("plain", "plain", "plain"))
    assert not choose_weights([alone], 3).views


def test_a_view_is_superfluous_if_every_group_is_better_without_it() -> None:
    def weights(**views: ViewWorth) -> Weights:
        return Weights(0.5, 0.0, 0.3, 0.9, 100, views)

    assert weights(a=ViewWorth(0.2, 4, 5), b=ViewWorth(0.4, 0, 5)).superfluous is None
    assert weights(a=ViewWorth(0.25, 5, 5), b=ViewWorth(0.2, 5, 5)).superfluous == "b"
    # Four groups are easily better by chance, and what is better for each alone may not be so for one alpha.
    assert weights(a=ViewWorth(0.2, 4, 4)).superfluous is None
    assert weights(a=ViewWorth(0.3, 5, 5)).superfluous is None


def test_the_loss_of_one_place_is_0_and_not_minus_0() -> None:
    """It would be printed as -0.000."""
    stream = several_words("test", 12)
    alone = DictionaryModels(FIRST, unite_models([FIRST_MODELS["hall"]]), frozenset(FIRST_MODELS["hall"].words))
    (part,) = evidence_in(stream, [alone], selection=Selection(), per="frame", max_gap=None)
    truth, steps = np.zeros(len(stream), np.int64), np.ones((1, 1), np.int64)
    found = choose_weights([HeldOut(part, truth, steps, np.ones(1))], 1)
    assert (str(found.log_loss), str(found.unweighted)) == ("0.0", "0.0")


def test_without_a_frame_to_judge_alpha_is_the_share_of_a_dictionary() -> None:
    found = choose_weights([], 4)
    assert (found.alpha, found.memory, found.log_loss, found.frames) == (0.25, 0.0, None, 0)
