"""`placerec calibrate`."""

from pathlib import Path

import click

from placerec.cli.options import PATH, FiniteRange, talk_options


@click.command(epilog="Example: placerec calibrate model/ tokens/run4.tsv tokens/run5.tsv")
@click.argument("model", metavar="MODEL/", type=PATH)
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)
@click.option(
    "--stay",
    type=FiniteRange(0, 1),
    default=0.99,
    show_default=True,
    help="As for the decode that it is to hold for.",
)
@talk_options
def calibrate(model: Path, tokens: tuple[Path, ...], stay: float) -> None:
    """Learn how far the beliefs of a model can be trusted.

    TOKENS are labelled token streams that trained neither the words nor the model. The temperature that is found is
    kept in MODEL/model.json.
    """
    from placerec.model import calibrate as run

    found = run(model, tokens, stay=stay)
    before, after = found.log_loss_before, found.log_loss_after
    click.echo(f"temperature  {found.temperature:.3f}   (above 1: the beliefs were too sure)")
    click.echo(
        f"log loss     {before:.3f} -> {after:.3f}   (nats per frame, {found.frames} frames: those it was fitted on)"
    )
