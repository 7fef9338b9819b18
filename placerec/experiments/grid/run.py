"""The whole experiment: images or token streams in, a folder of results out."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from placerec.errors import OutputError
from placerec.experiments.grid import cache
from placerec.experiments.grid.cells import Cell, run_cells
from placerec.experiments.grid.config import Config, read_config
from placerec.experiments.grid.report import write_reports
from placerec.experiments.grid.results import FoldData, Results, Row, SequenceCount, write_results
from placerec.experiments.grid.units import ProgressBar, Unit, find_units
from placerec.figures.panels import check_figure
from placerec.files import held_folder
from placerec.jobs import map_jobs

log = logging.getLogger(__name__)


@contextmanager
def _silence(label: str) -> Iterator[Callable[[int, int], None]]:
    yield lambda done, total: None


def experiment(config: Path | str, out: Path | str, *, jobs: int = 1, progress: ProgressBar = _silence) -> Results:
    """`placerec experiment`: run the grid of a TOML file (`read_config`) and write all that is known to `out`.

    What `out`/cache holds from runs before is used again; the results are the same for any number of `jobs`
    (processes). `progress(label)` is a context manager that gives a callback(done, total). Raises ExperimentError for
    a config that cannot be used, OutputError if another run is at work in `out`, and what the commands raise that it
    stands for.
    """
    out = Path(out)
    check_figure(out / "figure.png")
    plan = read_config(config)
    with _at_work(out):
        units, results = run_grid(plan, out, jobs=jobs, progress=progress)
        write_reports(results, plan, Path(config), units, out)
    return results


def run_grid(plan: Config, out: Path, *, jobs: int = 1, progress: ProgressBar = _silence) -> tuple[list[Unit], Results]:
    """The units of a config and the rows of all their cells, which are written to `out`."""
    units = find_units(plan, out, jobs=jobs, progress=progress)
    log.info("%d cells", sum(len(unit.job.cells) for unit in units))
    with progress("recognise") as show:
        found = map_jobs(run_cells, [unit.job for unit in units], jobs=jobs, progress=show)
    results = collect(units, found)
    write_results(results, out)
    return units, results


@contextmanager
def _at_work(out: Path) -> Iterator[None]:
    """Keep other runs out of the folder, and clear away what a killed one left."""
    folders = [out, *(out / "cache" / name for name in ("descriptors", "words", "tokens", "cells"))]
    try:
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{error.filename}: cannot be written: {error.strerror}") from error
    with held_folder(out):
        cache.sweep(folders)
        yield


def collect(units: Sequence[Unit], found: Sequence[Mapping[str, Any]]) -> Results:
    """The rows of all cells, sorted, and what the folds hold."""
    rows: list[Row] = []
    folds: dict[str, FoldData] = {}
    for unit, results in zip(units, found, strict=True):
        folds[unit.fold.name] = FoldData(results["data"]["train"], results["data"]["test"])
        rows += [_row(unit, cell, results) for cell in unit.job.cells]
    return Results(sorted(rows, key=_place_in_file), folds)


def _place_in_file(row: Row) -> tuple[int | str, ...]:
    return row.size, row.seed, row.fold, row.smoothing, row.select, row.order, row.transition


def _row(unit: Unit, cell: Cell, results: Mapping[str, Any]) -> Row:
    found = results[unit.job.name(cell)]
    frame_wise, data = results[f"frame-wise {cell.smoothing}"], results["data"]
    labels = found["majority"]
    return Row(
        size=unit.size,
        seed=unit.seed,
        fold=unit.fold.name,
        select=unit.job.select,
        same_word_run=data["same_word_run"],
        sequences={
            name: SequenceCount(frames, right, frame_wise[name], labels[name], late)
            for name, (frames, right, late) in found["sequences"].items()
        },
        **cell._asdict(),
        **{name: found[name] for name in _KEPT},
    )


_KEPT = ("frames", "accuracy", "balanced_accuracy", "majority_accuracy", "change_latency_frames", "log_loss", "ece")
