"""`placerec describe`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
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


@click.command(epilog="Example: placerec describe COLD/seq1_cloudy1 -o descriptors.npz")
@source_arguments
@descriptor_options
@output_option("descriptors.npz", "The file to write: arrays descriptors, frames, sequences, places, times.")
@work_options
@talk_options
def describe(
    sources: tuple[Path, ...],
    source_options: "SourceOptions",
    spec: "DescriptorSpec | None",
    matrix: Path | None,
    out: Path,
    work: "Executor",
) -> None:
    """Write the descriptor of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or laid out as in COLD, KTH-IDOL2 or VPC), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    """
    from placerec.vision import describe_sources

    with progress_bar("describe") as progress:
        describe_sources(
            sources, out, spec=spec, matrix=matrix, source_options=source_options, work=work, progress=progress
        )
