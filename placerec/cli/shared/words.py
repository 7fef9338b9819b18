"""What dictionaries are learned with."""

import functools
from typing import Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.common import seed_option
from placerec.cli.shared.descriptors import take_network
from placerec.cli.shared.values import Command, FiniteRange, listed, usage


def _views(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, ...]:
    if not value:
        return ()
    from placerec.vision.options import View

    views = tuple(take_network(ctx, param, view) for view in listed(click.STRING)(ctx, param, value))
    for view in views:
        with usage("--views"):
            View.parse(view)
    return views


def dictionary_options(function: Command) -> Command:
    """--views, --size and what else dictionaries are learned with. The command gets `words`, the options."""

    @groups.word(
        "--views",
        metavar="VIEW,...",
        callback=_views,
        help="What maps see: KIND, the principal components of such descriptors; KIND:pn, these by how little the "
        "frames of one place differ; KIND:half, half whitened; KIND+KIND, several together; plain, pn, half: all.  "
        "[default: gist,gist:pn,lbp:pn,ranks:pn]",
    )
    @groups.word(
        "--size",
        "--sizes",
        "sizes",
        metavar="N,...",
        callback=listed(click.IntRange(2, 200)),
        default="10,20",
        help="Sides of the maps: a dictionary of size x size words for each, in every view.",
    )
    @groups.word("--components", type=click.IntRange(min=1), default=80, help="Principal components that a map sees.")
    @seed_option("Another seed, another map.", groups.word)
    @groups.word(
        "--fraction",
        type=FiniteRange(0, 1, min_open=True),
        default=1.0,
        help="Share of the frames to train on, drawn by the seed.",
    )
    @groups.word(
        "--epochs",
        type=click.IntRange(min=1),
        help="Passes over the frames.  [default: 50, or fewer if the words settle]",
    )
    @groups.word(
        "--units",
        type=click.Choice(["live", "all"]),
        default="live",
        help="Whether units that no training frame hit can be words.",
    )
    @groups.word(
        "--rule",
        type=click.Choice(["batch", "online"]),
        default="batch",
        help="All frames at once, or Kohonen's one after the other (slow, for comparison).",
    )
    @groups.word(
        "--width",
        type=FiniteRange(min=0, min_open=True),
        default=0.5,
        help="Final width of the neighbourhood, in units; it starts at size/2.",
    )
    @functools.wraps(function)
    def learning(*args: Any, **options: Any) -> Any:
        from dataclasses import fields

        from placerec.vision import DictionarySetOptions

        words = DictionarySetOptions(**{field.name: options.pop(field.name) for field in fields(DictionarySetOptions)})
        return function(*args, words=words, **options)

    return learning
