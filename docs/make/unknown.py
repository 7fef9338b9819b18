"""The table "Somewhere new" of docs/recognizer.md: every place in turn is left out of the training, then met.

python docs/make/unknown.py DATA/SET... [--test GLOB ...]

Sequences that visit the place are left out of the training where at least two others remain, else its frames are.
Means and standard deviations over maps of 10 x 10 and 20 x 20, three each; beliefs by the paper's filter, order 2.
"""

import sys
from pathlib import Path

import numpy as np
from held_out import Trained, filtered, part, trained
from single_frame import arguments, described, fold_names

from placerec.arrays import Floats
from placerec.evaluation.confidence import new_places
from placerec.hohmm import filter_stream
from placerec.hohmm.unknown import (
    CHAIN,
    Histogram,
    UnknownModel,
    chain_evidence,
    distance_histogram,
    evidence,
    unknown_model,
    word_runs,
)
from placerec.vision import Descriptors

SCORES = ("1 - belief", "entropy", "distance", "words", "words, distance")
TITLES = ("set", "place left out", "frames", *SCORES, "noticed", "others taken for new")
HEAD = f"| {' | '.join(TITLES)} |\n|{' --- |' * len(TITLES)}\n"


def training_of(frames: Descriptors, test: list[str], place: str) -> Descriptors | None:
    """The training frames without the place; None if fewer than two places are left."""
    pairs = set(zip(frames.sequences, frames.places, strict=True))
    names = [name for name in dict.fromkeys(frames.sequences) if name not in test]
    others = [name for name in names if (name, place) not in pairs]
    for kept in (others, names):
        found = part(frames, kept, place)
        if len(kept) > 1 and len({*found.places} - {""}) > 1:
            return found
    return None


def histograms(case: Trained) -> list[Histogram]:
    """Per place the distances in training."""
    labels = np.array([place for stream in case.training for place in stream.places])
    distances = np.concatenate([stream.distances for stream in case.training])
    return [distance_histogram(distances[labels == place]) for place in case.places]


def scores(case: Trained) -> list[Floats]:
    """Per test sequence, what speaks for a new place, float64 (T, 5) in the order of SCORES."""
    runs = word_runs(case.sentences.values())
    alone = unknown_model(case.vocabulary, runs)
    both = unknown_model(case.vocabulary, runs, histograms(case))
    found = []
    for stream, log10_p in zip(case.tests, case.log10_p, strict=True):
        before, after = filtered(log10_p)

        def unknown(
            model: UnknownModel,
            log10_p: Floats = log10_p,
            before: Floats = before,
            far: Floats = stream.distances,
        ) -> Floats:
            chain = chain_evidence(evidence(model, log10_p, before, far), log10_p.shape[1])
            return filter_stream(chain, CHAIN).belief[:, 0]

        entropy = -(after * np.log(np.maximum(after, 1e-300))).sum(axis=1)
        found.append(
            np.stack([1 - after.max(axis=1), entropy, stream.distances, unknown(alone), unknown(both)], axis=1)
        )
    return found


def row(folder: Path, frames: Descriptors, test: list[str], place: str) -> str:
    """A line of the table; the frames of all folds are judged together, map by map."""
    judged: dict[int, list[Floats]] = {}
    new = []
    for names in fold_names(frames, test):
        training = training_of(frames, names, place)
        if training is None:
            continue
        tests = part(frames, names)
        labels = np.array(tests.places)
        new.append(labels[labels != ""] == place)
        for number, case in enumerate(trained(training, tests)):
            judged.setdefault(number, []).append(np.concatenate(scores(case))[labels != ""])
    # A set too small to do without the place gives no line.
    is_new = np.concatenate([np.zeros(0, np.bool_), *new])
    maps = [np.concatenate(parts) for parts in judged.values()]
    if not is_new.any():
        return ""
    areas = np.array(
        [[new_places(one[:, column], is_new).auroc for column in range(len(SCORES))] for one in maps], np.float64
    )
    noticed = np.mean([(one[is_new, -1] > 0.5).mean() for one in maps])
    mistaken = np.mean([(one[~is_new, -1] > 0.5).mean() for one in maps])
    cells = [f"{one.mean():.2f} ± {one.std():.2f}" for one in areas.T]
    cells += [f"{100 * share:.0f} %" for share in (noticed, mistaken)]
    return f"| {folder.name} | {place} | {int(is_new.sum())} of {len(is_new)} | {' | '.join(cells)} |\n"


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        frames = described(data)
        for place in sorted({*frames.places} - {""}):
            sys.stdout.write(row(data, frames, options.test, place))
            sys.stdout.flush()
