"""The whole experiment: images or token streams in, a folder of results out."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from placerec.experiments.grid.cells import GridCell, run_cells
from placerec.experiments.grid.config import Config, read_config
from placerec.experiments.grid.jobs import GridJob, find_jobs
from placerec.experiments.grid.report import write_reports
from placerec.experiments.grid.results import FoldData, Results, Row, SequenceCount, write_results
from placerec.experiments.store import held_output
from placerec.figures.canvas import check_figure
from placerec.jobs import ProgressBar, map_jobs, silent

log = logging.getLogger(__name__)


def experiment(config: Path | str, out: Path | str, *, jobs: int = 1, progress: ProgressBar = silent) -> Results:
    """`placerec experiment`: run the grid of a TOML file (`read_config`) and write all that is known to `out`.

    What `out`/cache holds from runs before is used again; the results are the same for any number of `jobs`
    (processes). `progress(label)` is a context manager that gives a callback(done, total). Raises ExperimentError for
    a config that cannot be used, OutputError if another run is at work in `out`, and what the commands raise that it
    stands for.
    """
    out = Path(out)
    check_figure(out / "figure.png")
    plan = read_config(config)
    with held_output(out):
        todo, results = run_grid(plan, out, jobs=jobs, progress=progress)
        write_reports(results, plan, Path(config), todo, out)
    return results


def run_grid(
    plan: Config, out: Path, *, jobs: int = 1, progress: ProgressBar = silent
) -> tuple[list[GridJob], Results]:
    """The jobs of a config and the rows of all their cells, which are written to `out`."""
    todo = find_jobs(plan, out, jobs=jobs, progress=progress)
    log.info("%d cells", sum(len(job.work.cells) for job in todo))
    with progress("recognise") as show:
        found = map_jobs(run_cells, [job.work for job in todo], jobs=jobs, progress=show)
    results = collect(todo, found)
    write_results(results, out)
    return todo, results


def collect(jobs: Sequence[GridJob], found: Sequence[Mapping[str, Any]]) -> Results:
    """The rows of all cells, sorted, and what the folds hold."""
    rows: list[Row] = []
    folds: dict[str, FoldData] = {}
    for job, results in zip(jobs, found, strict=True):
        folds[job.fold.name] = FoldData(results["data"]["train"], results["data"]["test"])
        rows += [_row(job, cell, results) for cell in job.work.cells]
    return Results(sorted(rows, key=_place_in_file), folds)


def _place_in_file(row: Row) -> tuple[int | str, ...]:
    return row.size, row.seed, row.fold, row.smoothing, row.select, row.order, row.transition


def _row(job: GridJob, cell: GridCell, results: Mapping[str, Any]) -> Row:
    found = results[job.work.name(cell)]
    frame_wise, data = results[f"frame-wise {cell.smoothing}"], results["data"]
    labels = found["majority"]
    return Row(
        size=job.size,
        seed=job.seed,
        fold=job.fold.name,
        select=job.work.select,
        same_word_run=data["same_word_run"],
        sequences={
            name: SequenceCount(frames, right, frame_wise[name], labels[name], late)
            for name, (frames, right, late) in found["sequences"].items()
        },
        **cell._asdict(),
        **{name: found[name] for name in _KEPT},
    )


_KEPT = ("frames", "accuracy", "balanced_accuracy", "majority_accuracy", "change_latency_frames", "log_loss", "ece")
