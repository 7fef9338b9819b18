"""Models of places, and what they believe: from `placerec train-lm` and `update` to `decode` and `evaluate`."""

import sys
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from placerec.cli import shared
from placerec.errors import counted

if TYPE_CHECKING:
    from placerec.frames import SourceOptions
    from placerec.hohmm import Beliefs
    from placerec.model import Decoding, ModelOptions
    from placerec.model.decoding import ScorerName

# The names of placerec.methods.METHODS, written out: --help would wait for numpy.
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
INSPECT_EXAMPLES = """\b
Example: placerec inspect model/kitchen.arpa "w07 w08"
         placerec inspect beliefs/run3.explain.jsonl 153 -o decision.html
"""
_model_argument = click.argument("model", metavar="MODEL/", type=shared.PATH)


@shared.command("train-lm", epilog="Example: placerec train-lm tokens/seq*[12].tsv -o model/ --order 2")
@shared.tokens_argument
@shared.model_options
@shared.groups.model(
    "--vocab",
    "vocabulary",
    metavar="FILE",
    type=shared.PATH,
    help="All words, one a line.  [default: vocab.txt beside TOKENS]",
)
@shared.groups.model(
    "--as-in-paper", is_flag=True, help="Train on the first dictionary alone, and learn nothing of how words weigh."
)
@click.option(
    "--descriptors",
    metavar="FILE.npz",
    type=shared.PATH,
    help="The frames' descriptors: the weight of words is judged with words that are learned anew, too; needs -w.",
)
@shared.words_option(False, "The dictionaries of TOKENS, for --descriptors.")
@shared.output_option("MODEL/", "The folder to write: one ARPA file per place, and what made it.")
@shared.cluster_option
@shared.talk_options
def train_lm(
    tokens: tuple[Path, ...],
    descriptors: Path | None,
    words: Path | None,
    as_in_paper: bool,
    out: Path,
    options: "ModelOptions",
    **how: Any,
) -> None:
    """Train one n-gram model per place, as ARPA files.

    Each dictionary of TOKENS gets its models. How much the words weigh (alpha), and how fast the filter forgets
    (memory), is learned from the sequences, each group of them judged by the others, and kept in model.json.

    TOKENS are token streams (.tsv), folders of them, or one folder of sentences: PLACE.txt, one visit a line.
    """
    from placerec.model import train_lm as run

    if (descriptors is None) != (words is None) or (descriptors and as_in_paper):
        raise click.UsageError("--descriptors and -w belong together, and --as-in-paper weighs nothing")
    weigh = None
    if descriptors and words:
        from placerec.model.learn import weigher

        weigh = weigher(tokens, words, descriptors, options)
    with shared.progress_bar("train-lm") as progress:
        run(tokens, out, options=options, as_in_paper=as_in_paper, weigh=weigh, progress=progress, **how)


@shared.command(epilog="Example: placerec update model/ tokens/today.tsv")
@_model_argument
@shared.tokens_argument
@click.option("--forget", is_flag=True, help="Take these sequences away instead; they must have been learned.")
@shared.talk_options
def update(model: Path, tokens: tuple[Path, ...], forget: bool) -> None:
    """Learn more labelled visits, or forget some.

    TOKENS are token streams (.tsv) or folders of them; for a model of sentences, one folder of sentences. The old ones
    are not needed: MODEL/ will be as if train-lm had been given all sequences, the old ones first.
    """
    from placerec.model import update as run

    with shared.progress_bar("update") as progress:
        run(model, tokens, forget=forget, progress=progress)


@shared.command(epilog="Example: placerec calibrate model/ tokens/run4.tsv tokens/run5.tsv")
@_model_argument
@shared.tokens_argument
@shared.decoding_options
@shared.talk_options
def calibrate(model: Path, tokens: tuple[Path, ...], options: "Decoding") -> None:
    """Learn how far the beliefs of a model can be trusted.

    TOKENS are labelled token streams that trained neither the words nor the model. The temperature that is found is
    kept in MODEL/model.json; it holds for `decode --calibrated` with the same options as here.
    """
    from placerec.model import calibrate as run

    found = run(model, tokens, options=options)
    before, after = found.log_loss_before, found.log_loss_after
    click.echo(f"temperature  {found.temperature:.3f}   (above 1: the beliefs were too sure)")
    frames = f"{counted(found.frames, 'frame')}: those it was fitted on"
    click.echo(f"log loss     {before:.3f} -> {after:.3f}   (nats per frame, {frames})")


