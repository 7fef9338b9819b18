"""The tables of descriptors and of projections in docs/vision.md, and the results behind them.

python docs/make/descriptors.py [DATA] [--set NAME ...] [--network FILE[#LAYER]] [--work DIR]

With DATA, the folder of the sets, words of every kind of descriptor that is made of images, of those of the default in
one row and, with --network, of an image network are learned in every fold of weights.py: one dictionary of 20 x 20,
transitions and the weight of words as `placerec learn` does. Tests are single frames, sequences
as they are and in simulated light, and frames that a camera's faults or a light change. Beside these, projections of
GIST (projections.py), and what describing costs (tests/benchmarks/descriptor_cost.py). What was done is kept in DIR, so
that a run that was stopped goes on, and results are kept in docs/vision/. Then the tables of the page are written anew.
"""

import argparse
import csv
import io
import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from light import relit_set
from projections import PROJECTIONS, learned
from single_frame import answers
from weights import FOLDS, Figures, filled, kept

from placerec import find_sequences
from placerec.arrays import Mask
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.experiments.grid.report import Table, markdown
from placerec.files import content_digest, write_text
from placerec.frames import Sequence as FrameSequence
from placerec.frames.table import FrameTable
from placerec.inspection.word_stability import word_changes
from placerec.methods import HOHMM, make_decoder
from placerec.model import Decoding, ModelOptions, load_model
from placerec.model.decoding import AS_LEARNED
from placerec.model.folder import ModelFolder
from placerec.model.learn import learn_models, learn_weights_by
from placerec.vision import (
    DEFAULT_KIND,
    KINDS,
    Descriptors,
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySet,
    DictionarySetOptions,
    describe,
)
from placerec.vision.chunks import Source, chunks
from placerec.vision.light import LIGHTS
from placerec.vision.network import Network
from placerec.vision.onnx import open_network
from placerec.vision.options import View
from placerec.words.tokenize import tokens_of

PAGE = Path(__file__).parents[1] / "vision.md"
RESULTS = PAGE.with_suffix("") / "descriptors.csv"
COSTS = RESULTS.with_name("cost.json")
ONE_THREAD = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
BENCHMARK = Path(__file__).parents[2] / "tests/benchmarks/descriptor_cost.py"
DESCRIPTOR, STABILITY, PROJECTION = "descriptor", "stability", "projection"
SIZE, SIZES = 20, (10, 20)
# Maps of each projection, by the seeds 0, 1, ...; descriptors have one map.
SEEDS = 2
# Frames of a set that a camera's faults and lights change.
CHANGED = 60
# Words that count in full against what the learned transitions predict.
UNWEIGHED = Decoding(transition="learned", alpha=1.0, memory=0.0)
MADE = [kind for kind, one in KINDS.items() if one.describe is not None and kind != "onnx"]
# What is changed about a frame whose word is looked at, of `placerec stability`, and by which name it is shown.
FAULTS = {"JPEG": "JPEG", "noise": "noise", "blur": "blur", "shift by 1 pixel": "shift"}
WORDS = [f"{name}: words" for name in (*FAULTS.values(), *LIGHTS)]
FIGURES = ("frames", "single", "unweighed", "accuracy", "log_loss", *LIGHTS, *WORDS)


class Task(NamedTuple):
    """Which words are judged: those of a view (DESCRIPTOR, STABILITY), or of a projection of GIST (PROJECTION)."""

    about: str
    view: str
    size: int
    seed: int


class Result(NamedTuple):
    """A line of descriptors.csv: what the words of a task do on the tests of a fold; shares of 1, and nats."""

    about: str
    view: str
    size: int
    seed: int
    set: str
    fold: int
    figures: Figures

    @property
    def task(self) -> Task:
        """The words that were judged."""
        return Task(*self[:4])


