"""The tables of docs/systems.md: every method on every set, by `placerec compare` for five maps and every fold.

python docs/make/systems.py DATA/SET... -o docs/systems [--test GLOB ...] [--split NAME] [--size S] [--work DIR]

Sequences that a GLOB names are tested together, all others train; in a set without any, each sequence is tested in turn
and the others train, or each group of sequences of a split of `placerec experiment`: leave-one-illumination-out tests
on one light what learned in the others. For every set: methods.csv (means over the maps; latency is a mean of
medians), pairs.csv and methods.svg as `placerec compare` writes them, with intervals over the test sequences of all
folds; a sequence counts with its mean over the maps. A run that was stopped goes on where it was: what is done is in
DIR.
"""

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from placerec.evaluation.bootstrap import compare_pairs, count_blocks, draw, interval
from placerec.experiments.comparison.benchmark import MethodRun
from placerec.experiments.comparison.figure import plot_comparison
from placerec.experiments.comparison.methods import COMPARED
from placerec.experiments.comparison.results import (
    Comparison,
    MethodScore,
    format_methods,
    format_pairs,
    judge,
)
from placerec.experiments.comparison.run import SIZE, compare
from placerec.experiments.cost import FrontEndCost
from placerec.experiments.grid.splits import SPLITS
from placerec.files import write_text
from placerec.frames import find_sequences
from placerec.hohmm import read_beliefs
from placerec.methods import HOHMM

SEEDS = range(5)
MEANS = tuple(name for name in MethodScore.__annotations__ if name not in ("method", "accuracy_low", "accuracy_high"))


def folds(folder: Path, test: Sequence[str], split: str) -> list[list[Path]]:
    """The test sequences of each fold: those that `test` names, or else those of the split."""
    sequences = {sequence.name: sequence.source for sequence in find_sequences([folder])}
    named = [path for path in sequences.values() if any(fnmatchcase(path.name, glob) for glob in test)]
    return [named] if named else [[sequences[name] for name in fold.test] for fold in SPLITS[split]([*sequences])]


def together(parts: Sequence[tuple[Path, Comparison]], seed: int) -> dict[str, MethodRun]:
    """The beliefs of all folds with one seed, and the mean cost over them."""
    runs = {}
    for name in COMPARED:
        files = [path for out, _ in parts for path in sorted((out / "beliefs" / name).glob("*.tsv"))]
        scores = [score for _, found in parts for score in found.scores if score.method == name]
        asked = [score.consulted for score in scores if score.consulted is not None]
        runs[name] = MethodRun(
            [read_beliefs(path) for path in files],
            float(np.mean([score.microseconds_per_frame for score in scores])),
            float(np.mean(asked)) if asked else None,
        )
    return runs


def mean_of(found: Sequence[Comparison], rights: Sequence[dict[str, np.ndarray]], frames: np.ndarray) -> Comparison:
    """The mean over the maps, with intervals of the mean."""
    right = {name: np.mean([one[name] for one in rights], axis=0) for name in rights[0]}
    drawn = draw(len(frames), 0)
    scores = []
    for rows in zip(*(one.scores for one in found), strict=True):
        values = {name: [getattr(row, name) for row in rows] for name in MEANS}
        means = {name: None if None in its else float(np.mean(its)) for name, its in values.items()}
        low, high = interval(drawn, right[rows[0].method], frames)
        scores.append(replace(rows[0], accuracy_low=low, accuracy_high=high, **means))
    costs = [(one.cost.descriptor, one.cost.word) for one in found]
    pairs = tuple(compare_pairs(right, frames, drawn))
    return replace(found[0], scores=tuple(scores), pairs=pairs, cost=FrontEndCost(*np.mean(costs, axis=0).tolist()))


def compared(folder: Path, tests_of: Sequence[Sequence[Path]], size: int, work: Path) -> Comparison:
    """A set's comparison, given the test sequences of each fold."""
    found, rights, frames = [], [], np.empty(0, np.int64)
    for seed in SEEDS:
        parts = []
        for number, tests in enumerate(tests_of):
            out = work / folder.name / f"size{size}-seed{seed}-fold{number}-of-{len(tests_of)}"
            parts.append((out, compare([folder], tests, out, size=size, seed=seed, cache=work / "cache")))
        runs = together(parts, seed)
        found.append(judge(runs, parts[0][1].cost, seed))
        rights.append({name: count_blocks(run.beliefs)[1] for name, run in runs.items()})
        frames = count_blocks(runs[HOHMM].beliefs)[0]
        sys.stderr.write(f"{folder.name}: map {seed + 1} of {len(SEEDS)}\n")
    return mean_of(found, rights, frames)


def table(folder: Path, found: Comparison) -> str:
    """A set's table, best first."""
    number, what = found.drawn
    front = f"descriptor {found.cost.descriptor / 1000:.1f} ms, word {found.cost.word:.0f} µs"
    lines = [
        f"{folder.name}: {found.frames} test frames, {number} {what}; always `{found.majority_place}`: "
        f"{100 * found.majority:.1f} %; {front}\n",
        "| method | accuracy % | 95 % interval | balanced % | latency | ECE | log loss | µs a frame |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for score in sorted(found.scores, key=lambda score: -score.accuracy):
        latency = "–" if score.change_latency_frames is None else f"{score.change_latency_frames:.1f}"
        asked = "" if score.consulted is None else f" (asks again for {100 * score.consulted:.0f} %)"
        low, high = 100 * score.accuracy_low, 100 * score.accuracy_high
        lines.append(
            f"| `{score.method}`{asked} | {100 * score.accuracy:.1f} | {low:.1f} to {high:.1f} "
            f"| {100 * score.balanced_accuracy:.1f} | {latency} "
            f"| {score.ece:.3f} | {score.log_loss:.2f} | {score.microseconds_per_frame:.0f} |"
        )
    return "\n".join(lines) + "\n\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA/SET", nargs="+", type=Path)
    parser.add_argument("--test", metavar="GLOB", action="append", default=[], help="names of the test sequences")
    parser.add_argument("--split", choices=SPLITS, default="leave-one-out", help="without tests that are named")
    parser.add_argument("--size", type=int, default=SIZE, help="side of the maps")
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, required=True, help="where the tables go")
    parser.add_argument("--work", metavar="DIR", type=Path, default=Path("systems-work"), help="what is kept of runs")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    for data in options.data:
        result = compared(data, folds(data, options.test, options.split), options.size, options.work)
        write_text(options.out / data.name / "methods.csv", format_methods(result.scores))
        write_text(options.out / data.name / "pairs.csv", format_pairs(result.pairs))
        plot_comparison(result, options.out / data.name / "methods.svg")
        sys.stdout.write(table(data, result))
        sys.stdout.flush()
