"""`placerec describe`."""

from pathlib import Path

import click

from placerec.cli.options import descriptor_options, output_option, progress_bar, source_arguments, talk_options


@click.command(epilog="Example: placerec describe COLD/seq1_cloudy1 -o descriptors.npz")
@source_arguments
@descriptor_options
@output_option(metavar="FILE.npz", text="The file to write: arrays descriptors, frames, sequences, places, times.")
@talk_options
def describe(sources: tuple[Path, ...], format_: str, variant: str, image_size: int, fit: str, out: Path) -> None:
    """Write the GIST descriptor of every frame, for use elsewhere."""
    from placerec.vision import DescriptorSpec, describe_sources

    with progress_bar("describe") as progress:
        describe_sources(sources, out, spec=DescriptorSpec(variant, image_size, fit), format=format_, progress=progress)
