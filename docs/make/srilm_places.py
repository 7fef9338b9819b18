"""What the programs about SRILM's tools for places share: word streams of held-out sequences, and runs of the tools."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path

import numpy as np
from held_out import part
from single_frame import SIZE, described, fold_names

from placerec.evaluation.metrics import Evaluation
from placerec.hohmm import Recognizer, learned_transition
from placerec.lm import BackoffModel, count_ngrams
from placerec.model import estimate_place
from placerec.model.options import ModelOptions
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.run import function_of
from placerec.vision import Dictionary, DictionaryOptions
from placerec.words import Selection, WordStream, place_steps, sentences_per_place
from placerec.words.tokenize import tokens_of

SEEDS = (0, 1, 2)
FILES = (".txt", ".lm", ".map", ".classes")
frames_of = cache(described)


@dataclass(frozen=True)
class Split:
    """Token streams that train, others that test, and the words of the map that made them of frames."""

    training: list[WordStream]
    tests: list[WordStream]
    vocabulary: Sequence[str]


def splits(folder: Path, test: Sequence[str], seed: int, size: int = SIZE) -> Iterator[Split]:
    """For each fold of a set the streams of a map of the training frames."""
    frames = frames_of(folder)
    names = [*dict.fromkeys(frames.sequences)]
    for tested in fold_names(frames, test):
        training = part(frames, [name for name in names if name not in tested])
        options = DictionaryOptions(size=size, seed=seed)
        dictionary = Dictionary.fit(training.values, spec=frames.spec, options=options)
        tests = tokens_of(part(frames, tested), dictionary)
        yield Split(tokens_of(training, dictionary), tests, dictionary.vocabulary)


def place_models(split: Split, order: int = 2) -> dict[str, BackoffModel]:
    """Witten-Bell models of the places."""
    sentences = sentences_per_place(split.training, Selection())
    options = ModelOptions(order)
    return {
        place: estimate_place(count_ngrams(text, order, vocabulary=split.vocabulary, markers=False), options)
        for place, text in sentences.items()
    }


def recognizer(split: Split, models: Mapping[str, BackoffModel]) -> Recognizer:
    """The filter of these models, with learned transitions."""
    steps = np.sum([place_steps(stream, [*models]) for stream in split.training], axis=0)
    return Recognizer(models, transition=learned_transition(steps))


def run(folder: Path, tool: str, *arguments: str, **files: str) -> str:
    """The output of one of SRILM's tools, run on files in a folder; `files`: texts that are written there before."""
    for name, text in files.items():
        (folder / name).write_text(text, "utf-8")
    streams = Streams(BytesIO(), out := BytesIO(), err := BytesIO())
    paths = [str(folder / argument) if argument.endswith(FILES) else argument for argument in arguments]
    if function_of(tool)(paths, streams):
        raise SystemExit(f"{tool} {' '.join(arguments)}: {err.getvalue().decode()}")
    return out.getvalue().decode()


def spread(found: Mapping[str, Sequence[Sequence[float]]], digits: Sequence[int]) -> Iterator[str]:
    """Per name of a method the mean and standard deviation of each number over the maps, as cells of a table."""
    for name, numbers in found.items():
        means, deviations = np.mean(numbers, axis=0), np.std(numbers, axis=0, ddof=1)
        cells = [f"{m:.{d}f} ± {s:.{d}f}" for m, s, d in zip(means, deviations, digits, strict=True)]
        yield f"| {name} | {' | '.join(cells)} |"


def accuracy_of(evaluation: Evaluation) -> list[float]:
    """Accuracy, balanced accuracy, and the median latency of changes."""
    latency = evaluation.change_latency_frames
    return [evaluation.accuracy, evaluation.balanced_accuracy, float("nan") if latency is None else latency]
