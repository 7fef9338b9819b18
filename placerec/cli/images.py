"""From images to words: `placerec describe`, `train-words` and `tokenize`."""

from pathlib import Path
from typing import Any

import click

from placerec.cli.options import (
    PATH,
    FiniteRange,
    descriptor_options,
    matrix_option,
    output_option,
    progress_bar,
    seed_option,
    size_option,
    source_arguments,
    talk_options,
    words_option,
    work_options,
)


@click.command(epilog="Example: placerec describe COLD/seq1_cloudy1 -o descriptors.npz")
@source_arguments
@descriptor_options
@output_option("descriptors.npz", "The file to write: arrays descriptors, frames, sequences, places, times.")
@work_options
@talk_options
def describe(sources: tuple[Path, ...], out: Path, **how: Any) -> None:
    """Write the descriptor of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    """
    from placerec.vision import describe_sources

    with progress_bar("describe") as progress:
        describe_sources(sources, out, progress=progress, **how)


@click.command("train-words", epilog="Example: placerec train-words RUNS/ -o words.npz --size 20")
@source_arguments
@size_option(10)
@click.option(
    "--components",
    type=click.IntRange(min=1),
    default=80,
    show_default=True,
    help="Principal components that the map sees.",
)
@seed_option("Another seed, another map.")
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
def train_words(sources: tuple[Path, ...], out: Path, **how: Any) -> None:
    """Learn visual words: PCA and a map of descriptors.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    """
    from dataclasses import fields

    from placerec.vision import DictionaryOptions, train_dictionary

    options = DictionaryOptions(**{field.name: how.pop(field.name) for field in fields(DictionaryOptions)})
    with progress_bar("describe") as progress:
        train_dictionary(sources, out, options=options, progress=progress, **how)


@click.command(epilog="Example: placerec tokenize RUNS/ -w words.npz -o tokens/")
@source_arguments
@words_option(True, "The dictionary of train-words.")
@matrix_option
@output_option("tokens/", "The folder to write: one .tsv per sequence, and vocab.txt.")
@work_options
@talk_options
def tokenize(sources: tuple[Path, ...], words: Path, out: Path, **how: Any) -> None:
    """Write the visual word of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    A camera (camera:0, camera:rtsp://...) is recorded until Ctrl-C.
    """
    from placerec.words.tokenize import tokenize as run

    with progress_bar("tokenize") as progress:
        run(sources, words, out, progress=progress, **how)