@shared.command(epilog=INSPECT_EXAMPLES)
@click.argument("path", metavar="MODEL.arpa|MODEL/|NAME.explain.jsonl", type=shared.PATH)
@click.argument("asked", metavar="[NGRAM...|FRAME]", nargs=-1)
@click.option("--top", type=click.IntRange(min=0), default=5, help="How many n-grams of each order to show.")
@shared.json_option()
@shared.output_option("FILE.html", "A page of the decision to write, too.", required=False)
@shared.talk_options
def inspect(path: Path, asked: tuple[str, ...], top: int, as_json: bool, out: Path | None) -> None:
    """Read a model, or one decision of `decode --explain`.

    Of a model: counts, top n-grams, sums, p(w | h). NGRAM is some words in quotes: the probability of the last one
    after the others is shown step by step, and which words are most probable after all of them. Of a folder, MODEL/ of
    train-lm or any, all ARPA files are shown, with the NGRAMs whose words they list. Of the decision at FRAME (its
    name, or the beginning of it): what each place's model said of the word, what that made of the belief, and which of
    the last words speak for the best place and against it.
    """
    if path.name.endswith(".jsonl"):
        found, text = _decision(path, asked, out)
    else:
        if out is not None:
            raise click.UsageError("-o is for the page of a decision (NAME.explain.jsonl FRAME); leave it out")
        from placerec.lm.inspect import format_inspection, inspect_model, inspect_models

        if path.is_dir():
            found = inspect_models(path, asked, top=top)
            text = "\n\n".join(map(format_inspection, found))
        else:
            found = inspect_model(path, asked, top=top)
            text = format_inspection(found)
    shared.echo_json(found) if as_json else click.echo(text)


def _decision(path: Path, asked: tuple[str, ...], out: Path | None) -> tuple[object, str]:
    from placerec.inspection.decision import format_decision, inspect_decision

    if click.get_current_context().get_parameter_source("top") is not ParameterSource.DEFAULT:
        raise click.UsageError("--top is for models; leave it out")
    if len(asked) != 1:
        raise click.UsageError(f"name one frame of {path}, as in its column `frame` of the beliefs")
    decision = inspect_decision(path, asked[0], out=out)
    return decision, format_decision(decision)


@shared.command(epilog="Example: placerec check model/")
@click.argument("models", metavar="MODEL.arpa|MODEL/...", nargs=-1, required=True, type=shared.PATH)
@shared.json_option()
@shared.talk_options
def check(models: tuple[Path, ...], as_json: bool) -> None:
    """Check that a model sums to 1 and agrees with KenLM.

    The probabilities after every context must sum to 1, and KenLM must give every token the same one. A file that SRILM
    reads and KenLM refuses is compared through a copy, and what KenLM refuses is said. Of a folder, MODEL/ of train-lm
    or any, all ARPA files are checked.
    """
    from placerec.lm.arpa import arpa_files
    from placerec.lm.check import check_model

    checks = []
    for path in [file for named in models for file in arpa_files(named)]:
        checks.append(check_model(path))
        if not as_json:
            click.echo(checks[-1].sentence())
    if as_json:
        shared.echo_json([asdict(found) | {"ok": found.ok} for found in checks])
    if not all(found.ok for found in checks):
        click.echo("placerec: a model is not as it should be; see above", err=True)
        sys.exit(1)


@shared.command(
    "adapt-lm", epilog='Example: placerec adapt-lm kitchen.arpa -o new.arpa --add w99=0.001 --boost "w07 w08"=3'
)
@click.argument("model", metavar="MODEL.arpa", type=shared.PATH)
@shared.output_option("OUT.arpa", "The model to write.")
@click.option(
    "--add", multiple=True, metavar="WORD[=P]", help="A new word; P is its probability where nothing else is known."
)
@click.option("--boost", multiple=True, metavar='"W1 W2"=FACTOR', help="An n-gram to make so many times as probable.")
@shared.talk_options
def adapt_lm(model: Path, out: Path, add: tuple[str, ...], boost: tuple[str, ...]) -> None:
    """Add words to a model, or boost n-grams.

    Without P a word is as probable as the rarest of the model. FACTOR may be below 1. Every context sums to 1 still:
    what is left of it is shared by the other words as before.
    """
    from placerec.lm.adapt import adapt_lm as run, parse_addition, parse_boost

    with shared.usage("--add"):
        words = dict(map(parse_addition, add))
    with shared.usage("--boost"):
        boosts = dict(map(parse_boost, boost))
    run(model, out, words, boosts)


