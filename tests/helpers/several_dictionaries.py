"""Runs with words of several dictionaries, as `placerec tokenize` writes them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from helpers.small_world import VOCABULARY, run_through
from placerec.words import WordStream, write_stream, write_vocabulary
from placerec.words.folder import vocabulary_file
from placerec.words.stream import WordColumn

# The further dictionaries, and how many words each has.
FURTHER = {"plain20": 9, "pn10": 6}


def words_in(dictionary: str) -> tuple[str, ...]:
    """All words of a further dictionary."""
    return tuple(f"{dictionary}.w{i}" for i in range(FURTHER[dictionary]))


def several_words(name: str, seed: int, frames: int = 60) -> WordStream:
    """A run of the small world in which each further dictionary tells the places apart in its own way."""
    stream, rng = run_through(name, seed, frames), np.random.default_rng([seed, 1])
    further = {}
    for number, dictionary in enumerate(FURTHER):
        words = words_in(dictionary)
        own = [3 * ["hall", "kitchen", "office"].index(place) + number for place in stream.places]
        units = (np.array(own) + rng.integers(4, size=frames)) % len(words)
        further[dictionary] = WordColumn(tuple(words[unit] for unit in units.tolist()), rng.random(frames) + 0.1)
    return replace(stream, distances=rng.random(frames) + 0.1, further=further)


def write_several(folder: Path, runs: int = 4) -> list[Path]:
    """A tokens folder of runs with words of three dictionaries: its streams."""
    files = []
    for number in range(1, runs + 1):
        files.append(folder / f"run{number}.tsv")
        write_stream(several_words(f"run{number}", number), files[-1])
    write_vocabulary(VOCABULARY, folder / "vocab.txt")
    for dictionary in FURTHER:
        write_vocabulary(words_in(dictionary), vocabulary_file(folder, dictionary))
    return files
