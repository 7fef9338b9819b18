"""`placerec show-words`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
    FILE,
    descriptor_option,
    json_option,
    output_option,
    progress_bar,
    source_arguments,
    talk_options,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions


@click.command("show-words", epilog="Example: placerec show-words words.npz RUNS/ -o words.png")
@click.argument("words", metavar="words.npz", type=FILE)
@source_arguments
@descriptor_option("The frames' descriptors, if those of the dictionary were computed elsewhere.")
@output_option("words.png", "Draw all words on one sheet: .png, .svg or .pdf.", required=False)
@json_option("Print JSON, with a row for every unit of the map.")
@talk_options
def show_words(
    words: Path,
    sources: tuple[Path, ...],
    source_options: "SourceOptions",
    descriptor: tuple[str, Path] | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Show the typical frame and place of each word.

    SOURCE is what tokenize takes: the frames to look at, of the training or of later runs. For every unit of the map
    the sheet shows the frame nearest to it, the place that most frames with this word have, and the training frames
    that hit it; and how far neighbouring units are from each other (U-matrix).
    """
    from placerec.inspection.word_sheet import show_words as run
    from placerec.inspection.words import format_words

    with progress_bar("describe") as progress:
        matrix = descriptor and descriptor[1]
        table = run(words, sources, out, matrix=matrix, source_options=source_options, progress=progress)
    click.echo(json.dumps(table.to_json(), indent=2, ensure_ascii=False) if as_json else format_words(table))