@dataclass(frozen=True)
class Split:
    """A fold of a set: its frames by all descriptors that are compared, described once; `work`: where they are kept."""

    data: Path
    name: str
    tests: tuple[str, ...]
    spec: DescriptorSpec = field(repr=False)
    work: Path

    @cached_property
    def frames(self) -> Descriptors:
        """All frames of the set."""
        return self._described(self.data / self.name, lambda sequence: True)

    @cached_property
    def testing(self) -> Mask:
        """Which of the frames test, bool (n,)."""
        return np.array([self._tests(name) for name in self.frames.sequences], bool)

    @cached_property
    def lights(self) -> dict[str, Descriptors]:
        """The frames that test in every simulated light."""
        lit = {light: relit_set(self.data, self.name, light, self.work) for light in LIGHTS}
        return {light: self._described(folder, self._tests) for light, folder in lit.items()}

    def sequences(self) -> list[FrameSequence]:
        """The sequences that test."""
        return [one for one in find_sequences([self.data / self.name]) if self._tests(one.name)]

    def _tests(self, sequence: str) -> bool:
        return any(Path(sequence).match(glob) for glob in self.tests)

    def _described(self, folder: Path, wanted: Callable[[str], bool]) -> Descriptors:
        found = [one for one in find_sequences([folder]) if wanted(one.name)]
        return describe(found, self.spec, cache=self.work / "cache")


def fitted(split: Split, task: Task, frames: Descriptors) -> Dictionary:
    """The dictionary of a task that some frames train."""
    if task.about == PROJECTION:
        own = frames.part(split.spec.part("gist"))
        return learned(own, task.view, DictionaryOptions(task.size, seed=task.seed))
    options = DictionarySetOptions((task.view,), (task.size,), seed=task.seed)
    made = DictionarySet.fit(frames.values, spec=frames.spec, places=frames.table.places, options=options)
    return made.dictionaries[0]


def judged(split: Split, task: Task, dictionary: Dictionary, tests: Mapping[str, Descriptors]) -> dict[str, Evaluation]:
    """What the filter makes of the words of some tests, by what they are called; the models are those of `learn`.

    Words of the tests "unweighed" count in full.
    """
    made, training = DictionarySet.of(dictionary), split.frames.take(~split.testing)
    values, table, spec = training.values, training.table, training.spec

    def fit(source: Source, frames: FrameTable) -> DictionarySet:
        rows = np.concatenate([*chunks(source)])
        return DictionarySet.of(fitted(split, task, Descriptors(spec, rows, frames)))

    weigh = partial(learn_weights_by, fit, values, table, spec, 1, ModelOptions())
    with tempfile.TemporaryDirectory() as path:
        folder = ModelFolder(Path(path))
        learn_models(folder, values, table, spec, made, ModelOptions(), weigh)
        models = load_model(folder.path)
        found = {}
        for name, frames in tests.items():
            decoder = make_decoder(HOHMM, models, options=UNWEIGHED if name == "unweighed" else AS_LEARNED)
            found[name] = evaluate([decoder.decode(stream) for stream in tokens_of(frames, made)])
        return found


def changed_words(split: Split, dictionary: Dictionary) -> Figures:
    """The share of frames that get another word by each of FAULTS and LIGHTS, over all amounts of it."""
    shares: dict[str, list[float]] = {}
    sample = CHANGED // len(FOLDS[split.name])
    for light in (False, True):
        for one in word_changes(split.sequences(), dictionary, light=light, sample=sample).results:
            name = one.amount if light else FAULTS.get(one.kind, one.kind)
            shares.setdefault(f"{name}: words", []).append(one.share)
    return {name: float(np.mean(shares[name])) for name in WORDS}


