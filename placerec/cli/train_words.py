"""`placerec train-words`."""

from pathlib import Path

import click

from placerec.cli.options import descriptor_options, output_option, progress_bar, source_arguments, talk_options


@click.command("train-words", epilog="Example: placerec train-words RUNS/ -o words.npz --size 20")
@source_arguments
@click.option(
    "--size", type=click.IntRange(2, 200), default=10, show_default=True, help="Side of the map: size x size words."
)
@click.option("--components", type=click.IntRange(min=1), default=80, show_default=True, help="Principal components.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Another seed, another map.")
@click.option(
    "--fraction",
    type=click.FloatRange(0, 1, min_open=True),
    default=1.0,
    show_default=True,
    help="Share of the frames to train on, drawn by the seed.",
)
@click.option(
    "--epochs",
    type=click.IntRange(min=1),
    default=None,
    help="Passes over the frames.  [default: until stable, at most 50]",
)
@click.option(
    "--units",
    type=click.Choice(["live", "all"]),
    default="live",
    show_default=True,
    help="Whether units that no training frame hit can be words.",
)
@descriptor_options
@output_option(metavar="words.npz", text="The dictionary to write.")
@talk_options
def train_words(
    sources: tuple[Path, ...],
    format_: str,
    size: int,
    components: int,
    seed: int,
    fraction: float,
    epochs: int | None,
    units: str,
    variant: str,
    image_size: int,
    fit: str,
    out: Path,
) -> None:
    """Learn the visual words: PCA and a self-organising map over GIST descriptors."""
    from placerec.vision import DescriptorSpec, train_dictionary

    with progress_bar("describe") as progress:
        train_dictionary(
            sources,
            out,
            spec=DescriptorSpec(variant, image_size, fit),
            format=format_,
            size=size,
            components=components,
            seed=seed,
            fraction=fraction,
            epochs=epochs,
            units=units,
            progress=progress,
        )
