"""`placerec inspect`."""

import json
from pathlib import Path

import click
from click.core import ParameterSource

from placerec.cli.options import PATH, json_option, output_option, talk_options

EXAMPLES = """\b
Example: placerec inspect model/kitchen.arpa "w07 w08"
         placerec inspect beliefs/run3.explain.jsonl 153 -o decision.html
"""


@click.command(epilog=EXAMPLES)
@click.argument("path", metavar="MODEL.arpa|NAME.explain.jsonl", type=PATH)
@click.argument("asked", metavar="[NGRAM...|FRAME]", nargs=-1)
@click.option(
    "--top", type=click.IntRange(min=0), default=5, show_default=True, help="How many n-grams of each order to show."
)
@json_option()
@output_option("FILE.html", "A page of the decision to write, too.", required=False)
@talk_options
def inspect(path: Path, asked: tuple[str, ...], top: int, as_json: bool, out: Path | None) -> None:
    """Read a model, or one decision of `decode --explain`.

    Of a model: counts, top n-grams, sums, p(w | h). NGRAM is some words in quotes: the probability of the last one
    after the others is shown step by step. Of the decision at FRAME (its name, or the beginning of it): what each
    place's model said of the word, what that made of the belief, and which of the last words speak for the best place
    and against it.
    """
    if path.name.endswith(".jsonl"):
        found, text = _decision(path, asked, out)
    else:
        if out is not None:
            raise click.UsageError("-o is for the page of a decision (NAME.explain.jsonl FRAME); leave it out")
        found, text = _model(path, asked, top)
    click.echo(json.dumps(found, indent=2, ensure_ascii=False) if as_json else text)


def _decision(path: Path, asked: tuple[str, ...], out: Path | None) -> tuple[object, str]:
    from placerec.inspection.decision import format_decision, inspect_decision

    if click.get_current_context().get_parameter_source("top") is not ParameterSource.DEFAULT:
        raise click.UsageError("--top is for models; leave it out")
    if len(asked) != 1:
        raise click.UsageError(f"name one frame of {path}, as in its column `frame` of the beliefs")
    decision = inspect_decision(path, asked[0], out=out)
    return decision, format_decision(decision)


def _model(path: Path, asked: tuple[str, ...], top: int) -> tuple[object, str]:
    from placerec.lm.inspect import format_inspection, inspect_model

    inspection = inspect_model(path, asked, top=top)
    return inspection, format_inspection(inspection)
