"""Single options that several commands have."""

from collections.abc import Callable

import click

from placerec.cli.shared.groups import OptionMaker
from placerec.cli.shared.values import FILE, PATH, Command


def as_in_paper(option: OptionMaker, text: str, **values: str) -> Callable[[Command], Command]:
    """--as-in-paper: other defaults for some options, by the names of their parameters; what is given wins."""

    def preset(ctx: click.Context, param: click.Parameter, chosen: bool) -> None:
        if chosen:
            ctx.default_map = {**(ctx.default_map or {}), **values}

    return option("--as-in-paper", is_flag=True, is_eager=True, expose_value=False, callback=preset, help=text)


def seed_option(text: str, option: OptionMaker = click.option) -> Callable[[Command], Command]:
    """--seed: 0 or above, 0 by default."""
    return option("--seed", type=click.IntRange(min=0), default=0, help=text)


def words_option(required: bool, text: str) -> Callable[[Command], Command]:
    """-w: the visual dictionary."""
    return click.option("-w", "--words", metavar="words.npz", type=PATH, required=required, help=text)


def dictionary_option(function: Command) -> Command:
    """--dictionary: one of the file's. The command gets `name`."""
    text = "Which dictionary, if train-words learned several: gistpn20, for instance.  [default: the first]"
    return click.option(
        "--dictionary", "name", metavar="NAME", callback=lambda ctx, param, value: value or "", help=text
    )(function)


def output_option(metavar: str, text: str, required: bool = True) -> Callable[[Command], Command]:
    """-o: the output, replaced whole if it exists; a folder if `metavar` ends in a slash, else a file."""
    path = PATH if metavar.endswith("/") else FILE
    return click.option("-o", "--out", metavar=metavar, type=path, required=required, help=text)
