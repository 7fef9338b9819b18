"""`placerec tokenize`."""

from pathlib import Path

import click

from placerec.cli.options import PATH, output_option, progress_bar, source_arguments, talk_options


@click.command(epilog="Example: placerec tokenize RUNS/ -w words.npz -o tokens/")
@source_arguments
@click.option("-w", "--words", metavar="words.npz", type=PATH, required=True, help="The dictionary of train-words.")
@output_option(metavar="tokens/", text="The folder to write: one .tsv per sequence, and vocab.txt.")
@talk_options
def tokenize(sources: tuple[Path, ...], format_: str, words: Path, out: Path) -> None:
    """Write the visual word of every frame: one text file per sequence."""
    from placerec.words.tokenize import tokenize as run

    with progress_bar("tokenize") as progress:
        run(sources, words, out, format=format_, progress=progress)
