"""What the programs here share: words and models of some sequences, and what they say of others."""

import argparse
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from placerec.frames import find_sequences
from placerec.hohmm import filter_stream, fixed_transition
from placerec.lm import count_ngrams
from placerec.model.train import Options, estimate_place
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, describe
from placerec.words import Selection, Sentences, WordStream, sentences_per_place
from placerec.words.tokenize import tokens_of

SIZES, SEEDS = (10, 20), (0, 1, 2)
Floats = NDArray[np.float64]


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


def arguments(text: str | None) -> argparse.Namespace:
    """DATA/SET... and --test GLOB."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA/SET", nargs="+", type=Path)
    parser.add_argument(
        "--test", metavar="GLOB", action="append", default=[], help="names of the test sequences; else one by one"
    )
    logging.disable(logging.WARNING)
    return parser.parse_args()


def described(folder: Path) -> Descriptors:
    """The frames of all sequences of a set."""
    return describe(find_sequences([folder]))


def folds(frames: Descriptors, test: Sequence[str]) -> list[list[str]]:
    """The test sequences of each fold: those that `test` names, or else one after the other."""
    names = list(dict.fromkeys(frames.sequences))
    named = [name for name in names if any(fnmatch(name, glob) for glob in test)]
    return [named] if named else [[name] for name in names]


def part(frames: Descriptors, names: Sequence[str], without: str = "") -> Descriptors:
    """The frames of some sequences, those of the place `without` left out."""
    pairs = zip(frames.sequences, frames.places, strict=True)
    rows = [i for i, (name, place) in enumerate(pairs) if name in names and not (without and place == without)]
    return replace(
        frames,
        values=frames.values[rows],
        frames=tuple(frames.frames[i] for i in rows),
        sequences=tuple(frames.sequences[i] for i in rows),
        times=frames.times[rows],
        places=tuple(frames.places[i] for i in rows),
    )


def trained(training: Descriptors, tests: Descriptors) -> Iterator[Trained]:
    """For every size and seed: words and Witten-Bell bigrams of the training, and what they say of the tests."""
    for size in SIZES:
        for seed in SEEDS:
            dictionary = Dictionary.fit(training.values, spec=DescriptorSpec(), size=size, seed=seed)
            streams, others = tokens_of(training, dictionary), tokens_of(tests, dictionary)
            sentences = sentences_per_place(streams, Selection())
            counts = [
                count_ngrams(text, Options().order, vocabulary=dictionary.vocabulary, markers=False)
                for text in sentences.values()
            ]
            models = [estimate_place(one, Options()) for one in counts]
            log10_p = [np.stack([model.score(stream.words) for model in models], axis=1) for stream in others]
            yield Trained(sentences, streams, others, log10_p, len(dictionary.vocabulary))


def filtered(log10_p: Floats) -> tuple[Floats, Floats]:
    """The beliefs (T, C) of the paper's filter before and after each word."""
    transition = fixed_transition(log10_p.shape[1])
    after = filter_stream(log10_p, transition).belief
    start = np.full((1, log10_p.shape[1]), 1 / log10_p.shape[1])
    return np.concatenate([start, after[:-1] @ transition.matrix]), after
