"""The tables of docs/experiment.md, and the results that they are made of.

python docs/make/experiment_page.py [DATA] [--set NAME ...] [--work DIR] [--jobs N]

With DATA, the folder of the sets, every docs/experiment/SET.toml is run first (`placerec experiment`), the synthetic
laboratory is rendered if it is not there, and results.csv, sequences.csv and the figures go to docs/experiment/SET/.
What is in DIR from a run before is used again. Then the tables of the page are written anew from the csv files.
"""

import argparse
import csv
import logging
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from placerec.evaluation.bootstrap import LEAST
from placerec.experiments.grid.claims import Claim, judge
from placerec.experiments.grid.report import Table, markdown, numbers_of
from placerec.experiments.grid.results import Results, Row, SequenceCount, by_seed
from placerec.experiments.grid.run import experiment
from placerec.files import write_text
from placerec.lab.layout import render_lab

PAGE = Path(__file__).parents[1] / "experiment.md"
FOLDER = PAGE.with_suffix("")
KEPT = ("results.csv", "sequences.csv", "figure.svg", "figure-learned.svg")
# What `placerec learn` makes of images; of token streams there is none.
LEARNED = "learned.csv"
SYNTHETIC = "synthetic"
SHARES = ("accuracy", "balanced_accuracy", "majority_accuracy", "same_word_run", "log_loss", "ece")
TRANSITIONS = ("fixed", "learned")
SELECTIONS = ("none", "subsample:3", "subsample:5", "compress:3", "unique")
SLOT = re.compile(r"(<!-- table: (.+?) -->\n)(.*?)(<!-- end of table -->)", re.DOTALL)


def run(name: str, data: Path, work: Path, jobs: int) -> None:
    """Run a set's experiment in `work`, and keep what belongs to the page."""
    (work / "data").mkdir(parents=True, exist_ok=True)
    images = work / "data" / name
    if name == SYNTHETIC and not images.exists():
        render_lab(images, scale="paper")
    elif name != SYNTHETIC:
        images.unlink(missing_ok=True)
        images.symlink_to((data / name).resolve(), target_is_directory=True)
    config = shutil.copy(FOLDER / f"{name}.toml", work)
    experiment(config, work / name, jobs=jobs)
    (FOLDER / name).mkdir(exist_ok=True)
    for kept in (*KEPT, *([LEARNED] if (work / name / LEARNED).exists() else [])):
        shutil.copy(work / name / kept, FOLDER / name)


def read_rows(folder: Path) -> list[Row]:
    """The rows of results.csv and sequences.csv, as they were written."""
    sequences: dict[tuple[str, ...], dict[str, SequenceCount]] = {}
    for line in _lines(folder / "sequences.csv"):
        key, counts = tuple(line.values())[:7], [int(number) for number in tuple(line.values())[8:]]
        sequences.setdefault(key, {})[line["sequence"]] = SequenceCount(*counts)
    return [_row(line, sequences[tuple(line.values())[:7]]) for line in _lines(folder / "results.csv")]


