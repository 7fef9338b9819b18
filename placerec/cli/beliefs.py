"""Beliefs over places: `placerec decode` and `evaluate`."""

import json
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from placerec.cli.options import (
    FILE,
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
_STDIN = Path("-")


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
def decode(tokens: tuple[Path | str, ...], live: bool, out: Path | None, **how: Any) -> None:
    """Find the belief over places for every frame.

    TOKENS are token streams (.tsv), folders of them, or plain texts of words; with -w, any SOURCE that tokenize takes:
    folders of images, videos, bags, lists. `-` without -w reads one word a line (or word, tab, seconds, tab, distance)
    and answers each at once. With -w and --live, TOKENS is a camera (camera:0, camera:/dev/video2,
    camera:rtsp://...) or a video; frames that come too fast are dropped, and Ctrl-C ends it.
    """
    from placerec.methods import check_method

    with usage("--method"):
        check_method(how["method"], how["options"], scorer=how["scorer"])
    words = how["words"]
    if live:
        if words is None or len(tokens) > 1 or _STDIN in tokens:
            raise click.UsageError("--live takes one camera or video, and needs -w to see it")
        _check_answering("--live", out, how["options"])
        _answer_frames(tokens[0], **how)
    elif tokens == (_STDIN,) and words is None:
        _check_answering("`-`", out, how["options"])
        _answer_lines(**how)
    elif _STDIN in tokens and words is None:
        raise click.UsageError("`-` cannot be mixed with files")
    else:
        _decode_whole(tokens, out, **how)


def _answer_frames(source: Path | str, model: Path, **how: Any) -> None:
    """An answer for each frame of a camera or a video, as it comes."""
    from placerec.methods import decode_live

    with closing(decode_live(source, model, **how)) as answers:
        for line in answers:
            click.echo(line)


def _answer_lines(*, model: Path, method: str, options: "Decoding", scorer: str, as_json: bool, **_: Any) -> None:
    """An answer for each line of standard input, as it is read."""
    from placerec.methods import decode_lines, load_decoder

    if sys.stdin is None:
        raise click.UsageError("`-` reads standard input, and that is closed")
    decoder = load_decoder(method, model, options=options, scorer=scorer)
    for line in decode_lines(decoder, sys.stdin, as_json=as_json):
        click.echo(line)


def _decode_whole(tokens: tuple[Path | str, ...], out: Path | None, *, model: Path, **how: Any) -> None:
    """The beliefs of whole sequences: files in `out`, or the one sequence on stdout."""
    from placerec.hohmm import format_beliefs
    from placerec.methods import decode as run

    if how["options"].explain and out is None:
        raise click.UsageError("--explain writes files beside the beliefs: it needs -o")
    with progress_bar("describe") as progress:
        beliefs = run(tokens, model, out=out, progress=progress, **how)
    if out is None:
        click.echo(format_beliefs(beliefs[0], as_json=how["as_json"]), nl=False)


def _check_answering(what: str, out: Path | None, options: "Decoding") -> None:
    """Refuse what makes no sense where each frame is answered at once, on stdout."""
    if out or options.explain:
        raise click.UsageError(f"{what} answers on stdout and writes no files: it takes neither -o nor --explain")
    if options.looks_ahead:
        raise click.UsageError(
            f"{what} answers each frame before later words are known: it takes none of --smooth, --viterbi, --lag"
        )


@click.command(epilog="Example: placerec evaluate beliefs/*.tsv --plot beliefs.png")
@click.argument("beliefs", metavar="BELIEFS...", nargs=-1, required=True, type=PATH_OR_STREAM)
@json_option()
@click.option(
    "--plot",
    metavar="FILE.png",
    type=FILE,
    help="Draw beliefs against the truth, what was confused, and how far to trust them: .png, .svg or .pdf.",
)
@talk_options
def evaluate(beliefs: tuple[Path, ...], as_json: bool, plot: Path | None) -> None:
    """Judge beliefs by the true places.

    BELIEFS are files of decode (.tsv), folders of them, or `-`. Prints the accuracy beside that of the majority class,
    recall and precision per place, the confusion matrix, and how good the beliefs are as probabilities.
    """
    from placerec.evaluation.summary import format_evaluation
    from placerec.figures.evaluation import evaluate_files

    if _STDIN in beliefs and sys.stdin is None:
        raise click.UsageError("`-` reads standard input, and that is closed")
    evaluation = evaluate_files(beliefs, plot=plot)
    click.echo(json.dumps(evaluation.to_json(), indent=2) if as_json else format_evaluation(evaluation))
