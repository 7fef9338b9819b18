"""What beliefs depend on."""

import functools
from typing import Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.common import as_in_paper
from placerec.cli.shared.values import Command, FiniteRange
from placerec.errors import PlacerecError


def _transition_options(function: Command) -> Command:
    """--transition, --stay, --per."""
    transition = groups.belief(
        "--transition",
        metavar="fixed|learned|FILE",
        help="How the place changes: --stay, as the training counted it, or a table of probabilities.  "
        "[default: learned, if the training learned how words weigh]",
    )
    stay = groups.belief(
        "--stay", type=FiniteRange(0, 1), help="Probability of staying in a place for one step.  [default: 0.99]"
    )
    per = groups.belief(
        "--per",
        type=click.Choice(["update", "frame", "second"]),
        help="What one step is: a selected word, a frame, a second.  [default: update]",
    )
    return transition(stay(per(function)))


def _weight_options(function: Command) -> Command:
    """--alpha, --memory, --as-in-paper."""
    alpha = groups.belief(
        "--alpha",
        metavar="X",
        type=FiniteRange(0, min_open=True),
        help="The exponent of words' probabilities: how much they weigh.  [default: as learned, else 1]",
    )
    memory = groups.belief(
        "--memory",
        metavar="X",
        type=FiniteRange(0, 1),
        help="The share of the belief that each step forgets.  [default: as learned, else 0]",
    )
    paper = as_in_paper(
        groups.belief,
        "What is not given is as in the paper: --transition fixed --alpha 1 --memory 0.",
        transition="fixed",
        alpha="1",
        memory="0",
    )
    return alpha(memory(paper(function)))


def decoding_options(function: Command) -> Command:
    """What beliefs depend on: --transition, --stay, --per, --alpha, --memory, ... The command gets `options`.

    Other options of the command that are fields of `Decoding` become part of it, too.
    """

    @_transition_options
    @_weight_options
    @groups.belief(
        "--max-gap",
        metavar="SECONDS",
        type=FiniteRange(0, min_open=True),
        help="More time than this between two frames begins a new sequence.",
    )
    @groups.belief("--smooth", is_flag=True, help="Let all words of a sequence count for every frame.")
    @groups.belief(
        "--lag", metavar="N", type=click.IntRange(0), help="Let the words up to N frames later count for each frame."
    )
    @functools.wraps(function)
    def decoding(*args: Any, **options: Any) -> Any:
        from dataclasses import fields

        from placerec.model import Decoding

        try:
            chosen = Decoding(**{one.name: options.pop(one.name) for one in fields(Decoding) if one.name in options})
        except PlacerecError as error:
            raise click.UsageError(str(error)) from error
        return function(*args, options=chosen, **options)

    return decoding
