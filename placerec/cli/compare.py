"""`placerec compare`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import PATH, output_option, progress_bar, reading_options, talk_options, usage

if TYPE_CHECKING:
    from placerec.frames import SourceOptions


@click.command(epilog="Example: placerec compare RUNS/ --test RUNS/run3 --test RUNS/run7 -o out/")
@click.argument("train", metavar="TRAIN...", nargs=-1, required=True, type=PATH)
@click.option(
    "--test",
    "tests",
    metavar="SEQUENCE",
    multiple=True,
    required=True,
    type=PATH,
    help="What to test on; left out of TRAIN if it is there.  [repeatable]",
)
@click.option("--methods", metavar="A,B,...", default=None, help="Only these methods.  [default: all]")
@click.option(
    "--size", type=click.IntRange(2, 200), default=20, show_default=True, help="Side of the map: size x size words."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Another seed, another map.")
@click.option(
    "--cache",
    metavar="DIR",
    type=PATH,
    default=None,
    help="Where descriptors, words and models are kept for the next run.  [default: out/cache]",
)
@reading_options()
@output_option(
    "out/", "The folder to write: methods.csv, pairs.csv, methods.png, beliefs/; a second run goes on there."
)
@talk_options
def compare(
    train: tuple[Path, ...],
    tests: tuple[Path, ...],
    methods: str | None,
    size: int,
    seed: int,
    cache: Path | None,
    source_options: "SourceOptions",
    out: Path,
) -> None:
    """Run every method on the same test sequences.

    TRAIN and SEQUENCE are labelled sequences (of images, videos, bags), or folders of them. Each method learns from
    TRAIN; accuracy with its interval, cost per frame, and for every two methods whether their difference holds.
    """
    from placerec.experiments.comparison.results import format_comparison
    from placerec.experiments.comparison.run import check_methods
    from placerec.experiments.comparison.run import compare as run

    with usage("--methods"):
        chosen = check_methods(None if methods is None else methods.split(","))
    found = run(
        train,
        tests,
        out,
        methods=chosen,
        size=size,
        seed=seed,
        source_options=source_options,
        cache=cache,
        progress=progress_bar,
    )
    click.echo(format_comparison(found))
