"""What the tables of single frames share: sets, splits, and the accuracy of a word's majority place.

A frame becomes a word, and the word answers with the place that most of its training frames have; no filter, no frame
before. A word without labelled training frames answers with the most frequent place of the training.
"""

import argparse
import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from placerec import DescriptorSpec, Dictionary, describe, find_sequences
from placerec.arrays import Mask
from placerec.vision import Descriptors, DictionaryOptions
from placerec.vision.options import Units

SIZE = 20
SEEDS = range(5)


def arguments(text: str | None) -> argparse.Namespace:
    """`data`, the folders of sets, and `test`, globs of sequences; the library's notes are silenced."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+", type=Path, help="a folder of sequences with labels, one a set")
    parser.add_argument(
        "--test",
        action="append",
        default=[],
        metavar="GLOB",
        help="sequences that test, all others train; a set without any tests each of its sequences in turn",
    )
    logging.getLogger("placerec").setLevel(logging.ERROR)
    return parser.parse_args()


def described(folder: Path, kind: str = "gist") -> Descriptors:
    """The descriptors of all frames of a set, of the default settings."""
    return describe(find_sequences([folder]), DescriptorSpec(kind=kind))


def fold_names(frames: Descriptors, test: Sequence[str]) -> list[list[str]]:
    """The test sequences of each fold: those that `test` globs, else each sequence in turn."""
    names = list(dict.fromkeys(frames.sequences))
    chosen = [name for name in names if any(fnmatchcase(name, glob) for glob in test)]
    return [chosen] if chosen else [[name] for name in names]


def folds(frames: Descriptors, test: Sequence[str]) -> list[Mask]:
    """Per fold which frames test."""
    return [np.isin(frames.sequences, names) for names in fold_names(frames, test)]


def fitted(frames: Descriptors, tests: Mask) -> Iterator[Dictionary]:
    """Five maps of the frames that do not test."""
    for seed in SEEDS:
        yield Dictionary.fit(frames.values[~tests], spec=frames.spec, options=DictionaryOptions(size=SIZE, seed=seed))


def answering(dictionary: Dictionary, units: Units) -> Dictionary:
    """The same map, answering with `live` or `all` units."""
    return replace(dictionary, training=replace(dictionary.training, units=units))


def answers(dictionary: Dictionary, frames: Descriptors, tests: Mask) -> Mask:
    """Which of the labelled test frames get the right place."""
    places = np.array(frames.places)
    seen, asked = ~tests & (places != ""), tests & (places != "")
    names, index = np.unique(places[seen], return_inverse=True)
    votes = np.zeros((len(dictionary.hits), len(names)))
    np.add.at(votes, (dictionary.words(frames.values[seen])[0], index), 1)
    # Less than one frame's vote: these decide where there is a tie, or no vote at all.
    votes += np.bincount(index) / (len(index) + 1)
    told = names[votes.argmax(axis=1)][dictionary.words(frames.values[asked])[0]]
    right: Mask = np.equal(told, places[asked])
    return right


def majority(frames: Descriptors, tests: Sequence[Mask]) -> tuple[float, int]:
    """The share of the most frequent place among all labelled test frames, and their number."""
    asked = [place for mask in tests for place in np.array(frames.places)[mask] if place]
    return float(np.unique(asked, return_counts=True)[1].max() / len(asked)), len(asked)


def spread(values: Sequence[float]) -> str:
    """Mean and standard deviation over the maps."""
    return f"{np.mean(values):.3f} ± {np.std(values, ddof=1):.3f}"
