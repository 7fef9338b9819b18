"""`placerec train-words`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from placerec.cli.options import (
    PATH,
    FiniteRange,
    descriptor_options,
    output_option,
    progress_bar,
    source_arguments,
    talk_options,
    work_options,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions
    from placerec.jobs import Executor
    from placerec.vision import DescriptorSpec


@click.command("train-words", epilog="Example: placerec train-words RUNS/ -o words.npz --size 20")
@source_arguments
@click.option(
    "--size", type=click.IntRange(2, 200), default=10, show_default=True, help="Side of the map: size x size words."
)
@click.option(
    "--components",
    type=click.IntRange(min=1),
    default=80,
    show_default=True,
    help="Principal components that the map sees.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Another seed, another map.")
@click.option(
    "--fraction",
    type=FiniteRange(0, 1, min_open=True),
    default=1.0,
    show_default=True,
    help="Share of the frames to train on, drawn by the seed.",
)
@click.option(
    "--epochs",
    type=click.IntRange(min=1),
    default=None,
    help="Passes over the frames.  [default: 50, or fewer if the words settle]",
)
@click.option(
    "--units",
    type=click.Choice(["live", "all"]),
    default="live",
    show_default=True,
    help="Whether units that no training frame hit can be words.",
)
@click.option(
    "--rule",
    type=click.Choice(["batch", "online"]),
    default="batch",
    show_default=True,
    help="All frames at once, or Kohonen's one after the other (slow, for comparison).",
)
@click.option(
    "--width",
    type=FiniteRange(min=0, min_open=True),
    default=0.5,
    show_default=True,
    help="Final width of the neighbourhood, in units; it starts at size/2.",
)
@click.option(
    "--held-out",
    metavar="SOURCE",
    multiple=True,
    type=PATH,
    help="Images that train nothing: how well the map represents them is told.  [repeatable]",
)
@descriptor_options
@output_option("words.npz", "The dictionary to write.")
@work_options
@talk_options
def train_words(
    sources: tuple[Path, ...],
    source_options: "SourceOptions",
    held_out: tuple[Path, ...],
    spec: "DescriptorSpec | None",
    matrix: Path | None,
    out: Path,
    work: "Executor",
    **options: Any,
) -> None:
    """Learn visual words: PCA and a map of descriptors.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    """
    from placerec.vision import DictionaryOptions, train_dictionary

    with progress_bar("describe") as progress:
        train_dictionary(
            sources,
            out,
            spec=spec,
            matrix=matrix,
            source_options=source_options,
            options=DictionaryOptions(**options),
            held_out=held_out,
            work=work,
            progress=progress,
        )
