"""`placerec calibrate`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import PATH, decoding_options, talk_options

if TYPE_CHECKING:
    from placerec.model import Decoding


@click.command(epilog="Example: placerec calibrate model/ tokens/run4.tsv tokens/run5.tsv")
@click.argument("model", metavar="MODEL/", type=PATH)
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)
@decoding_options()
@talk_options
def calibrate(model: Path, tokens: tuple[Path, ...], options: "Decoding") -> None:
    """Learn how far the beliefs of a model can be trusted.

    TOKENS are labelled token streams that trained neither the words nor the model. The temperature that is found is
    kept in MODEL/model.json; it holds for `decode --calibrated` with the same options as here.
    """
    from placerec.model import calibrate as run

    found = run(model, tokens, options=options)
    before, after = found.log_loss_before, found.log_loss_after
    click.echo(f"temperature  {found.temperature:.3f}   (above 1: the beliefs were too sure)")
    click.echo(
        f"log loss     {before:.3f} -> {after:.3f}   (nats per frame, {found.frames} frames: those it was fitted on)"
    )
