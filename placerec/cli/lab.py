"""`placerec lab`."""

from pathlib import Path

import click

from placerec.cli.options import PATH, log, progress_bar, talk_options


@click.command(epilog="Example: placerec lab LAB/ --scale tiny --seed 1")
@click.argument("out", metavar="OUT/", type=PATH)
@click.option(
    "--scale",
    type=click.Choice(["tiny", "small", "paper"]),
    default="small",
    show_default=True,
    help="How many frames: about 900, 2400 or 16 500.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Another seed, another laboratory."
)
@talk_options
def lab(out: Path, scale: str, seed: int) -> None:
    """Render the synthetic laboratory, in COLD's layout.

    18 image sequences of five places: two paths, three illuminations, three runs of each.
    """
    from placerec.lab import render_lab

    with progress_bar("render") as progress:
        frames = render_lab(out, scale=scale, seed=seed, progress=progress)
    log.info("%s: 18 sequences, %d synthetic frames", out, frames)
