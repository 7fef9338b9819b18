"""The tables "The numbers" of docs/recognizer.md: selections, transitions and later words on held-out sequences.

python docs/make/recognizer.py DATA/SET... [--test GLOB ...]

Means and standard deviations over five maps of 20 x 20; Witten-Bell where no other smoothing is named. The test
sequences of all folds of a set are judged together.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from held_out import part
from single_frame import SEEDS, SIZE, arguments, described, fold_names

from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.hohmm import Beliefs, Recognizer, Transition, fixed_transition, learned_transition
from placerec.lm import count_ngrams
from placerec.model import estimate_place
from placerec.model.options import ModelOptions
from placerec.vision import Dictionary, DictionaryOptions
from placerec.words import WordStream, parse_selection, place_steps, sentences_per_place
from placerec.words.tokenize import tokens_of

HEAD = """\
| words | transitions | accuracy | balanced | latency | log loss | ECE |
| --- | --- | --- | --- | --- | --- | --- |
"""
SELECTIONS = ("none", "subsample:3", "subsample:5", "compress:3", "unique")
MODELS = {
    "none, n = 1": ModelOptions(1),
    **{f"{name}, n = 2": ModelOptions(2, select=parse_selection(name)) for name in SELECTIONS},
    "unique, n = 2, lidstone-backoff": ModelOptions(2, "lidstone-backoff", select=parse_selection("unique")),
}
TRANSITIONS = ("fixed per update", "fixed per frame", "learned")
# What later words add, where all words count and transitions are learned.
AHEAD: dict[str, dict[str, Any]] = {
    "lag of 5 frames": {"lag": 5},
    "smoothed": {"smooth": True},
    "Viterbi": {"viterbi": True},
}
# Per words and transitions.
Found = dict[tuple[str, str], list[Beliefs]]


def transition(name: str, training: Sequence[WordStream], places: Sequence[str]) -> Transition:
    """The transitions that decode has under this name."""
    if name == "learned":
        return learned_transition(np.sum([place_steps(stream, places) for stream in training], axis=0))
    return fixed_transition(len(places), per="frame" if name == "fixed per frame" else "update")


def decoded(training: Sequence[WordStream], tests: Sequence[WordStream], vocabulary: Sequence[str]) -> Found:
    """The beliefs in the tests, by models of the training."""
    found: Found = {}
    for words, options in MODELS.items():
        sentences = sentences_per_place(training, options.select)
        models = {
            place: estimate_place(
                count_ngrams(text, options.order, vocabulary=vocabulary, markers=options.markers), options
            )
            for place, text in sentences.items()
        }
        for name in TRANSITIONS:
            recognizer = Recognizer(
                models, selection=options.select, transition=transition(name, training, [*sentences])
            )
            found[words, name] = [recognizer.decode(stream) for stream in tests]
            if words == "none, n = 2" and name == "learned":
                for title, ahead in AHEAD.items():
                    found[words, f"learned, {title}"] = [recognizer.decode(stream, **ahead) for stream in tests]
    return found


def maps(folder: Path, test: Sequence[str]) -> Iterator[Found]:
    """For every map the beliefs in all test sequences of a set."""
    frames = described(folder)
    names = [*dict.fromkeys(frames.sequences)]
    for seed in SEEDS:
        whole: Found = {}
        for tested in fold_names(frames, test):
            training = part(frames, [name for name in names if name not in tested])
            dictionary = Dictionary.fit(
                training.values, spec=frames.spec, options=DictionaryOptions(size=SIZE, seed=seed)
            )
            streams = tokens_of(training, dictionary), tokens_of(part(frames, tested), dictionary)
            for key, beliefs in decoded(*streams, dictionary.vocabulary).items():
                whole.setdefault(key, []).extend(beliefs)
        yield whole


def table(folder: Path, test: Sequence[str]) -> str:
    """A set's table under its name and majority class."""
    judged: dict[tuple[str, str], list[Evaluation]] = {}
    for found in maps(folder, test):
        for key, beliefs in found.items():
            judged.setdefault(key, []).append(evaluate(beliefs))
    lines = []
    for (words, name), evaluations in judged.items():
        columns = np.array(
            [(e.accuracy, e.balanced_accuracy, e.change_latency_frames, e.log_loss, e.ece) for e in evaluations]
        )
        means, spreads = columns.mean(axis=0), columns.std(axis=0, ddof=1)
        digits = (3, 3, 1, 2, 3)
        cells = [f"{m:.{d}f} ± {s:.{d}f}" for m, s, d in zip(means, spreads, digits, strict=True)]
        lines.append(f"| {words} | {name} | {' | '.join(cells)} |\n")
    one = evaluations[0]
    always = (
        f"{one.frames} test frames, {one.changes} changes; always {one.majority_place}: {one.majority_accuracy:.3f}"
    )
    return f"**{folder.name}** ({always})\n\n{HEAD}{''.join(lines)}\n"


if __name__ == "__main__":
    options = arguments(__doc__)
    for data in options.data:
        sys.stdout.write(table(data, options.test))
        sys.stdout.flush()
