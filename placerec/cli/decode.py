"""`placerec decode`."""

import sys
from pathlib import Path

import click

from placerec.cli.options import PATH, json_option, output_option, talk_options


@click.command(epilog="Example: placerec decode tokens/run3.tsv -m model/ -o beliefs/")
@click.argument(
    "tokens", metavar="TOKENS...", nargs=-1, required=True, type=click.Path(path_type=Path, allow_dash=True)
)
@click.option("-m", "--model", metavar="MODEL/", type=PATH, required=True, help="The folder of train-lm.")
@click.option(
    "-w", "--words", metavar="words.npz", type=PATH, default=None, help="The dictionary, if TOKENS are images."
)
@click.option(
    "--stay",
    type=click.FloatRange(0, 1),
    default=0.99,
    show_default=True,
    help="Probability of staying in a place at each selected word.",
)
@click.option(
    "--scorer",
    type=click.Choice(["native", "kenlm"]),
    default="native",
    show_default=True,
    help="What computes the probabilities.",
)
@json_option
@output_option(required=False, metavar="beliefs/", text="The folder to write; one sequence may go to stdout.")
@talk_options
def decode(
    tokens: tuple[Path, ...],
    model: Path,
    words: Path | None,
    stay: float,
    scorer: str,
    as_json: bool,
    out: Path | None,
) -> None:
    """Find the belief over places for every frame.

    TOKENS are token streams (.tsv), folders of them, or plain texts of words; with -w, images. `-` reads one word a
    line (or word, tab, seconds) and answers each at once.
    """
    from placerec.model import decode as run
    from placerec.model import decode_lines, format_beliefs, load_recognizer

    if [str(path) for path in tokens] == ["-"]:
        if words or out:
            raise click.UsageError("`-` reads words and answers on stdout: it takes neither -w nor -o")
        recognizer = load_recognizer(model, stay=stay, scorer=scorer)
        for line in decode_lines(recognizer, sys.stdin, as_json=as_json):
            click.echo(line)
        return
    if Path("-") in tokens:
        raise click.UsageError("`-` cannot be mixed with files")
    beliefs = run(tokens, model, words=words, out=out, stay=stay, scorer=scorer, as_json=as_json)
    if out is None:
        click.echo(format_beliefs(beliefs[0], as_json=as_json), nl=False)
