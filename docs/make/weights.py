"""The tables of docs/recognizer.md on several dictionaries and what their words weigh, and the results behind them.

python docs/make/weights.py [DATA] [--set NAME ...] [--seeds N] [--work DIR]

With DATA, the folder of the sets, every fold of FOLDS is run for the first seeds (0 to 2): METHODS by `placerec
compare`, and VARIANTS of what `placerec learn` makes; METHODS also on the laboratory, which is rendered. What was done
is kept in DIR, so that a run that was stopped goes on, and docs/recognizer/weights.csv gets all of it, in place of what
it had of these sets. Then the tables of the page are written anew.
"""

import argparse
import csv
import io
import json
import logging
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from experiment_page import SLOT

from placerec import learn
from placerec.evaluation.metrics import evaluate
from placerec.experiments.comparison.run import compare
from placerec.experiments.grid.report import Table, markdown
from placerec.files import content_digest, write_text
from placerec.lab.layout import render_lab
from placerec.methods import HOHMM, decode
from placerec.model import Decoding, ModelOptions, train_lm
from placerec.model.decoding import AS_LEARNED
from placerec.vision import DictionarySetOptions

PAGE = Path(__file__).parents[1] / "recognizer.md"
RESULTS = PAGE.with_suffix("") / "weights.csv"
SEEDS = 3
# Names of the sequences that test, fold by fold; all others of the set train.
FOLDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "go2home": (("run03*", "run09*", "run15*", "run21*"), ("run05*", "run11*", "run17*", "run23*")),
    "ietower": (
        ("floor03", "floor07", "floor11"),
        ("floor04", "floor08", "floor12"),
        ("floor05", "floor09", "floor13"),
        ("floor06", "floor10"),
    ),
    "multifloor": (("floor1",), ("floor2",), ("floor3",), ("floor4",)),
    "rtabmap_corridor": (("lap1",), ("lap2",)),
}
# The synthetic laboratory: the third run of every path and light tests, or all of one light.
LIGHT: dict[str, tuple[tuple[str, ...], ...]] = {
    "same light": (("*3",),),
    "unseen light": (("*_cloudy*",), ("*_night*",), ("*_sunny*",)),
}
METHODS = (
    *(HOHMM, f"{HOHMM}-single", f"{HOHMM}-paper", "rbf-svm-hmm", "rbf-svm", "rbf-svm-hmm@pn-tuned", "ullah2008-hmm"),
    *("ullah2008", "knn"),
)


@dataclass(frozen=True)
class Variant:
    """Another way to learn than the default, or to use what it learned.

    `words`: options of the dictionaries. `short`: weights from the token streams alone, words are not learned anew.
    """

    name: str
    words: Mapping[str, Any] = field(default_factory=dict)
    options: ModelOptions = ModelOptions()
    short: bool = False
    decoding: Decoding = AS_LEARNED


# Those that learn alike follow each other.
VARIANTS = (
    Variant("the default"),
    Variant("weights from the token streams alone", short=True),
    Variant("alpha 1, memory 0", decoding=Decoding(alpha=1.0, memory=0.0)),
    Variant("memory 0", decoding=Decoding(memory=0.0)),
    Variant("fixed transitions", decoding=Decoding(transition="fixed", alpha=1.0, memory=0.0)),
    Variant("sizes 10", {"sizes": (10,)}),
    Variant("sizes 20", {"sizes": (20,)}),
    Variant("views plain, pn of GIST alone", {"views": ("gist", "gist:pn")}),
    Variant("order 1", options=ModelOptions(1)),
    Variant("order 3", options=ModelOptions(3)),
    Variant("lidstone", options=ModelOptions(2, "lidstone")),
)


class Result(NamedTuple):
    """A line of weights.csv: what a method or a variant does on the tests of a fold, with one seed."""

    kind: str
    name: str
    set: str
    fold: int
    seed: int
    frames: int
    accuracy: float
    ece: float
    log_loss: float
    change_latency_frames: float | None


