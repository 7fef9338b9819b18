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
    """Learn more labelled visits, or forget some.

    TOKENS are token streams (.tsv) or folders of them; for a model of sentences, one folder of sentences. The old ones
    are not needed: MODEL/ will be as if train-lm had been given all sequences, the old ones first.
    """
    from placerec.model import update as run

    with progress_bar("update") as progress:
        run(model, tokens, forget=forget, progress=progress)