@shared.command(epilog="Example: placerec decode tokens/run3.tsv -m model/ -o beliefs/")
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=shared.PATH_OR_STREAM)
@click.option("-m", "--model", metavar="MODEL/", type=shared.PATH, required=True, help="The folder of train-lm.")
@shared.words_option(False, "The dictionary, if TOKENS are images.  [default: MODEL/words.npz, if it is there]")
@shared.network_option
@shared.reading_options(" of images")
@shared.decoding_options
@shared.groups.belief("--viterbi", is_flag=True, help="Write the most probable path as best.")
@shared.groups.belief("--calibrated", is_flag=True, help="Apply what `placerec calibrate` found to the beliefs.")
@shared.groups.belief(
    "--unknown", is_flag=True, help="Add a column: the probability that the place is none of the model's."
)
@click.option("--explain", is_flag=True, help="Write NAME.explain.jsonl beside the beliefs: what decided each word.")
@click.option("--live", is_flag=True, help="Answer each frame as it comes: a camera, or a video at its own pace.")
@shared.groups.belief(
    "--method", metavar="NAME", default="hohmm", help=f"What turns words into beliefs: hohmm, {', '.join(METHODS)}."
)
@shared.groups.belief(
    "--scorer", type=click.Choice(["native", "kenlm"]), default="native", help="What computes the probabilities."
)
@shared.json_option("Write one JSON object per frame instead of tab-separated lines.")
@click.option(
    "--rerun",
    metavar="FILE.rrd",
    type=shared.FILE,
    help="Write frames, beliefs, words and labels for the viewer Rerun, too; needs rerun-sdk.",
)
@shared.output_option(
    "beliefs/", "The folder to write: one file per sequence. Without it, one sequence goes to stdout.", False
)
@shared.cache_option
@shared.live_page_options
@shared.talk_options
def decode(
    tokens: tuple[Path | str, ...],
    live: bool,
    page: dict[str, Any] | None,
    out: Path | None,
    cache: Path | None,
    rerun: Path | None,
    **how: Any,
) -> None:
    """Find the belief over places for every frame.

    TOKENS are token streams (.tsv), folders of them, or plain texts of words; with -w, any SOURCE that tokenize takes:
    folders of images, videos, bags, lists. `-` without -w reads one word a line (or word, tab, seconds, tab, distance)
    and answers each at once. With -w and --live, TOKENS is a camera (camera:0, camera:/dev/video2,
    camera:rtsp://...) or a video; frames that come too fast are dropped, and Ctrl-C ends it. --page shows them.
    """
    from placerec.methods import check_method

    with shared.usage("--method"):
        check_method(how["method"], how["options"], scorer=how["scorer"])
    words = how["words"]
    if rerun is not None:
        _check_rerun(tokens, live)
    if live:
        if not (words or (how["model"] / "words.npz").exists()) or len(tokens) > 1 or _STDIN in tokens:
            raise click.UsageError("--live takes one camera or video, and needs -w to see it")
        _check_answering("--live", out, how["options"])
        _answer_live(tokens[0], page, **how)
    elif page is not None:
        raise click.UsageError("--page shows what comes live: it needs --live")
    elif tokens == (_STDIN,) and words is None:
        _check_answering("`-`", out, how["options"])
        _answer_lines(**how)
    elif _STDIN in tokens and words is None:
        raise click.UsageError("`-` cannot be mixed with files")
    else:
        _decode_whole(tokens, out, rerun, cache=cache, **how)


def _answer_live(source: Path | str, page: dict[str, Any] | None, **how: Any) -> None:
    """An answer for each frame of a camera or a video as it comes, and perhaps a page."""
    from placerec.methods import decode_live

    if page is not None:
        from placerec.page.live import decode_live_page

        lines = decode_live_page(source, **page, **how)
    else:
        lines = decode_live(source, **how)
    with closing(lines) as answers:
        for line in answers:
            click.echo(line)


