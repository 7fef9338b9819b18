"""Whole experiments: `placerec compare`, `experiment`, `lab` and `demo`."""

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from placerec.cli import shared


@shared.command(epilog="Example: placerec compare RUNS/ --test RUNS/run3 --test RUNS/run7 -o out/")
@click.argument("train", metavar="TRAIN...", nargs=-1, required=True, type=shared.PATH)
@click.option(
    "--test",
    "tests",
    metavar="SEQUENCE",
    multiple=True,
    required=True,
    type=shared.PATH,
    help="What to test on; left out of TRAIN if it is there.  [repeatable]",
)
@click.option(
    "--methods",
    metavar="A,B,...",
    help="Only these methods; those of descriptors on any view: knn@lbp:pn, rbf-svm-hmm@views-tuned.  "
    "[default: all, on the views plain and pn]",
)
@shared.words_option(False, "Your own dictionaries, where they are not to be learned from TRAIN.")
@shared.network_option
@shared.matrix_option
@click.option("--size", type=click.IntRange(2, 200), default=20, help="Side of the map: size x size words.")
@shared.seed_option("Another seed, another map.")
@click.option(
    "--cache",
    metavar="DIR",
    type=shared.PATH,
    help="Where descriptors, words and models are kept for the next run.  [default: out/cache]",
)
@shared.reading_options()
@shared.output_option(
    "out/", "The folder to write: methods.csv, pairs.csv, methods.png and .svg, report.html, beliefs/; more runs go on."
)
@shared.talk_options
def compare(
    train: tuple[Path, ...],
    tests: tuple[Path, ...],
    methods: str | None,
    out: Path,
    words: Path | None,
    matrix: Path | None,
    **how: Any,
) -> None:
    """Run every method on the same test sequences.

    TRAIN and SEQUENCE are labelled sequences (of images, videos, bags), or folders of them. Each method learns from
    TRAIN; accuracy with its interval, cost per frame, and for every two methods whether their difference holds.
    """
    from placerec.experiments.comparison.results import format_comparison
    from placerec.experiments.comparison.run import check_methods, compare as run

    if words and click.get_current_context().get_parameter_source("size") is not ParameterSource.DEFAULT:
        raise click.UsageError("--size is of dictionaries that are learned, and -w names some; leave it out")
    with shared.usage("--methods"):
        chosen = check_methods(None if methods is None else methods.split(","), described=matrix is None)
    found = run(train, tests, out, methods=chosen, words=words, matrix=matrix, progress=shared.progress_bar, **how)
    click.echo(format_comparison(found))


@shared.command(epilog="Example: placerec experiment grid.toml -o results/")
@click.argument("config", metavar="CONFIG.toml", type=shared.FILE)
@shared.output_option("results/", "The folder to write; what it holds from before is used again.")
@shared.jobs_option
@shared.talk_options
def experiment(config: Path, out: Path, jobs: int | None) -> None:
    """Run the paper's grid of experiments, or another.

    Every combination of order, smoothing, selection, map size and transitions that CONFIG.toml lists, for every seed
    and fold: results.csv, the paper's figure, its tables, its claims, and a page that shows all of it. Beside the grid
    stands what `placerec learn` makes of the same images.

    \b
    [data]
    sequences = ["recordings/*"]  # or tokens = "tokens/{size}-{seed}"
    test = ["run3*"]  # or split = "leave-one-out", "leave-one-illumination-out", "light"
    [grid]
    order = [1, 2, 3, 4, 5, 6]
    smoothing = ["witten-bell", "lidstone-backoff"]
    select = ["none", "subsample:3", "subsample:5", "compress:3", "unique"]
    size = [10, 20]
    transition = ["fixed", "learned"]
    seeds = 5
    [options]
    as_in_paper = true  # the grid alone
    """
    from placerec.experiments.grid.run import experiment as run
    from placerec.jobs import processors

    results = run(config, out, jobs=jobs or processors(), progress=shared.progress_bar)
    shared.log.info("%s: %d rows; now open %s", out / "results.csv", len(results.rows), out / "report.html")


@shared.command(epilog="Example: placerec lab LAB/ --scale tiny --seed 1")
@click.argument("out", metavar="OUT/", type=shared.PATH)
@click.option(
    "--scale",
    type=click.Choice(["tiny", "small", "paper"]),
    default="small",
    help="How many frames: about 900, 2400 or 16 500.",
)
@shared.seed_option("Another seed, another laboratory.")
@shared.talk_options
def lab(out: Path, scale: str, seed: int) -> None:
    """Render the synthetic laboratory, in COLD's layout.

    18 image sequences of five places: two paths, three illuminations, three runs of each.
    """
    from placerec.lab.layout import render_lab

    with shared.progress_bar("render") as progress:
        frames = render_lab(out, scale=scale, seed=seed, progress=progress)
    codes = "CR-B is the corridor, TL-B the toilet, 1PO-B the office, PA-B the printer area, KT-B the kitchen"
    shared.log.info("%s: 18 sequences, %d synthetic frames; %s", out, frames, codes)


@shared.command(epilog="Example: placerec demo")
@shared.output_option("demo/", "The folder to write.  [default: demo/]", required=False)
@shared.seed_option("Seed of the laboratory and the maps.")
@click.option("--as-in-paper", is_flag=True, help="Show the paper's systems alone.")
@shared.talk_options
def demo(out: Path | None, seed: int, as_in_paper: bool) -> None:
    """Run all of it on the synthetic laboratory.

    Images, words, models and beliefs, by `placerec learn` and as in the paper, and at the end a page to look at.
    """
    from placerec.demo import format_results, run_demo

    out = out or Path("demo")
    results = run_demo(out, seed=seed, as_in_paper=as_in_paper, progress=shared.progress_bar)
    click.echo(format_results(results))
    shared.log.info("\nNow open %s", out / "report.html")