NOTES = {
    "method": "Per cent of the frames right, ECE and log loss ({seeds}): means over the folds of a set with their "
    "frames as weights, then over sets, of which the standard deviation is over seeds.",
    "variant": "Learned otherwise than by default, or with something of what was learned left out ({seeds}):",
    "light": "Per cent of the frames right, ECE and log loss on the **synthetic** laboratory, tested on the third run "
    "of every path and light, and on one light after the other that no training sequence has ({seeds}):",
}
# What is measured, by name.
Figures = dict[str, Any]
MEASURED = Result._fields[5:]


def compared(training: Sequence[Path], tests: Sequence[Path], seed: int, work: Path) -> dict[str, Figures]:
    """The figures of METHODS on a fold."""
    found = compare(training, tests, work / "compare", methods=METHODS, seed=seed, cache=work.parent / "cache")
    return {
        one.method: {"frames": found.frames} | {name: getattr(one, name) for name in MEASURED[1:]}
        for one in found.scores
    }


def varied(
    training: Sequence[Path], tests: Sequence[Path], seed: int, variants: Iterable[Variant], cache: Path, folder: Path
) -> dict[str, Figures]:
    """The figures of some variants that learn alike; `cache`: of descriptors, `folder`: for models and beliefs."""
    figures, model, short = {}, folder / "model", folder / "short"
    for variant in variants:
        if not model.exists():
            learn(
                training,
                model,
                words=replace(DictionarySetOptions(seed=seed), **variant.words),
                options=variant.options,
                cache=cache,
            )
        if variant.short:
            train_lm([model / "tokens"], short, options=variant.options)
        used = short if variant.short else model
        words, out = model / "words.npz", folder / "beliefs"
        beliefs = decode(tests, used, words=words, out=out, options=variant.decoding, cache=cache)
        figures[variant.name] = {name: getattr(evaluate(beliefs), name) for name in MEASURED}
    return figures


def kept(path: Path, work: Callable[[], dict[str, Figures]]) -> dict[str, Figures]:
    """What a file of an earlier run holds, or the `work` does, which then is kept there."""
    if path.exists():
        found: dict[str, Figures] = json.loads(path.read_text(encoding="utf-8"))
        return found
    done = work()
    write_text(path, json.dumps(done, indent=1) + "\n")
    return done


def run(data: Path, sets: Sequence[str], seeds: Iterable[int], work: Path) -> Iterator[Result]:
    """The results of all folds of some sets, or of the laboratory in the `work` folder with some light."""
    for seed in seeds:
        for name in sets:
            own_data = laboratory(work) if name in LIGHT else data / name
            sequences = sorted(path for path in own_data.iterdir() if path.is_dir())
            for number, globs in enumerate((FOLDS | LIGHT)[name]):
                tests = [path for glob in globs for path in sequences if path.match(glob)]
                training = [path for path in sequences if path not in tests]
                own = work / name / f"seed{seed}-fold{number}"
                found = kept(own / "compare.json", partial(compared, training, tests, seed, own))
                yield from (Result("method", one, name, number, seed, **of) for one, of in found.items())
                for _, same in groupby(() if name in LIGHT else VARIANTS, attrgetter("words", "options")):
                    alike = list(same)
                    with tempfile.TemporaryDirectory() as folder:
                        varying = partial(varied, training, tests, seed, alike, own.parent / "cache", Path(folder))
                        found = kept(own / f"{content_digest(repr(alike))[:16]}.json", varying)
                    yield from (Result("variant", one, name, number, seed, **of) for one, of in found.items())
                sys.stderr.write(f"{name}: seed {seed}, fold {number + 1}\n")


def laboratory(work: Path) -> Path:
    """The laboratory, which is rendered if it is not there."""
    if not (work / "laboratory").exists():
        render_lab(work / "laboratory", scale="small")
    return work / "laboratory"


