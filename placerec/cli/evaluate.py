"""`placerec evaluate`."""

import json
import sys
from pathlib import Path

import click

from placerec.cli.options import FILE, PATH_OR_STREAM, json_option, talk_options


@click.command(epilog="Example: placerec evaluate beliefs/*.tsv --plot beliefs.png")
@click.argument("beliefs", metavar="BELIEFS...", nargs=-1, required=True, type=PATH_OR_STREAM)
@json_option()
@click.option(
    "--plot",
    metavar="FILE.png",
    type=FILE,
    default=None,
    help="Draw beliefs against the truth, what was confused, and how far to trust them: .png, .svg or .pdf.",
)
@talk_options
def evaluate(beliefs: tuple[Path, ...], as_json: bool, plot: Path | None) -> None:
    """Judge beliefs by the true places.

    BELIEFS are files of decode (.tsv), folders of them, or `-`. Prints the accuracy beside that of the majority class,
    recall and precision per place, the confusion matrix, and how good the beliefs are as probabilities.
    """
    from placerec.evaluation import format_evaluation
    from placerec.figures import evaluate_files

    if Path("-") in beliefs and sys.stdin is None:
        raise click.UsageError("`-` reads standard input, and that is closed")
    evaluation = evaluate_files(beliefs, plot=plot)
    click.echo(json.dumps(evaluation.to_json(), indent=2) if as_json else format_evaluation(evaluation))