def figures(split: Split, task: Task) -> Figures:
    """What a task asks of its words: in the filter, in simulated light but for a projection, or changed pictures."""
    dictionary = fitted(split, task, split.frames.take(~split.testing))
    if task.about == STABILITY:
        return {"frames": int(split.testing.sum())} | changed_words(split, dictionary)
    lights = {} if task.about == PROJECTION else split.lights
    tests = split.frames.take(split.testing)
    found = judged(split, task, dictionary, {"": tests, "unweighed": tests, **lights})
    plain = found.pop("")
    return {
        "frames": plain.frames,
        "single": float(np.mean(answers(dictionary, split.frames.part(dictionary.spec), split.testing))),
        "accuracy": plain.accuracy,
        "log_loss": plain.log_loss,
        **{light: one.accuracy for light, one in found.items()},
    }


def own_figures(split: Split, task: Task) -> dict[str, Figures]:
    """The figures as they are kept."""
    return {"": figures(split, task)}


def all_tasks(network: Network | None) -> Iterator[Task]:
    """What is done in every fold."""
    views = [f"{kind}{of}" for kind in MADE for of in ("", ":pn")] + [f"{DEFAULT_KIND}:pn"]
    views += [] if network is None else ["onnx", "onnx:pn"]
    for about, view in product((DESCRIPTOR, STABILITY), views):
        yield Task(about, view, SIZE, 0)
    for projection, size, seed in product(PROJECTIONS, SIZES, range(SEEDS)):
        yield Task(PROJECTION, projection, size, seed)


def run(data: Path, sets: Sequence[str], network: Network | None, work: Path) -> Iterator[Result]:
    """The results of all folds of some sets."""
    spec = DescriptorSpec(kind="+".join([*MADE, *(() if network is None else ("onnx",))]), network=network)
    for name in sets:
        for fold, tests in enumerate(FOLDS[name]):
            split = Split(data, name, tests, spec, work)
            for task in all_tasks(network):
                kinds = ("gist",) if task.about == PROJECTION else View.parse(task.view).kinds
                asked = CHANGED if task.about == STABILITY else FIGURES[:5]
                key = content_digest(*task, asked, tests, spec.part(*kinds).as_dict())[:16]
                found = kept(work / name / f"{key}.json", partial(own_figures, split, task))
                yield Result(*task, name, fold, found[""])
            sys.stderr.write(f"{name}: fold {fold + 1}\n")


def format_results(results: Iterable[Result]) -> str:
    """The text of descriptors.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*Result._fields[:-1], *FIGURES))
    for one in results:
        values = [one.figures.get(name, "") for name in FIGURES]
        writer.writerow([*one[:-1], *(f"{value:.6f}" if isinstance(value, float) else value for value in values)])
    return text.getvalue()


def read_results(path: Path) -> list[Result]:
    """The lines of descriptors.csv."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Result(
                line["about"],
                line["view"],
                int(line["size"]),
                int(line["seed"]),
                line["set"],
                int(line["fold"]),
                {name: float(line[name]) for name in FIGURES if line[name]},
            )
            for line in csv.DictReader(file)
        ]


def of_sets(results: Sequence[Result], figure: str) -> dict[str, float]:
    """A figure on every set, the mean over folds and seeds with the frames as weights, and the mean over sets."""
    found = {}
    for name in FOLDS:
        own = [one.figures for one in results if one.set == name]
        if own:
            found[name] = float(np.average([one[figure] for one in own], weights=[one["frames"] for one in own]))
    return found | {"mean": float(np.mean([*found.values()]))}


def by_set(results: Sequence[Result], about: str) -> Table:
    """A line for each view and size: accuracies and log loss on each set, and their means over sets.

    Of single frames, of the filter with words that count in full, and with what they weigh by training.
    """
    lines = []
    head: list[str] = []
    for told, own in _grouped(results, about):
        shares = [of_sets(own, figure) for figure in ("single", "unweighed", "accuracy")]
        loss = of_sets(own, "log_loss")
        head = [*loss]
        cells = [" / ".join(f"{100 * one[name]:.1f}" for one in shares) + f", {loss[name]:.3f}" for name in head]
        lines.append((told, *cells))
    return (about, *head), lines