def format_results(results: Iterable[Result]) -> str:
    """The text of weights.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Result._fields)
    writer.writerows([f"{value:.6f}" if isinstance(value, float) else value for value in one] for one in results)
    return text.getvalue()


def read_results(path: Path) -> list[Result]:
    """The lines of weights.csv."""
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    return [
        Result(
            line["kind"],
            line["name"],
            line["set"],
            int(line["fold"]),
            int(line["seed"]),
            int(line["frames"]),
            float(line["accuracy"]),
            float(line["ece"]),
            float(line["log_loss"]),
            float(line["change_latency_frames"]) if line["change_latency_frames"] else None,
        )
        for line in lines
    ]


def of_set(results: Iterable[Result], figure: str) -> np.ndarray:
    """A figure on a set for each seed, (seeds,): the mean over the folds, with their frames as weights."""
    sums: dict[int, tuple[float, int]] = {}
    for one in results:
        value, frames = sums.get(one.seed, (0.0, 0))
        sums[one.seed] = value + one.frames * getattr(one, figure), frames + one.frames
    return np.array([value / frames for _, (value, frames) in sorted(sums.items())])


def table(results: Sequence[Result], kind: str, sets: Iterable[str]) -> Table:
    """A line for each method or variant: accuracy, ECE and log loss on each set, and their means over sets."""
    sets = [name for name in sets if any(one.set == name for one in results)]
    lines = []
    for name in dict.fromkeys(one.name for one in results if one.kind == kind):
        own = {of: [one for one in results if (one.kind, one.name, one.set) == (kind, name, of)] for of in sets}
        right, ece, loss = (
            np.array([of_set(rows, figure) for rows in own.values()]) for figure in ("accuracy", "ece", "log_loss")
        )
        cells = [
            f"{100 * r.mean():.1f}, {e.mean():.3f}, {n.mean():.2f}" for r, e, n in zip(right, ece, loss, strict=True)
        ]
        whole = f"{_spread(100 * right.mean(axis=0), 1)}, {_spread(loss.mean(axis=0), 3)}"
        lines.append((f"`{name}`" if kind == "method" else name, *cells, whole))
    return (kind, *sets, "mean"), lines


def _spread(seeds: np.ndarray, digits: int) -> str:
    spread = f" ± {seeds.std(ddof=1):.{digits}f}" if len(seeds) > 1 else ""
    return f"{seeds.mean():.{digits}f}{spread}"


def tables(results: Sequence[Result]) -> dict[str, str]:
    """What belongs between the marks of the page, by name; "" where there are no results for it yet."""
    made = {f"weights {kind}s": _noted(results, kind, kind, FOLDS) for kind in ("method", "variant")}
    return made | {"weights light": _noted(results, "light", "method", LIGHT)}


def _noted(results: Sequence[Result], note: str, kind: str, sets: Iterable[str]) -> str:
    """A table with a sentence before it."""
    own = [one for one in results if one.kind == kind and one.set in sets]
    if not own:
        return ""
    head, lines = table(own, kind, sets)
    # A mean over one set and another light of that set says nothing.
    cut = -1 if note == "light" else None
    seeds = len({one.seed for one in own})
    told = NOTES[note].format(seeds=f"seed{'s' * (seeds > 1)} 0{f' to {seeds - 1}' * (seeds > 1)}")
    return f"{told}\n\n{markdown((head[:cut], [line[:cut] for line in lines]))}"


def filled(page: str, made: Mapping[str, str]) -> str:
    """The page with these tables anew."""
    return SLOT.sub(lambda slot: f"{slot[1]}{made.get(slot[2], slot[3])}{slot[4]}", page)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", nargs="?", type=Path, help="the folder of the sets")
    parser.add_argument(
        "--set", action="append", choices=[*FOLDS, *LIGHT], help="run this one only, and leave page and csv alone"
    )
    parser.add_argument("--seeds", type=int, default=SEEDS, help="how many")
    parser.add_argument("--work", metavar="DIR", type=Path, default=Path("weights-work"), help="what is kept of runs")
    options = parser.parse_args()
    logging.getLogger("placerec").setLevel(logging.ERROR)
    if options.data:
        chosen = options.set or [*FOLDS, *LIGHT]
        before = read_results(RESULTS) if RESULTS.exists() else []
        made = list(run(options.data, chosen, range(options.seeds), options.work))
        write_text(RESULTS, format_results([*(one for one in before if one.set not in chosen), *made]))
    write_text(PAGE, filled(PAGE.read_text(encoding="utf-8"), tables(read_results(RESULTS))))
