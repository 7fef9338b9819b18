"""`placerec update`."""

from pathlib import Path

import click

from placerec.cli.options import PATH, progress_bar, talk_options


@click.command(epilog="Example: placerec update model/ tokens/today.tsv")
@click.argument("model", metavar="MODEL/", type=PATH)
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)
@click.option("--forget", is_flag=True, help="Take these sequences away instead; they must have been learned.")
@talk_options
def update(model: Path, tokens: tuple[Path, ...], forget: bool) -> None:
    """Add labelled visits to a model, or take them away, without the old data.

    TOKENS are token streams (.tsv) or folders of them; for a model of sentences, one folder of sentences. MODEL/ then
    holds what train-lm would have made of all sequences, the old ones first.
    """
    from placerec.model import update as run

    with progress_bar("update") as progress:
        run(model, tokens, forget=forget, progress=progress)
