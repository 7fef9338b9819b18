"""The tables of docs/systems.md: methods on sets, by `placerec compare` for several maps and every fold.

python docs/make/systems.py DATA/SET... -o docs/systems [--methods A,B,...] [--seeds N] [--test GLOB ...]
    [--split NAME] [--size S] [--work DIR]

Sequences that a GLOB names are tested together, all others train; in a set without any, each sequence is tested in turn
and the others train, or each group of sequences of a split of `placerec experiment`: leave-one-illumination-out tests
on one light what learned in the others. Methods are METHODS, or those that are named; each is run for the first N maps,
but one that draws nothing for the first alone. For every set: methods.csv (means over the maps; latency is a mean of
medians), pairs.csv (each form of `hohmm` with every method) and methods.svg as `placerec compare` writes them, with
intervals over the test sequences of all folds; a sequence counts with its mean over the maps. A run that was stopped
goes on where it was: what is done is in DIR. Then the tables between the marks of the page beside the folder
(docs/systems.md) are written anew, that of the means over sets from the methods.csv of all SUMMARY; without a page,
they are printed.
"""

import argparse
import csv
import logging
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from weights import filled

from placerec.evaluation.bootstrap import compare_pairs, count_blocks, draw, interval
from placerec.experiments.comparison.benchmark import MethodRun
from placerec.experiments.comparison.figure import plot_comparison
from placerec.experiments.comparison.methods import DEFAULT, DESCRIPTORS, method_of
from placerec.experiments.comparison.results import (
    Comparison,
    MethodScore,
    format_methods,
    format_pairs,
    judge,
)
from placerec.experiments.comparison.run import SIZE, check_methods, compare
from placerec.experiments.comparison.views import ALL, NORMALISED, PLAIN
from placerec.experiments.cost import FrontEndCost
from placerec.experiments.grid.report import markdown
from placerec.experiments.grid.splits import SPLITS
from placerec.files import write_text
from placerec.frames import find_sequences
from placerec.hohmm import read_beliefs
from placerec.methods import HOHMM

SEEDS, SPLIT = 5, "leave-one-out"
MEANS = tuple(name for name in MethodScore.__annotations__ if name not in ("method", "accuracy_low", "accuracy_high"))
# The sets whose mean is told, the peers that are on every view there, and what the page calls these views.
SUMMARY = ("go2home", "ietower", "multifloor", "rtabmap_corridor")
PEERS = ("ullah2008", "ullah2008-hmm", "knn", "logistic", "logistic-hmm", "rbf-svm", "rbf-svm-hmm")
VIEWS = {"gist": PLAIN, "gist:pn": NORMALISED, "lbp:pn": "lbp:pn", "ranks:pn": "ranks:pn", "all views": ALL}


def on(peer: str, view: str) -> str:
    """The name of a peer on a view, tuned if it has a filter."""
    marks = [*([] if view == PLAIN else [view]), *(["tuned"] if peer.endswith("-hmm") else [])]
    return f"{peer}@{'-'.join(marks)}" if marks else peer


METHODS = tuple(dict.fromkeys((*DEFAULT, *(on(peer, view) for view in VIEWS.values() for peer in PEERS))))


def draws(name: str) -> bool:
    """Whether a method depends on the seed: words do, and the prototypes of `torralba2003`."""
    return method_of(name).kind != DESCRIPTORS or name.startswith("torralba2003")


def folds(folder: Path, test: Sequence[str], split: str) -> list[list[Path]]:
    """The test sequences of each fold: those that `test` names, or else those of the split."""
    sequences = {sequence.name: sequence.source for sequence in find_sequences([folder])}
    named = [path for path in sequences.values() if any(fnmatchcase(path.name, glob) for glob in test)]
    return [named] if named else [[sequences[name] for name in fold.test] for fold in SPLITS[split]([*sequences])]


def together(parts: Sequence[tuple[Path, Comparison]]) -> dict[str, MethodRun]:
    """The beliefs of all folds with one seed, and the mean cost over them."""
    runs = {}
    for name in (score.method for score in parts[0][1].scores):
        files = [path for out, _ in parts for path in sorted((out / "beliefs" / name).glob("*.tsv"))]
        scores = [score for _, found in parts for score in found.scores if score.method == name]
        asked = [score.consulted for score in scores if score.consulted is not None]
        runs[name] = MethodRun(
            [read_beliefs(path) for path in files],
            float(np.mean([score.microseconds_per_frame for score in scores])),
            float(np.mean(asked)) if asked else None,
        )
    return runs


def mean_of(found: Sequence[Comparison], rights: Sequence[Mapping[str, np.ndarray]], frames: np.ndarray) -> Comparison:
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


