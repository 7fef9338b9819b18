"""`placerec check`."""

import sys
from dataclasses import asdict
from pathlib import Path

import click

from placerec.cli.options import PATH, json_option, talk_options


@click.command(epilog="Example: placerec check model/*.arpa")
@click.argument("models", metavar="MODEL.arpa...", nargs=-1, required=True, type=PATH)
@json_option()
@talk_options
def check(models: tuple[Path, ...], as_json: bool) -> None:
    """Check that a model sums to 1 and agrees with KenLM.

    The probabilities after every context must sum to 1, and KenLM must give every token the same one.
    """
    import json

    from placerec.lm.check import check_model

    checks = []
    for path in models:
        checks.append(check_model(path))
        if not as_json:
            click.echo(checks[-1].sentence())
    if as_json:
        click.echo(json.dumps([asdict(found) | {"ok": found.ok} for found in checks], indent=2))
    if not all(found.ok for found in checks):
        click.echo("placerec: a model is not as it should be; see above", err=True)
        sys.exit(1)
