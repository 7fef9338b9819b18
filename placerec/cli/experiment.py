"""`placerec experiment`."""

from pathlib import Path

import click

from placerec.cli.options import FILE, jobs_option, log, output_option, progress_bar, talk_options


@click.command(epilog="Example: placerec experiment grid.toml -o results/")
@click.argument("config", metavar="CONFIG.toml", type=FILE)
@output_option("results/", "The folder to write; what it holds from before is used again.")
@jobs_option
@talk_options
def experiment(config: Path, out: Path, jobs: int | None) -> None:
    """Run the paper's grid of experiments, or another.

    Every combination of order, smoothing, selection, map size and transitions that CONFIG.toml lists, for every seed
    and fold: results.csv, the paper's figure, its tables, its claims, and a page that shows all of it.

    \b
    [data]
    sequences = ["recordings/*"]  # or tokens = "tokens/{size}-{seed}"
    test = ["run3*"]  # or split = "leave-one-out", "leave-one-illumination-out"
    [grid]
    order = [1, 2, 3, 4, 5, 6]
    smoothing = ["witten-bell", "lidstone-backoff"]
    select = ["none", "subsample:3", "subsample:5", "compress:3", "unique"]
    size = [10, 20]
    transition = ["fixed", "learned"]
    seeds = 5
    """
    from placerec.experiments.grid import experiment as run
    from placerec.jobs import processors

    results = run(config, out, jobs=jobs or processors(), progress=progress_bar)
    log.info("%s: %d rows; now open %s", out / "results.csv", len(results.rows), out / "report.html")
