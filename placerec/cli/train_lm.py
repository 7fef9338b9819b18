"""`placerec train-lm`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from placerec.cli.options import PATH, FiniteRange, cluster_option, output_option, progress_bar, talk_options, usage

if TYPE_CHECKING:
    from placerec.jobs import Executor

# The names of placerec.lm.SMOOTHINGS, written out: importing it would make --help wait for numpy.
SMOOTHING_NAMES = tuple(
    name + suffix
    for name in ("witten-bell", "lidstone", "absolute", "kneser-ney", "modified-kneser-ney")
    for suffix in ("", "-backoff")
)


@click.command("train-lm", epilog="Example: placerec train-lm tokens/seq*[12].tsv -o model/ --order 2")
@click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)
@click.option(
    "--order", type=click.IntRange(1, 9), default=2, show_default=True, help="n-gram order; 1 is the classical HMM."
)
@click.option(
    "--smoothing",
    type=click.Choice(SMOOTHING_NAMES),
    default="witten-bell",
    show_default=True,
    help="How unseen n-grams get their probability.",
)
@click.option(
    "--delta",
    type=FiniteRange(0, min_open=True),
    default=None,
    help="What lidstone adds to every count  [default: 1], or absolute takes off it  [default: 0.5].",
)
@click.option(
    "--select",
    default="none",
    show_default=True,
    metavar="RULE",
    help="Which words count: none (all), unique (one a run), subsample:S (one in S), compress:M (runs by M).",
)
@click.option(
    "--min-count",
    default="1",
    show_default=True,
    metavar="N[,N...]|srilm",
    help="Per order, how often an n-gram must occur to be listed; srilm is 1,1,2.",
)
@click.option(
    "--markers/--no-markers", default=False, show_default=True, help="Whether to count <s> and </s> around visits."
)
@click.option(
    "--vocab",
    metavar="FILE",
    type=PATH,
    default=None,
    help="All words, one a line.  [default: vocab.txt beside TOKENS]",
)
@output_option("MODEL/", "The folder to write: one ARPA file per place, and what made it.")
@cluster_option
@talk_options
def train_lm(
    tokens: tuple[Path, ...],
    order: int,
    smoothing: str,
    delta: float | None,
    select: str,
    min_count: str,
    markers: bool,
    vocab: Path | None,
    out: Path,
    work: "Executor | None",
) -> None:
    """Train one n-gram model per place, as ARPA files.

    TOKENS are token streams (.tsv), folders of them, or one folder of sentences: PLACE.txt, one visit a line.
    """
    from placerec.model import ModelOptions, parse_min_count
    from placerec.model import train_lm as run
    from placerec.words import parse_selection

    with usage("--min-count"):
        minima = parse_min_count(min_count)
    with usage("--select"):
        selection = parse_selection(select)
    options = ModelOptions(order, smoothing, delta, minima, markers, selection)
    with progress_bar("train-lm") as progress:
        run(tokens, out, options=options, vocabulary=vocab, work=work, progress=progress)
