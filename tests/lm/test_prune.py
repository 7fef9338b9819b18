"""Pruning: what goes and what stays, sums of 1, and the written model's scores."""

from pathlib import Path

import numpy as np
import pytest
from helpers.mutable_models import mutable_models
from hypothesis import given, settings, strategies as st

from placerec.arrays import Ints
from placerec.lm import BackoffModel, count_ngrams, estimate, read_arpa, smoothing, write_arpa
from placerec.lm.check import context_sums
from placerec.lm.mutable import SILENT, Trace, reweigh
from placerec.lm.prune import joint_log10_p, prune, prune_improbable

SILENT_WORDS = ["<s>", "<unk>"]
texts = st.lists(st.lists(st.sampled_from("abcd"), min_size=1, max_size=10), min_size=1, max_size=6)
thresholds = st.sampled_from([1e-8, 1e-4, 1e-2, 0.1])


def trained(sentences: list[list[str]], order: int = 3) -> BackoffModel:
    return estimate(count_ngrams(sentences, order, vocabulary=[*"abcd"]), smoothing("witten-bell"))


def sizes(model: BackoffModel) -> list[int]:
    return [len(keys) for keys in model.trie.keys]


def pruned(model: BackoffModel, threshold: float, *, shortest: int = 2) -> BackoffModel:
    (mutable,) = mutable_models([model], SILENT_WORDS)
    prune(mutable, threshold, shortest=shortest)
    return mutable.model()


@settings(max_examples=30, deadline=None)
@given(texts, thresholds)
def test_pruned_contexts_sum_to_1(sentences: list[list[str]], threshold: float) -> None:
    for _, _, sums in context_sums(pruned(trained(sentences), threshold)):
        np.testing.assert_allclose(sums, 1, atol=1e-5)


@settings(max_examples=30, deadline=None)
@given(texts, thresholds)
def test_higher_thresholds_leave_less(sentences: list[list[str]], threshold: float) -> None:
    model = trained(sentences)
    some, less = sizes(pruned(model, threshold)), sizes(pruned(model, 10 * threshold))
    assert all(a >= b >= c for a, b, c in zip(sizes(model), some, less, strict=True))
    assert less[0] == sizes(model)[0]


@settings(max_examples=20, deadline=None)
@given(texts, texts, thresholds)
def test_a_pruned_model_scores_as_the_written_one(
    tmp_path_factory: pytest.TempPathFactory, one: list[list[str]], other: list[list[str]], threshold: float
) -> None:
    path = tmp_path_factory.mktemp("models") / "pruned.lm"
    model = pruned(trained(one), threshold)
    write_arpa(model, path)
    for sentence in other:
        words = ["<s>", *sentence, "</s>"]
        np.testing.assert_allclose(read_arpa(path).score(words), model.score(words), atol=1e-5)


def test_short_n_grams_can_be_spared() -> None:
    model = trained([["a", "b", "c"], ["a", "b", "d"]])
    before, after = sizes(model), sizes(pruned(model, 10.0, shortest=3))
    assert after == [before[0], before[1], 0]


class Gone(Trace):
    """Keeps how many n-grams of each order were taken out."""

    def __init__(self) -> None:
        self.counts: list[tuple[int, int]] = []

    def pruned(self, n: int, rows: Ints) -> None:
        self.counts.append((n, len(rows)))


def test_longest_n_grams_go_first() -> None:
    (mutable,) = mutable_models([trained([["a", "b", "c"], ["a", "b", "d"]])], SILENT_WORDS)
    stored = [int(mask.sum()) for mask in mutable.stored]
    gone = Gone()
    prune(mutable, 10.0, trace=gone)
    assert gone.counts == [(3, stored[2]), (2, stored[1])]
    assert not mutable.is_context[0].any()
    assert not mutable.is_context[1].any()


def test_a_history_model_decides_how_much_a_context_matters() -> None:
    """With contexts that never occur nothing matters, and everything goes."""
    model = trained([["a", "b", "c"], ["a", "b", "d"]])
    mutable, history = mutable_models([model, trained([["d"]])], SILENT_WORDS)
    history.log10_p[0][:] = -np.inf
    history.refresh_all()
    prune(mutable, 1e-30, history=history)
    assert not mutable.stored[2].any()


def test_improbable_n_grams_go_until_none_is_left() -> None:
    (mutable,) = mutable_models([trained([list("abcabd"), list("abdacb"), list("ddd")])], SILENT_WORDS)
    # Far below what backing off gives, and with weights that follow.
    first = int(np.flatnonzero(mutable.stored[2])[0])
    mutable.log10_p[2][first] = -6
    mutable.refresh_all()
    reweigh(mutable, SILENT)
    prune_improbable(mutable)
    assert not mutable.stored[2][first]
    for n in (2, 3):
        rows = np.flatnonzero(mutable.stored[n - 1])
        weight = mutable.backoff[n - 2][mutable.trie.prefix(n)[rows]]
        shorter = mutable.backed_off(n - 1)[mutable.trie.suffixes[n - 1][rows]]
        assert (shorter + weight <= mutable.log10_p[n - 1][rows] + 1e-6).all()


def test_contexts_that_lost_their_line_get_it_back(tmp_path: Path) -> None:
    (mutable,) = mutable_models([trained([list("abcabd"), list("abdacb"), list("ddd")])], SILENT_WORDS)
    row = int(np.flatnonzero(mutable.is_context[1])[0])
    mutable.log10_p[1][row] = -8
    mutable.refresh_all()
    prune_improbable(mutable)
    assert mutable.stored[1][mutable.is_context[1]].all()
    write_arpa(mutable.model(), tmp_path / "m.lm")
    assert read_arpa(tmp_path / "m.lm").order == 3


def test_contexts_are_as_probable_as_their_words_one_after_the_other() -> None:
    model = trained([["a", "b", "c"], ["a", "c"]])
    (mutable,) = mutable_models([model], SILENT_WORDS)
    index = mutable.trie.vocabulary.index
    joint = joint_log10_p(mutable, 2, start=index["<s>"], end=index["</s>"])
    row = {text: row for row, text in enumerate(mutable.trie.texts(2))}
    assert joint[row["a b"]] == pytest.approx(model.log10_p("a") + model.log10_p("b", ["a"]))
    # <s> counts as the end of the sentence before.
    assert joint[row["<s> a"]] == pytest.approx(model.log10_p("</s>") + model.log10_p("a", ["<s>"]))
