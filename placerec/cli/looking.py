"""What the dictionary sees: `placerec show-words`, `show-frame` and `stability`."""

from pathlib import Path
from typing import Any

import click

from placerec.cli.options import (
    FILE,
    PATH,
    echo_json,
    json_option,
    matrix_option,
    output_option,
    progress_bar,
    reading_options,
    seed_option,
    source_arguments,
    talk_options,
    words_option,
)


@click.command("show-words", epilog="Example: placerec show-words words.npz RUNS/ -o words.png")
@click.argument("words", metavar="words.npz", type=FILE)
@source_arguments
@matrix_option
@output_option("words.png", "Draw all words on one sheet: .png, .svg or .pdf.", required=False)
@json_option("Print JSON, with a row for every unit of the map.")
@talk_options
def show_words(words: Path, sources: tuple[Path, ...], out: Path | None, as_json: bool, **how: Any) -> None:
    """Show the typical frame and place of each word.

    SOURCE is what tokenize takes: the frames to look at, of the training or of later runs. For every unit of the map
    the sheet shows the frame nearest to it, the place that most frames with this word have, and the training frames
    that hit it; and how far neighbouring units are from each other (U-matrix).
    """
    from placerec.inspection.word_sheet import show_words as run
    from placerec.inspection.words import format_words

    with progress_bar("describe") as progress:
        table = run(words, sources, out, progress=progress, **how)
    echo_json(table.to_json()) if as_json else click.echo(format_words(table))


@click.command("show-frame", epilog="Example: placerec show-frame frame.png -w words.npz -o seen.png")
@click.argument("image", metavar="IMAGE", type=FILE)
@click.argument("sources", metavar="[SOURCE...]", nargs=-1, type=PATH)
@reading_options()
@words_option(True, "The dictionary of train-words.")
@output_option("seen.png", "Draw what the descriptor sees: .png, .svg or .pdf.", required=False)
@json_option()
@talk_options
def show_frame(
    image: Path, sources: tuple[Path, ...], words: Path, out: Path | None, as_json: bool, **how: Any
) -> None:
    """Show what the dictionary sees in an image.

    The picture shows the image as it is fitted, how strong its edges are in each of the 4 x 4 windows by direction
    and scale, and the units of the map that are nearest to it. With SOURCE, which is what tokenize takes, it is told
    what these units look like, and which place they mostly belong to, among the frames there.
    """
    from placerec.inspection.frame import format_frame
    from placerec.inspection.frame import show_frame as run

    with progress_bar("describe") as progress:
        view = run(image, words, sources, out, progress=progress, **how)
    echo_json(view.to_json()) if as_json else click.echo(format_frame(view))


@click.command(epilog="Example: placerec stability RUNS/ -w words.npz -o stability.png")
@source_arguments
@words_option(True, "The dictionary of train-words.")
@seed_option("Seed of the noise.")
@output_option("stability.png", "Draw the table as bars: .png, .svg or .pdf.", required=False)
@json_option()
@talk_options
def stability(sources: tuple[Path, ...], words: Path, out: Path | None, as_json: bool, **how: Any) -> None:
    """Measure how stable the words are.

    SOURCE is what tokenize takes. Every frame is spoilt by JPEG compression, noise, brightness, blur, a shift of one
    pixel and another resize filter; told is the share of frames that get another word, and how many of these words
    are next to the right one on the map.
    """
    from placerec.inspection.word_stability import format_stability
    from placerec.inspection.word_stability import stability as run

    with progress_bar("stability") as progress:
        found = run(sources, words, out, progress=progress, **how)
    echo_json(found.to_json()) if as_json else click.echo(format_stability(found))
