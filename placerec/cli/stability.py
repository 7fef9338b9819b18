"""`placerec stability`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
    json_option,
    output_option,
    progress_bar,
    source_arguments,
    talk_options,
    words_option,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions


@click.command(epilog="Example: placerec stability RUNS/ -w words.npz -o stability.png")
@source_arguments
@words_option(True, "The dictionary of train-words.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the noise.")
@output_option("stability.png", "Draw the table as bars: .png, .svg or .pdf.", required=False)
@json_option()
@talk_options
def stability(
    sources: tuple[Path, ...], source_options: "SourceOptions", words: Path, seed: int, out: Path | None, as_json: bool
) -> None:
    """Measure how stable the words are.

    SOURCE is what tokenize takes. Every frame is spoilt by JPEG compression, noise, brightness, blur, a shift of one
    pixel and another resize filter; told is the share of frames that get another word, and how many of these words
    are next to the right one on the map.
    """
    from placerec.inspection.word_stability import format_stability
    from placerec.inspection.word_stability import stability as run

    with progress_bar("stability") as progress:
        found = run(sources, words, out, source_options=source_options, seed=seed, progress=progress)
    click.echo(json.dumps(found.to_json(), indent=2) if as_json else format_stability(found))
