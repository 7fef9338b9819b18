"""`placerec show-frame`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
    FILE,
    PATH,
    json_option,
    output_option,
    progress_bar,
    reading_options,
    talk_options,
    words_option,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions


@click.command("show-frame", epilog="Example: placerec show-frame frame.png -w words.npz -o seen.png")
@click.argument("image", metavar="IMAGE", type=FILE)
@click.argument("sources", metavar="[SOURCE...]", nargs=-1, type=PATH)
@reading_options()
@words_option(True, "The dictionary of train-words.")
@output_option("seen.png", "Draw what the descriptor sees: .png, .svg or .pdf.", required=False)
@json_option()
@talk_options
def show_frame(
    image: Path,
    sources: tuple[Path, ...],
    source_options: "SourceOptions",
    words: Path,
    out: Path | None,
    as_json: bool,
) -> None:
    """Show what the dictionary sees in an image.

    The picture shows the image as it is fitted, how strong its edges are in each of the 4 x 4 windows by direction
    and scale, and the units of the map that are nearest to it. With SOURCE, which is what tokenize takes, it is told
    what these units look like, and which place they mostly belong to, among the frames there.
    """
    from placerec.inspection.frame import format_frame
    from placerec.inspection.frame import show_frame as run

    with progress_bar("describe") as progress:
        view = run(image, words, sources, out, source_options=source_options, progress=progress)
    click.echo(json.dumps(view.to_json(), indent=2, ensure_ascii=False) if as_json else format_frame(view))
