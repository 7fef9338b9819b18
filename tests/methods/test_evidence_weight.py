"""The weight of evidence and the filter's memory: what they do to beliefs, and that the training chooses them."""

from collections.abc import Callable

import numpy as np
import pytest
from helpers.point_clouds import clouds, steps_of
from helpers.small_world import PLACES, VOCABULARY, run_through

from placerec.hohmm import Emissions, filter_stream, learned_transition
from placerec.hohmm.weights import ALPHAS, MEMORIES, Weights
from placerec.lm.logs import LN10
from placerec.methods import evidence_weight, wu2009
from placerec.methods.descriptors import DescriptorTrainingSet, PointStepFunction, through_filter
from placerec.methods.evidence_weight import best_weights, best_word_weights, without
from placerec.methods.training_set import TrainingSet, make_training_set
from placerec.model.evidence import group_borders
from placerec.words import Selection, place_steps, sentences_per_place

Likelihoods = Callable[[DescriptorTrainingSet], PointStepFunction]


def told(sure: float, seen: list[list[int]] | None = None) -> Likelihoods:
    """Log likelihoods of a nearest centre; `seen` gets the sequences that they are learned from."""

    def likelihoods(training: DescriptorTrainingSet) -> PointStepFunction:
        if seen is not None:
            seen.append(np.unique(training.sequences).tolist())
        centres = np.array([training.points[training.truth == c].mean(axis=0) for c in range(3)])
        return lambda point: -sure * np.square(centres - point).sum(axis=1)

    return likelihoods


def test_beliefs_are_those_of_the_filter_with_weighed_evidence_and_transitions_that_forget() -> None:
    training, test = clouds(1, apart=1.5), clouds(2, sequences=1, apart=1.5)
    weights, of_point = best_weights(training, told(3.0)), told(3.0)(training)
    log10_p = weights.alpha * np.array([of_point(point) for point in test.points]) / LN10
    shares = (np.bincount(training.truth) + 1 / 3) / (len(training.truth) + 1)
    expected = filter_stream(log10_p, learned_transition(training.steps, weights.memory, shares)).belief
    step = evidence_weight.fit(training, told(3.0))()
    np.testing.assert_allclose(np.array([step(point) for point in test.points]), expected, atol=1e-9)


def test_evidence_that_is_too_sure_gets_less_weight() -> None:
    training = clouds(1, sequences=6, apart=1.0)
    weights = [best_weights(training, told(sure)).alpha for sure in (0.5, 5.0, 50.0)]
    assert weights[0] > weights[1] > weights[2]
    assert set(weights) <= set(ALPHAS)


def test_a_filter_that_is_caught_forgets() -> None:
    """Places change at every frame, which the steps that were counted do not tell."""
    training = clouds(1, sequences=6, apart=2.0)
    rng = np.random.default_rng(0)
    order = np.concatenate([start + rng.permutation(30) for start in range(0, 180, 30)])
    jumping = DescriptorTrainingSet(
        training.points[order], training.truth[order], training.sequences, training.places, training.steps
    )
    assert best_weights(jumping, told(0.5)).memory > best_weights(training, told(0.5)).memory
    assert best_weights(training, told(0.5)).memory < 1
    assert {best_weights(one, told(0.5)).memory for one in (training, jumping)} <= set(MEMORIES)


def test_all_is_learned_without_each_of_five_groups_of_neighbours_at_most() -> None:
    seen: list[list[int]] = []
    best_weights(clouds(1, sequences=7), told(1.0, seen))
    assert [sorted({*range(7)}.difference(rest)) for rest in seen] == [[0], [1, 2], [3], [4, 5], [6]]


def test_of_a_single_sequence_nothing_is_chosen() -> None:
    training = clouds(1, sequences=1)
    assert best_weights(training, told(50.0)) == Weights(1.0, 0.0)
    plain, weighed = through_filter(training, told(50.0))(), evidence_weight.fit(training, told(50.0))()
    for point in training.points:
        np.testing.assert_allclose(weighed(point), plain(point))


def test_steps_are_counted_without_the_sequences_that_are_held_out() -> None:
    training = clouds(1)
    rest = without(training, training.sequences == 1)
    assert sorted(set(rest.sequences.tolist())) == [0, 2]
    np.testing.assert_array_equal(rest.steps, steps_of(rest.truth, rest.sequences))
    assert rest.steps.sum() == pytest.approx(58)


def test_weights_of_words_are_those_of_the_method_that_learns_without_each_group() -> None:
    streams = [run_through(f"run{i}", i) for i in range(6)]
    learned: list[int] = []

    def fit(training: TrainingSet) -> Emissions:
        learned.append(int(training.counts.sum()))
        return wu2009.fit(training)

    found = best_word_weights(streams, VOCABULARY, fit)
    assert sorted(learned) == [240, 300, 300, 300, 300]
    judged = 0.0
    for held in range(6):
        group = next(part for part in group_borders(6) if part.start <= held < part.stop)
        rest = [stream for i, stream in enumerate(streams) if not group.start <= i < group.stop]
        sentences = sentences_per_place(rest, Selection())
        emissions = wu2009.fit(make_training_set(sentences, VOCABULARY))
        steps = np.sum([place_steps(stream, PLACES) for stream in rest], axis=0)
        counts = np.sum([[stream.places.count(place) for place in PLACES] for stream in rest], axis=0)
        shares = (counts + 1 / 3) / (counts.sum() + 1)
        log10_p = found.alpha * emissions.score(streams[held].words)
        belief = filter_stream(log10_p, learned_transition(steps, found.memory, shares)).belief
        truth = streams[held].table.places.codes(PLACES)
        judged -= float(np.log(belief[np.arange(60), truth]).sum())
    assert found.frames == 360
    assert found.log_loss == pytest.approx(judged / 360, rel=1e-5)


def test_of_a_single_stream_nothing_is_chosen() -> None:
    assert best_word_weights([run_through("run", 0)], VOCABULARY, wu2009.fit) == Weights(1.0, 0.0)
