"""`placerec inspect`."""

import json
from pathlib import Path

import click

from placerec.cli.options import PATH, json_option, talk_options


@click.command(epilog='Example: placerec inspect model/kitchen.arpa "w07 w08"')
@click.argument("model", metavar="MODEL.arpa", type=PATH)
@click.argument("ngrams", metavar="[NGRAM...]", nargs=-1)
@click.option(
    "--top", type=click.IntRange(min=0), default=5, show_default=True, help="How many n-grams of each order to show."
)
@json_option()
@talk_options
def inspect(model: Path, ngrams: tuple[str, ...], top: int, as_json: bool) -> None:
    """Read a model: counts, top n-grams, sums, p(w | h).

    NGRAM is some words in quotes: the probability of the last one after the others is shown step by step.
    """
    from placerec.lm.inspection import format_inspection, inspect_model

    inspection = inspect_model(model, ngrams, top=top)
    click.echo(json.dumps(inspection, indent=2, ensure_ascii=False) if as_json else format_inspection(inspection))