def _lines(path: Path) -> Iterator[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.DictReader(file)


def _row(line: Mapping[str, str], sequences: Mapping[str, SequenceCount]) -> Row:
    late = line["change_latency_frames"]
    return Row(
        size=int(line["size"]),
        seed=int(line["seed"]),
        fold=line["fold"],
        smoothing=line["smoothing"],
        select=line["select"],
        order=int(line["order"]),
        transition=line["transition"],
        frames=int(line["frames"]),
        change_latency_frames=float(late) if late else None,
        sequences=sequences,
        **{name: float(line[name]) for name in SHARES},
    )


def read_all() -> dict[str, list[Row]]:
    """The rows of every set whose results are there."""
    return {path.parent.name: read_rows(path.parent) for path in sorted(FOLDER.glob("*/results.csv"))}


def tables(found: Mapping[str, Sequence[Row]]) -> dict[str, str]:
    """What belongs between the marks of the page, by name; real and synthetic sets share no table."""
    made = {}
    claims = {name: [judge(Results(rows, {}), of) for of in TRANSITIONS] for name, rows in found.items()}
    for name, rows in found.items():
        made[f"{name} data"] = data_line(rows) + learned_line(FOLDER / name / LEARNED)
        made[f"{name} baselines"] = markdown(baselines_table(rows))
        made[f"{name} selection"] = markdown(selection_table(rows))
        made[f"{name} order"] = markdown(order_table(rows))
        made[f"{name} claims"] = markdown(claims_table(claims[name]))
    synthetic = {SYNTHETIC: claims.pop(SYNTHETIC)}
    enough = {name: its for name, its in claims.items() if len(_sequences(found[name])) >= LEAST}
    made["real verdicts"] = markdown(verdicts_table(enough))
    made["synthetic verdicts"] = markdown(verdicts_table(synthetic))
    return made


def _sequences(rows: Sequence[Row]) -> dict[str, int]:
    """The test sequences and their frames."""
    return {name: one.frames for row in rows for name, one in row.sequences.items()}


def data_line(rows: Sequence[Row]) -> str:
    """What was tested, and how much of it was right over all."""
    frames = _sequences(rows)
    folds, seeds = len({row.fold for row in rows}), len({row.seed for row in rows})
    fixed, learned = (_percent(_of(rows, transition=of)).mean() for of in TRANSITIONS)
    return (
        f"{sum(frames.values())} test frames of {len(frames)} sequences, {folds} fold{'s' * (folds != 1)}, "
        f"{seeds} maps of each size; {len(rows)} rows in results.csv. Mean over all cells: {fixed:.1f} % right with "
        f"fixed transitions, {learned:.1f} % with learned ones.\n"
    )


def learned_line(path: Path) -> str:
    """How much of the same frames `placerec learn` has right, mean and deviation over seeds; "" without the file."""
    if not path.exists():
        return ""
    of_seed: dict[str, list[dict[str, str]]] = {}
    for line in _lines(path):
        of_seed.setdefault(line["seed"], []).append(line)
    frames = np.array([[int(line["frames"]) for line in lines] for lines in of_seed.values()])
    right = np.array([[int(line["right"]) for line in lines] for lines in of_seed.values()])
    loss = np.array([[float(line["log_loss"]) for line in lines] for lines in of_seed.values()])
    percent, nats = 100 * right.sum(axis=1) / frames.sum(axis=1), (frames * loss).sum(axis=1) / frames.sum(axis=1)
    return (
        f"\nThe system of `placerec learn` on the same folds, {len(percent)} seeds: {_text(percent)} % right, log loss "
        f"{nats.mean():.2f}.\n"
    )


def _percent(rows: Sequence[Row], share: Callable[[SequenceCount], int] = lambda one: one.right) -> np.ndarray:
    """Percent of the frames for every seed, mean over the settings of the rows."""
    mean: np.ndarray = 100 * np.mean([*by_seed(rows, share).values()], axis=0)
    return mean


def _of(rows: Sequence[Row], **wanted: object) -> list[Row]:
    return [row for row in rows if all(getattr(row, name) == value for name, value in wanted.items())]


def _text(percent: np.ndarray) -> str:
    return f"{percent.mean():.1f} ± {percent.std(ddof=1):.1f}"


def baselines_table(rows: Sequence[Row]) -> Table:
    """For every size and transition the baselines, orders 1 and 2 with nothing selected, and the best cell."""
    lines = []
    for size in sorted({row.size for row in rows}):
        for transition in TRANSITIONS:
            own = _of(rows, size=size, transition=transition)
            plain = _of(own, smoothing="witten-bell", select="none")
            runs = {(row.seed, row.fold): row.same_word_run for row in own}
            seeds = by_seed(own)
            setting = max(sorted(seeds), key=lambda setting: np.mean(seeds[setting]))
            lines.append(
                (
                    *(str(size), transition, f"{np.mean([*runs.values()]):.2f}"),
                    f"{_percent(own, lambda one: one.majority).mean():.1f}",
                    f"{_percent(plain, lambda one: one.frame_wise).mean():.1f}",
                    *(_text(_percent(_of(plain, order=order))) for order in (1, 2)),
                    _text(100 * np.array(seeds[setting])),
                    f"{setting.smoothing}, {setting.select}, n = {setting.order}",
                )
            )
    head = ("S", "transitions", "same-word run", "most frequent place", "each frame alone", "n = 1", "n = 2")
    return (*head, "best cell", "which"), lines


def selection_table(rows: Sequence[Row]) -> Table:
    """For every smoothing and selection the frames right, late and wrong otherwise, and the log loss."""
    lines = []
    for smoothing, select in product(("witten-bell", "lidstone-backoff"), SELECTIONS):
        line = [smoothing, select]
        for transition in TRANSITIONS:
            own = _of(rows, smoothing=smoothing, select=select, transition=transition)
            right, late = _percent(own), _percent(own, lambda one: one.late).mean()
            loss = np.mean([row.log_loss for row in own])
            line += [_text(right), f"{late:.1f}", f"{100 - right.mean() - late:.1f}", f"{loss:.2f}"]
        lines.append(line)
    measured = ("right", "late", "else wrong", "log loss")
    return ("smoothing", "selection", *(f"{of}: {what}" for of in TRANSITIONS for what in measured)), lines


def order_table(rows: Sequence[Row]) -> Table:
    """For every order the frames right without selection, mean over sizes."""
    orders = sorted({row.order for row in rows})
    lines = []
    for transition in TRANSITIONS:
        for smoothing in ("witten-bell", "lidstone-backoff"):
            own = _of(rows, transition=transition, smoothing=smoothing, select="none")
            lines.append((transition, smoothing, *(f"{_percent(_of(own, order=n)).mean():.1f}" for n in orders)))
    return ("transitions", "smoothing", *(f"n = {n}" for n in orders)), lines


def claims_table(both: Sequence[Sequence[Claim]]) -> Table:
    """A line per statement, with fixed and with learned transitions."""
    lines = []
    for claims in zip(*both, strict=True):
        for number, same in enumerate(zip(*(claim.statements for claim in claims), strict=True)):
            line = ["" if number else claims[0].name, same[0].text, same[0].wanted]
            for one in same:
                points, between, _ = numbers_of(one)
                line += [f"{points} ({between})", one.verdict]
            lines.append(line)
    head = (cell for of in TRANSITIONS for cell in (f"{of}: points (95 %)", "verdict"))
    return ("claim", "measured", "wanted", *head), lines


def verdicts_table(sets: Mapping[str, Sequence[Sequence[Claim]]]) -> Table:
    """A line per claim: its verdict on every set, with fixed and with learned transitions."""
    judged = [claims for both in sets.values() for claims in both]
    lines = [(same[0].name, same[0].text, *(claim.verdict for claim in same)) for same in zip(*judged, strict=True)]
    return ("claim", "the paper says", *(f"{name}, {of}" for name in sets for of in TRANSITIONS)), lines


def filled(page: str, made: Mapping[str, str]) -> str:
    """The page with every table anew; KeyError for a mark without a table."""
    return SLOT.sub(lambda slot: f"{slot[1]}{made[slot[2]]}{slot[4]}", page)


if __name__ == "__main__":
    names = sorted(path.stem for path in FOLDER.glob("*.toml"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", nargs="?", type=Path, help="the folder of the sets")
    parser.add_argument("--set", action="append", choices=names, help="run this one only")
    parser.add_argument(
        "--work", metavar="DIR", type=Path, default=Path("experiment-work"), help="what is kept of runs"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    options = parser.parse_args()
    logging.getLogger("placerec").setLevel(logging.ERROR)
    for name in (options.set or names) if options.data else ():
        run(name, options.data, options.work, options.jobs)
        sys.stderr.write(f"{name}: done\n")
    write_text(PAGE, filled(PAGE.read_text(encoding="utf-8"), tables(read_all())))
