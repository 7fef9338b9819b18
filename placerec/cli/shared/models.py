"""What language models are made with."""

import functools
from typing import Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.values import Command, FiniteRange, usage

# The names of placerec.lm.SMOOTHINGS, written out: --help would wait for numpy.
SMOOTHING_NAMES = (
    *(
        name + suffix
        for name in ("witten-bell", "lidstone", "absolute", "kneser-ney", "modified-kneser-ney")
        for suffix in ("", "-backoff")
    ),
    "jelinek-mercer",
)


def model_options(function: Command) -> Command:
    """--order, --smoothing and what else language models are made with. The command gets `options`."""

    @groups.model("--order", type=click.IntRange(1, 9), default=2, help="n-gram order; 1 is the classical HMM.")
    @groups.model(
        "--smoothing",
        type=click.Choice(SMOOTHING_NAMES),
        default="witten-bell",
        help="How unseen n-grams get their probability.",
    )
    @groups.model(
        "--delta",
        type=FiniteRange(0, min_open=True),
        help="What lidstone adds to every count  [default: 1], or absolute takes off it  [default: 0.5].",
    )
    @groups.model(
        "--select",
        default="none",
        metavar="RULE",
        help="Which words count: none (all), unique (one a run), subsample:S (one in S), compress:M (runs by M).",
    )
    @groups.model(
        "--min-count",
        default="1",
        metavar="N[,N...]|srilm",
        help="Per order, how often an n-gram must occur to be listed; srilm is 1,1,2.",
    )
    @groups.model("--markers/--no-markers", default=False, help="Whether to count <s> and </s> around visits.")
    @functools.wraps(function)
    def modelling(
        *args: Any,
        order: int,
        smoothing: str,
        delta: float | None,
        select: str,
        min_count: str,
        markers: bool,
        **options: Any,
    ) -> Any:
        from placerec.model import ModelOptions, parse_min_count
        from placerec.words import parse_selection

        with usage("--min-count"):
            minima = parse_min_count(min_count)
        with usage("--select"):
            selection = parse_selection(select)
        chosen = ModelOptions(order, smoothing, delta, minima, markers, selection)
        return function(*args, options=chosen, **options)

    return modelling