def _answer_lines(
    *, model: Path, method: str, options: "Decoding", scorer: "ScorerName", as_json: bool, **_: Any
) -> None:
    """An answer for each line of standard input, as it is read."""
    from placerec.methods import decode_lines, load_decoder

    if sys.stdin is None:
        raise click.UsageError("`-` reads standard input, and that is closed")
    decoder = load_decoder(method, model, options=options, scorer=scorer)
    for line in decode_lines(decoder, sys.stdin, as_json=as_json):
        click.echo(line)


def _decode_whole(
    tokens: tuple[Path | str, ...], out: Path | None, rerun: Path | None, *, model: Path, **how: Any
) -> None:
    """The beliefs of whole sequences: files in `out`, or the one sequence on stdout; and the recording `rerun`."""
    from placerec.hohmm import format_beliefs
    from placerec.methods import decode as run

    if how["options"].explain and out is None:
        raise click.UsageError("--explain writes files beside the beliefs: it needs -o")
    with shared.progress_bar("describe") as progress:
        beliefs = run(tokens, model, out=out, progress=progress, **how)
    if out is None:
        click.echo(format_beliefs(beliefs[0], as_json=how["as_json"]), nl=False)
    if rerun is not None:
        _write_rerun(rerun, beliefs, tokens, how["source_options"])


def _check_rerun(tokens: tuple[Path | str, ...], live: bool) -> None:
    """Refuse --rerun, before any work, for what cannot be read twice, and where rerun-sdk is not there."""
    from placerec.errors import check_optional

    if live or any(token == _STDIN or isinstance(token, str) for token in tokens):
        raise click.UsageError("--rerun is for whole recordings, whose frames it reads once more; name files")
    check_optional("rerun", "--rerun")


def _write_rerun(
    path: Path, beliefs: "list[Beliefs]", tokens: tuple[Path | str, ...], source_options: "SourceOptions"
) -> None:
    from placerec.frames import find_sequences
    from placerec.methods.decode import are_images
    from placerec.page.rerun_file import write_rerun

    sequences = find_sequences(tokens, options=source_options) if are_images(tokens) else []
    with shared.progress_bar("rerun") as progress:
        write_rerun(path, beliefs, sequences, progress)


def _check_answering(what: str, out: Path | None, options: "Decoding") -> None:
    """Refuse what makes no sense where each frame is answered at once, on stdout."""
    if out or options.explain:
        raise click.UsageError(f"{what} answers on stdout and writes no files: it takes neither -o nor --explain")
    if options.looks_ahead:
        raise click.UsageError(
            f"{what} answers each frame before later words are known: it takes none of --smooth, --viterbi, --lag"
        )


@shared.command(epilog="Example: placerec evaluate beliefs/*.tsv --plot beliefs.png")
@click.argument("beliefs", metavar="BELIEFS...", nargs=-1, required=True, type=shared.PATH_OR_STREAM)
@shared.json_option()
@click.option(
    "--plot",
    metavar="FILE.png",
    type=shared.FILE,
    help="Draw beliefs against the truth, what was confused, and how far to trust them: .png, .svg or .pdf.",
)
@click.option(
    "--html", metavar="FILE.html", type=shared.FILE, help="Write the page of `placerec report`, too, without frames."
)
@shared.talk_options
def evaluate(beliefs: tuple[Path, ...], as_json: bool, plot: Path | None, html: Path | None) -> None:
    """Judge beliefs by the true places.

    BELIEFS are files of decode (.tsv), folders of them, or `-`. Prints the accuracy beside that of the majority class,
    recall and precision per place, the confusion matrix, and how good the beliefs are as probabilities.
    """
    from placerec.evaluation.summary import format_evaluation
    from placerec.figures.evaluation import evaluate_files

    if _STDIN in beliefs and sys.stdin is None:
        raise click.UsageError("`-` reads standard input, and that is closed")
    if html is not None and _STDIN in beliefs:
        raise click.UsageError("--html reads the files once more, and standard input is gone then; name files")
    evaluation = evaluate_files(beliefs, plot=plot)
    if html is not None:
        from placerec.page.report import report

        report(beliefs, html)
    shared.echo_json(evaluation.to_json()) if as_json else click.echo(format_evaluation(evaluation))
