"""The filter of a peer whose evidence has a weight, and which does not remember for ever: both are learned.

As in `hohmm.weights`: the likelihoods of a point or a word count to the power of alpha, and at each step the filter
replaces the share `memory` of its belief by the places' shares. Both have the least log loss on training sequences that
were held out, five groups of neighbours at most, for which likelihoods, transitions and shares are learned without
each; of a single sequence nothing is held out, and they stay 1 and 0. (Components and words are those of all training
sequences.)
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from placerec.arrays import Mask
from placerec.hohmm import Emissions, learned_transition
from placerec.hohmm.evidence import DictionaryModels, Evidence, evidence_in
from placerec.hohmm.weights import HeldOut, Weights, choose_weights, shares_of
from placerec.lm.logs import LN10
from placerec.methods.descriptors import DescriptorTrainingSet, FitPoints, MakePointStepper, filtered
from placerec.methods.training_set import TrainingSet, make_training_set
from placerec.model.evidence import group_borders
from placerec.words import Selection, WordStream, place_steps, sentences_per_place
from placerec.words.stream import FIRST


def fit(training: DescriptorTrainingSet, likelihoods: FitPoints) -> MakePointStepper:
    """Beliefs of the filter over `likelihoods`, weighed as the training asks for."""
    weights, of_point = best_weights(training, likelihoods), likelihoods(training)
    shares = shares_of(np.bincount(training.truth, minlength=len(training.places)))
    return filtered(
        lambda point: weights.alpha * of_point(point), learned_transition(training.steps, weights.memory, shares)
    )


def best_weights(training: DescriptorTrainingSet, likelihoods: FitPoints) -> Weights:
    """The weights with the least log loss on held-out training sequences."""
    return choose_weights(_held_out(training, likelihoods), 1)


def _held_out(training: DescriptorTrainingSet, likelihoods: FitPoints) -> Iterator[HeldOut]:
    numbers = np.unique(training.sequences)
    for group in group_borders(len(numbers)):
        held: Mask = np.isin(training.sequences, numbers[group])
        rest = without(training, held)
        of_point, frames = likelihoods(rest), np.bincount(rest.truth, minlength=len(rest.places))
        for sequence in numbers[group]:
            rows = np.flatnonzero(training.sequences == sequence)
            log10_p = np.array([of_point(point) for point in training.points[rows]]) / LN10
            every, elapsed = np.ones(len(rows), bool), np.minimum(np.arange(len(rows)), 1.0)
            truth = np.where(frames[training.truth[rows]], training.truth[rows], -1)
            evidence = Evidence(every, np.arange(len(rows)), log10_p[None], elapsed)
            yield HeldOut(evidence, truth, rest.steps, shares_of(frames))


def without(training: DescriptorTrainingSet, held: Mask) -> DescriptorTrainingSet:
    """The training set without some sequences, whose frames are `held`, bool (n,); its steps are counted anew."""
    truth, sequences, places = training.truth[~held], training.sequences[~held], len(training.places)
    steps = np.zeros((places, places), np.int64)
    together = sequences[1:] == sequences[:-1]
    np.add.at(steps, (truth[:-1][together], truth[1:][together]), 1)
    return replace(training, points=training.points[~held], truth=truth, sequences=sequences, steps=steps)


def best_word_weights(
    streams: Sequence[WordStream], vocabulary: Sequence[str], emissions: Callable[[TrainingSet], Emissions]
) -> Weights:
    """The weights of a method for words, which gets its `emissions` from a training set, by its training streams."""
    return choose_weights(_streams_held_out(streams, vocabulary, emissions), 1)


def _streams_held_out(
    streams: Sequence[WordStream], vocabulary: Sequence[str], emissions: Callable[[TrainingSet], Emissions]
) -> Iterator[HeldOut]:
    for group in group_borders(len(streams)):
        rest = [*streams[: group.start], *streams[group.stop :]]
        sentences = sentences_per_place(rest, Selection())
        places = list(sentences)
        steps = np.sum([place_steps(stream, places) for stream in rest], axis=0)
        frames = np.sum([[stream.places.count(place) for place in places] for stream in rest], axis=0)
        models = emissions(make_training_set(sentences, vocabulary, steps=steps))
        words = DictionaryModels(FIRST, models, frozenset(vocabulary))
        for stream in streams[group]:
            (part,) = evidence_in(stream, [words], selection=Selection(), per="frame", max_gap=None)
            yield HeldOut(part, stream.table.places.codes(places), steps, shares_of(frames))
