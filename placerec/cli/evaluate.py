"""`placerec evaluate`."""

import json
from pathlib import Path

import click

from placerec.cli.options import PATH, json_option, talk_options


@click.command(epilog="Example: placerec evaluate beliefs/*.tsv --plot beliefs.png")
@click.argument("beliefs", metavar="BELIEFS...", nargs=-1, required=True, type=PATH)
@json_option
@click.option(
    "--plot",
    metavar="FILE.png",
    type=PATH,
    default=None,
    help="Draw beliefs against the truth, and the confusion matrix.",
)
@talk_options
def evaluate(beliefs: tuple[Path, ...], as_json: bool, plot: Path | None) -> None:
    """Judge beliefs by the true places: accuracy beside the majority class, and what goes with it."""
    from placerec.evaluation import evaluate_files, format_evaluation

    evaluation = evaluate_files(beliefs, plot=plot)
    click.echo(json.dumps(evaluation.to_json(), indent=2) if as_json else format_evaluation(evaluation))