def in_light(results: Sequence[Result]) -> Table:
    """A line for each view: the mean accuracy over sets as it is and in each light, and the most that a set loses."""
    lines = []
    for told, own in _grouped(results, DESCRIPTOR):
        plain = of_sets(own, "accuracy")
        cells = [f"{100 * plain['mean']:.1f}"]
        for light in LIGHTS:
            lit = of_sets(own, light)
            cells.append(f"{100 * lit['mean']:.1f} ({100 * min(lit[name] - plain[name] for name in plain):+.1f})")
        lines.append((told, *cells))
    return (DESCRIPTOR, "as it is", *LIGHTS), lines


def of_words(results: Sequence[Result]) -> Table:
    """A line for each view: the share of frames that get another word by each fault and light, the mean over sets."""
    lines = [
        (told, *(f"{100 * of_sets(own, name)['mean']:.1f}" for name in WORDS))
        for told, own in _grouped(results, STABILITY)
    ]
    return (DESCRIPTOR, *(name.removesuffix(": words") for name in WORDS)), lines


def _grouped(results: Sequence[Result], about: str) -> Iterator[tuple[str, list[Result]]]:
    """What each view or projection is called, and the results of all folds and seeds."""
    own = [one for one in results if one.about == about]
    for view, size in dict.fromkeys((one.view, one.size) for one in own):
        told = f"{view}, {size} x {size}" if about == PROJECTION else f"`{view}`"
        yield told, [one for one in own if (one.view, one.size) == (view, size)]


def of_cost(costs: Sequence[Mapping[str, Any]]) -> Table:
    """A line for everything whose cost was measured."""
    head = [*dict.fromkeys(name for one in costs for name in one)]
    return head, [[str(one.get(name, "")) for name in head] for one in costs]


def tables(results: Sequence[Result], costs: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """What belongs between the marks of the page, by name; "" where there are no results for it yet."""
    made = {
        "descriptors": by_set(results, DESCRIPTOR),
        "descriptors light": in_light(results),
        "descriptors words": of_words(results),
        "projections": by_set(results, PROJECTION),
        "descriptors cost": of_cost(costs),
    }
    return {name: markdown(table) if table[1] else "" for name, table in made.items()}


def measured_costs(data: Path, network: str | None) -> list[dict[str, Any]]:
    """What the benchmark finds on frames of a set, in a process of its own."""
    command = [sys.executable, str(BENCHMARK), "--json", "--frames", str(data / "ietower")]
    more = ["--network", network] if network else []
    found = subprocess.run([*command, *more], capture_output=True, text=True, check=True, env=ONE_THREAD)
    costs: list[dict[str, Any]] = json.loads(found.stdout)
    return costs


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", nargs="?", type=Path, help="the folder of the sets")
    parser.add_argument("--set", action="append", choices=FOLDS, help="run this one only, and leave page and csv alone")
    parser.add_argument("--network", metavar="FILE[#LAYER]", help="an image network as one more descriptor")
    parser.add_argument("--work", metavar="DIR", type=Path, default=Path("descriptors-work"), help="what is kept")
    options = parser.parse_args()
    logging.getLogger("placerec").setLevel(logging.ERROR)
    if options.data:
        file, _, layer = (options.network or "").partition("#")
        found = run(options.data, options.set or [*FOLDS], open_network(file, layer) if file else None, options.work)
        results = format_results(found)
        if not options.set:
            COSTS.parent.mkdir(exist_ok=True)
            write_text(COSTS, json.dumps(measured_costs(options.data, options.network), indent=1) + "\n")
            write_text(RESULTS, results)
    if not options.set:
        made = tables(read_results(RESULTS), json.loads(COSTS.read_text(encoding="utf-8")))
        write_text(PAGE, filled(PAGE.read_text(encoding="utf-8"), made))
