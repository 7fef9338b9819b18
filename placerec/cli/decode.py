"""`placerec decode`."""

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import (
    PATH,
    PATH_OR_STREAM,
    decoding_options,
    json_option,
    output_option,
    progress_bar,
    reading_options,
    talk_options,
    usage,
    words_option,
)

if TYPE_CHECKING:
    from placerec.frames import SourceOptions
    from placerec.model import Decoding

# What stands in placerec.methods.METHODS, where reading it would load numpy.
METHODS = (
    "majority",
    "naive-bayes",
    "wu2009",
    "dubois2011",
    "guillaume2011",
    "pronobis2010",
    "ranganathan2010",
    "filliat2008",
    "mtd",
    "second-order",
)


@click.command(epilog="Example: placerec decode tokens/run3.tsv -m model/ -o beliefs/")
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH_OR_STREAM)
@click.option("-m", "--model", metavar="MODEL/", type=PATH, required=True, help="The folder of train-lm.")
@words_option(False, "The dictionary, if TOKENS are images.")
@reading_options(" of images")
@decoding_options("viterbi", "calibrated", "unknown", "explain")
@click.option("--viterbi", is_flag=True, help="Write the most probable path as best.")
@click.option("--calibrated", is_flag=True, help="Apply what `placerec calibrate` found to the beliefs.")
@click.option("--unknown", is_flag=True, help="Add a column: the probability that the place is none of the model's.")
@click.option("--explain", is_flag=True, help="Write NAME.explain.jsonl beside the beliefs: what decided each word.")
@click.option("--live", is_flag=True, help="Answer each frame as it comes: a camera, or a video at its own pace.")
@click.option(
    "--method",
    metavar="NAME",
    default="hohmm",
    show_default=True,
    help=f"What turns words into beliefs: hohmm, {', '.join(METHODS)}.",
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
    tokens: tuple[Path | str, ...],
    model: Path,
    words: Path | None,
    source_options: "SourceOptions",
    live: bool,
    method: str,
    scorer: str,
    as_json: bool,
    out: Path | None,
    options: "Decoding",
) -> None:
    """Find the belief over places for every frame.

    TOKENS are token streams (.tsv), folders of them, or plain texts of words; with -w, any SOURCE that tokenize takes:
    folders of images, videos, bags, lists. `-` without -w reads one word a line (or word, tab, seconds, tab, distance)
    and answers each at once. With -w and --live, TOKENS is a camera (camera:0, camera:/dev/video2,
    camera:rtsp://...) or a video; frames that come too fast are dropped, and Ctrl-C ends it.
    """
    from placerec.hohmm import format_beliefs
    from placerec.methods import check_method, decode_lines, decode_live, load_decoder
    from placerec.methods import decode as run

    with usage("--method"):
        check_method(method, options, scorer=scorer)
    if live:
        if words is None or len(tokens) > 1 or Path("-") in tokens:
            raise click.UsageError("--live takes one camera or video, and needs -w to see it")
        _check_answering("--live", out, options)
        answers = decode_live(
            tokens[0],
            model,
            words=words,
            method=method,
            source_options=source_options,
            options=options,
            scorer=scorer,
            as_json=as_json,
        )
        with closing(answers):
            for line in answers:
                click.echo(line)
        return
    if tokens == (Path("-"),) and words is None:
        _check_answering("`-`", out, options)
        if sys.stdin is None:
            raise click.UsageError("`-` reads standard input, and that is closed")
        recognizer = load_decoder(method, model, options=options, scorer=scorer)
        for line in decode_lines(recognizer, sys.stdin, as_json=as_json):
            click.echo(line)
        return
    if Path("-") in tokens and words is None:
        raise click.UsageError("`-` cannot be mixed with files")
    if options.explain and out is None:
        raise click.UsageError("--explain writes files beside the beliefs: it needs -o")
    with progress_bar("describe") as progress:
        beliefs = run(
            tokens,
            model,
            method=method,
            words=words,
            out=out,
            source_options=source_options,
            options=options,
            scorer=scorer,
            as_json=as_json,
            progress=progress,
        )
    if out is None:
        click.echo(format_beliefs(beliefs[0], as_json=as_json), nl=False)


def _check_answering(what: str, out: Path | None, options: "Decoding") -> None:
    """Refuse what makes no sense where each frame is answered at once, on stdout."""
    if out or options.explain:
        raise click.UsageError(f"{what} answers on stdout and writes no files: it takes neither -o nor --explain")
    if options.looks_ahead:
        raise click.UsageError(
            f"{what} answers each frame before later words are known: it takes none of --smooth, --viterbi, --lag"
        )
