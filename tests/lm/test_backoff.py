"""The model as users hold it: what it says of itself, and that a string is no list of words."""

from collections.abc import Callable

import pytest

from placerec.errors import LanguageModelError
from placerec.lm import count_ngrams, estimate, smoothing, with_unigrams
from placerec.lm.backoff import unite_models
from placerec.lm.inspect import explain

COUNTS = count_ngrams([["w1", "w2"], ["w2", "w2", "w1"]], 2, markers=False)
MODEL = estimate(COUNTS, smoothing("witten-bell"), non_events=["</s>"])
MISTAKES: list[Callable[[], object]] = [
    lambda: MODEL.score("w1 w2"),
    lambda: MODEL.log10_p("w1", "w1 w2"),
    lambda: MODEL.perplexity(["w1 w2"]),
    lambda: unite_models([MODEL]).score("w1 w2"),
    lambda: explain(MODEL, "w1 w2"),
    lambda: MODEL.next_words("w1 w2"),
    lambda: with_unigrams(MODEL, "w3"),
    lambda: count_ngrams("w1 w2", 2),
    lambda: count_ngrams(["w1 w2"], 2),
    lambda: count_ngrams([["w1"]], 2, vocabulary="w1 w2"),
    lambda: estimate(COUNTS, smoothing("witten-bell"), non_events="</s>"),
]


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_string_is_no_list_of_words(mistake: Callable[[], object]) -> None:
    with pytest.raises(LanguageModelError, match="a list of words, not a string"):
        mistake()


def test_models_say_what_they_are_in_one_line() -> None:
    sizes = "order 2: 5 1-grams, 3 2-grams"
    assert repr(COUNTS) == f"NgramCounts({sizes})"
    assert repr(MODEL) == "BackoffModel(order 2: 3 1-grams, 3 2-grams)"
    assert repr(MODEL.trie.vocabulary) == "Vocabulary(3 words)"
    assert repr(unite_models([MODEL, MODEL])) == "ModelUnion(2 models, 3 words, 6 n-grams)"
    assert repr(smoothing("witten-bell")) == "Smoothing('witten-bell')"
    assert repr(smoothing("lidstone-backoff", 0.5)) == "Smoothing('lidstone-backoff', delta=0.5)"


@pytest.mark.parametrize("history", [[], ["w1"], ["w1", "w2"], ["nowhere"], ["<s>", "w2", "w1"]])
def test_next_words_are_the_most_probable_ones_in_order(history: list[str]) -> None:
    texts = [["w1", "w2", "w3"], ["w2", "w2", "w1"], ["w3", "w1"]]
    model = estimate(count_ngrams(texts, 3), smoothing("witten-bell"))
    by_hand = sorted((-model.log10_p(word, history), word) for word in model.words if word != "<s>")
    found = model.next_words(history, 99)
    assert [word for word, _ in found] == [word for p, word in by_hand if p < float("inf")]
    assert [p for _, p in found] == pytest.approx([-p for p, _ in by_hand if p < float("inf")])
    assert model.next_words(history, 2) == found[:2]
    assert model.next_words(history, 0) == []
    with pytest.raises(LanguageModelError, match="k=-1: a number of words is needed, 0 or more"):
        model.next_words(history, -1)
