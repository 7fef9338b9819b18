"""What the programs here share: words and models of some sequences, and what they say of others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Floats
from placerec.hohmm import filter_stream, fixed_transition
from placerec.lm import count_ngrams
from placerec.model import estimate_place
from placerec.model.options import ModelOptions
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionaryOptions
from placerec.words import Selection, Sentences, WordStream, sentences_per_place
from placerec.words.tokenize import tokens_of

SIZES, SEEDS = (10, 20), (0, 1, 2)


@dataclass(frozen=True)
class Trained:
    """The sentences and training streams of C places, and test streams with log10 p (T, C) of their words."""

    sentences: dict[str, Sentences]
    training: list[WordStream]
    tests: list[WordStream]
    log10_p: list[Floats]
    vocabulary: int

    @property
    def places(self) -> list[str]:
        """The places, in the order of the columns."""
        return list(self.sentences)


def part(frames: Descriptors, names: Sequence[str], without: str = "") -> Descriptors:
    """The frames of some sequences, those of the place `without` left out."""
    pairs = zip(frames.sequences, frames.places, strict=True)
    rows = [i for i, (name, place) in enumerate(pairs) if name in names and not (without and place == without)]
    return frames.take(rows)


def trained(training: Descriptors, tests: Descriptors) -> Iterator[Trained]:
    """For every size and seed: words and Witten-Bell bigrams of the training, and what they say of the tests."""
    for size in SIZES:
        for seed in SEEDS:
            dictionary = Dictionary.fit(
                training.values, spec=DescriptorSpec(), options=DictionaryOptions(size=size, seed=seed)
            )
            streams, others = tokens_of(training, dictionary), tokens_of(tests, dictionary)
            sentences = sentences_per_place(streams, Selection())
            counts = [
                count_ngrams(text, ModelOptions().order, vocabulary=dictionary.vocabulary, markers=False)
                for text in sentences.values()
            ]
            models = [estimate_place(one, ModelOptions()) for one in counts]
            log10_p = [np.stack([model.score(stream.words) for model in models], axis=1) for stream in others]
            yield Trained(sentences, streams, others, log10_p, len(dictionary.vocabulary))


def filtered(log10_p: Floats) -> tuple[Floats, Floats]:
    """The beliefs (T, C) of the paper's filter before and after each word."""
    transition = fixed_transition(log10_p.shape[1])
    after = filter_stream(log10_p, transition).belief
    start = np.full((1, log10_p.shape[1]), 1 / log10_p.shape[1])
    return np.concatenate([start, after[:-1] @ transition.matrix]), after
