"""Options that --help shows together, under a title of their own."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import click

_FIRST, _LAST = "Options", "General"


class GroupedOption(click.Option):
    """An option of a group; `group`: the title of the group."""

    def __init__(self, *args: Any, group: str, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self.group = group


def grouped(params: Iterable[click.Parameter]) -> dict[str, list[click.Option]]:
    """The options by the titles of their groups, in the order of --help."""
    groups: dict[str, list[click.Option]] = {_FIRST: [], _LAST: []}
    for param in params:
        if isinstance(param, click.Option):
            other = _LAST if "--help" in param.opts else _FIRST
            groups.setdefault(param.group if isinstance(param, GroupedOption) else other, []).append(param)
    groups[_LAST] = groups.pop(_LAST)
    return {title: options for title, options in groups.items() if options}


class GroupedCommand(click.Command):
    """A command whose --help shows options group by group: first those of no group, at last what all commands have."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options."""
        for title, options in grouped(self.get_params(ctx)).items():
            with formatter.section(title):
                formatter.write_dl([shown for option in options if (shown := option.get_help_record(ctx))])


OptionMaker = Callable[..., Callable[[Callable[..., Any]], Callable[..., Any]]]


def options_of(group: str) -> OptionMaker:
    """What stands for `click.option` for the options of a group."""
    return partial(click.option, cls=GroupedOption, group=group)


command: Callable[..., Callable[[Callable[..., Any]], click.Command]] = partial(click.command, cls=GroupedCommand)
general = options_of(_LAST)
source = options_of("How sources are read")
descriptor = options_of("What describes an image")
word = options_of("How words are learned")
model = options_of("Language models")
belief = options_of("How words become beliefs")
work = options_of("Who does the work")
kept = options_of("What is kept")
page = options_of("The page")
