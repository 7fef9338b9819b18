"""`placerec tokenize`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
    descriptor_option,
    output_option,
    progress_bar,
    source_arguments,
    talk_options,
    words_option,
    work_options,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions
    from placerec.jobs import Executor


@click.command(epilog="Example: placerec tokenize RUNS/ -w words.npz -o tokens/")
@source_arguments
@words_option(True, "The dictionary of train-words.")
@descriptor_option("The frames' descriptors, if those of the dictionary were computed elsewhere.")
@output_option("tokens/", "The folder to write: one .tsv per sequence, and vocab.txt.")
@work_options
@talk_options
def tokenize(
    sources: tuple[Path, ...],
    source_options: "SourceOptions",
    words: Path,
    descriptor: tuple[str, Path] | None,
    out: Path,
    work: "Executor",
) -> None:
    """Write the visual word of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    A camera (camera:0, camera:rtsp://...) is recorded until Ctrl-C.
    """
    from placerec.words.tokenize import tokenize as run

    with progress_bar("tokenize") as progress:
        run(
            sources,
            words,
            out,
            matrix=descriptor and descriptor[1],
            source_options=source_options,
            work=work,
            progress=progress,
        )
