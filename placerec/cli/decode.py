"""`placerec decode`."""

import sys
from pathlib import Path

import click

from placerec.cli.options import (
    PATH,
    PATH_OR_STREAM,
    FiniteRange,
    format_option,
    json_option,
    output_option,
    progress_bar,
    talk_options,
    words_option,
)
from placerec.errors import ModelError


@click.command(epilog="Example: placerec decode tokens/run3.tsv -m model/ -o beliefs/")
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH_OR_STREAM)
@click.option("-m", "--model", metavar="MODEL/", type=PATH, required=True, help="The folder of train-lm.")
@words_option(False, "The dictionary, if TOKENS are images.")
@format_option(" of images")
@click.option(
    "--transition",
    metavar="fixed|learned|FILE",
    default="fixed",
    show_default=True,
    help="How the place changes: --stay, as the training counted it, or a table of probabilities.",
)
@click.option("--stay", type=FiniteRange(0, 1), help="Probability of staying in a place for one step.  [default: 0.99]")
@click.option(
    "--per",
    type=click.Choice(["update", "frame", "second"]),
    help="What one step is: a selected word, a frame, a second.  [default: update]",
)
@click.option(
    "--max-gap",
    metavar="SECONDS",
    type=FiniteRange(0, min_open=True),
    help="More time than this between two frames begins a new sequence.",
)
@click.option("--smooth", is_flag=True, help="Let all words of a sequence count for every frame.")
@click.option("--viterbi", is_flag=True, help="Write the most probable path as best.")
@click.option(
    "--lag", metavar="N", type=click.IntRange(0), help="Let the words up to N frames later count for each frame."
)
@click.option(
    "--scorer",
    type=click.Choice(["native", "kenlm"]),
    default="native",
    show_default=True,
    help="What computes the probabilities.",
)
@json_option("Write one JSON object per frame instead of tab-separated lines.")
@output_option(
    "beliefs/", "The folder to write: one file per sequence. Without it, one sequence goes to stdout.", False
)
@talk_options
def decode(
    tokens: tuple[Path, ...],
    model: Path,
    words: Path | None,
    format_: str,
    transition: str,
    stay: float | None,
    per: str | None,
    max_gap: float | None,
    smooth: bool,
    viterbi: bool,
    lag: int | None,
    scorer: str,
    as_json: bool,
    out: Path | None,
) -> None:
    """Find the belief over places for every frame.

    TOKENS are token streams (.tsv), folders of them, or plain texts of words; with -w, images. `-` reads one word a
    line (or word, tab, seconds) and answers each at once.
    """
    from placerec.model import Decoding, decode_lines, format_beliefs, load_recognizer
    from placerec.model import decode as run

    try:
        options = Decoding(transition, stay, per, max_gap, smooth, viterbi, lag)
    except ModelError as error:
        raise click.UsageError(str(error)) from error
    if tokens == (Path("-"),):
        if words or out:
            raise click.UsageError("`-` reads words and answers on stdout: it takes neither -w nor -o")
        if sys.stdin is None:
            raise click.UsageError("`-` reads standard input, and that is closed")
        if options.looks_ahead:
            raise click.UsageError(
                "`-` answers each line before later words are known: it takes none of --smooth, --viterbi, --lag"
            )
        recognizer = load_recognizer(model, options=options, scorer=scorer)
        for line in decode_lines(recognizer, sys.stdin, as_json=as_json):
            click.echo(line)
        return
    if Path("-") in tokens:
        raise click.UsageError("`-` cannot be mixed with files")
    with progress_bar("describe") as progress:
        beliefs = run(
            tokens,
            model,
            words=words,
            out=out,
            format=format_,
            options=options,
            scorer=scorer,
            as_json=as_json,
            progress=progress,
        )
    if out is None:
        click.echo(format_beliefs(beliefs[0], as_json=as_json), nl=False)
