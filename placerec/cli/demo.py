"""`placerec demo`."""

from pathlib import Path

import click

from placerec.cli.options import log, output_option, progress_bar, talk_options


@click.command(epilog="Example: placerec demo")
@output_option("demo/", "The folder to write.  [default: demo/]", required=False)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the laboratory and the map."
)
@talk_options
def demo(out: Path | None, seed: int) -> None:
    """Run all of it on the synthetic laboratory.

    Images, words, models and beliefs, and at the end a page to look at.
    """
    from placerec.demo import format_results, run_demo

    out = out or Path("demo")
    results = run_demo(out, seed=seed, progress=progress_bar)
    click.echo(format_results(results))
    log.info("\nNow open %s", out / "report.html")