def compared(
    folder: Path, tests_of: Sequence[Sequence[Path]], methods: Sequence[str], size: int, seeds: int, work: Path
) -> Comparison:
    """A set's comparison, given the test sequences of each fold."""
    found, rights, frames = [], [], np.empty(0, np.int64)
    runs: dict[str, MethodRun] = {}
    for seed in range(seeds):
        chosen = [name for name in methods if not seed or draws(name)]
        parts = []
        for number, tests in enumerate(tests_of if chosen else ()):
            out = work / folder.name / f"size{size}-seed{seed}-fold{number}-of-{len(tests_of)}"
            one = compare([folder], tests, out, methods=chosen, size=size, seed=seed, cache=work / "cache")
            parts.append((out, one))
            sys.stderr.write(f"{folder.name}: map {seed + 1} of {seeds}, fold {number + 1} of {len(tests_of)}\n")
        if parts:
            runs |= together(parts)
            found.append(judge(runs, parts[0][1].cost, seed))
            rights.append({name: count_blocks(run.beliefs)[1] for name, run in runs.items()})
            frames = count_blocks(next(iter(runs.values())).beliefs)[0]
    return mean_of(found, rights, frames)


def table(name: str, found: Comparison) -> str:
    """A set's table, best first."""
    number, what = found.drawn
    front = f"descriptor {found.cost.descriptor / 1000:.1f} ms, word {found.cost.word:.0f} µs"
    head = (
        f"**{name}**: {found.frames} test frames, {number} {what}; always `{found.majority_place}`: "
        f"{100 * found.majority:.1f} %; {front}.\n\n"
    )
    lines = []
    for score in sorted(found.scores, key=lambda score: -score.accuracy):
        asked = "" if score.consulted is None else f" (asks again for {100 * score.consulted:.0f} %)"
        lines.append(
            (
                f"`{score.method}`{asked}",
                f"{100 * score.accuracy:.1f}",
                f"{100 * score.accuracy_low:.1f} to {100 * score.accuracy_high:.1f}",
                f"{100 * score.balanced_accuracy:.1f}",
                "–" if score.change_latency_frames is None else f"{score.change_latency_frames:.1f}",
                f"{score.ece:.3f}",
                f"{score.log_loss:.2f}",
                f"{score.microseconds_per_frame:.0f}",
            )
        )
    columns = ("method", "accuracy %", "95 % interval", "balanced %", "latency", "ECE", "log loss", "µs a frame")
    return head + markdown((columns, lines))


def shown(found: Comparison) -> Comparison:
    """What the page and the picture have of a comparison: the default, and what sees all views."""
    scores = [one for one in found.scores if one.method in DEFAULT or method_of(one.method).view == ALL]
    return replace(found, scores=tuple(scores))


def summary(folders: Sequence[Path]) -> str:
    """Means over sets of accuracy, ECE and log loss, from the methods.csv in these folders."""
    means: dict[str, np.ndarray] = {}
    for folder in folders:
        with (folder / "methods.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                figures = np.array([float(row[name]) for name in ("accuracy", "ece", "log_loss")])
                means[row["method"]] = means.get(row["method"], np.zeros(3)) + figures / len(folders)

    def cell(name: str) -> str:
        if name not in means:
            return ""
        right, ece, loss = means[name]
        return f"{100 * right:.1f}, {ece:.3f}, {loss:.2f}"

    of_views = {HOHMM: {ALL: HOHMM}, **{name: {PLAIN: name} for name in (f"{HOHMM}-single", f"{HOHMM}-paper")}}
    of_views |= {on(peer, PLAIN): {view: on(peer, view) for view in VIEWS.values()} for peer in PEERS}
    lines = [(f"`{name}`", *(cell(names.get(view, "")) for view in VIEWS.values())) for name, names in of_views.items()]
    return markdown((("method", *VIEWS), lines))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA/SET", nargs="+", type=Path)
    parser.add_argument("--methods", metavar="A,B,...", help="these alone, named as for `placerec compare`")
    parser.add_argument("--seeds", metavar="N", type=int, default=SEEDS, help="how many maps, of seeds from 0 on")
    parser.add_argument("--test", metavar="GLOB", action="append", default=[], help="names of the test sequences")
    parser.add_argument("--split", choices=SPLITS, default=SPLIT, help="without tests that are named")
    parser.add_argument("--size", type=int, default=SIZE, help="side of the maps")
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, required=True, help="where the tables go")
    parser.add_argument("--work", metavar="DIR", type=Path, default=Path("systems-work"), help="what is kept of runs")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    wanted = check_methods(options.methods.split(",") if options.methods else METHODS)
    made = {}
    for data in options.data:
        result = compared(
            data, folds(data, options.test, options.split), wanted, options.size, options.seeds, options.work
        )
        name = data.name if options.split == SPLIT else f"{data.name}-{options.split}"
        own = [pair for pair in result.pairs if any(one.startswith(HOHMM) for one in (pair.first, pair.second))]
        write_text(options.out / name / "methods.csv", format_methods(result.scores))
        write_text(options.out / name / "pairs.csv", format_pairs(own))
        plot_comparison(shown(result), options.out / name / "methods.svg")
        made[name] = table(name, shown(result))
    if all((options.out / name / "methods.csv").exists() for name in SUMMARY):
        made["summary"] = summary([options.out / name for name in SUMMARY])
    page = options.out.with_suffix(".md")
    if page.exists():
        write_text(page, filled(page.read_text(encoding="utf-8"), made))
    else:
        sys.stdout.write("\n".join(made.values()))
