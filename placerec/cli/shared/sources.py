"""SOURCE, TOKENS, and how they are read."""

import functools
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.values import PATH, PATH_OR_STREAM, Command, FiniteRange, usage

tokens_argument = click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)


def source_arguments(function: Command) -> Command:
    """SOURCE..., and how it is read. The command gets `sources` and `source_options`."""
    function = reading_options()(function)
    return click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=PATH_OR_STREAM)(function)


def whole_source_arguments(function: Command) -> Command:
    """SOURCE..., of which no part can be taken, and how it is read otherwise: `sources` and `source_options`."""
    function = reading_options(part=False)(function)
    return click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=PATH)(function)


def _part_options(function: Command) -> Command:
    """--every, --from, --to."""
    every = groups.source(
        "--every", metavar="N", type=click.IntRange(min=1), default=1, help="Read the first of every N frames."
    )
    begin = groups.source(
        "--from",
        "begin",
        metavar="S",
        type=FiniteRange(min=0),
        default=0.0,
        help="Read each sequence from this second on, counted from the first frame.",
    )
    end = groups.source(
        "--to",
        "end",
        metavar="S",
        type=FiniteRange(min=0, min_open=True),
        help="Read no frame from this second on.",
    )
    return every(begin(end(function)))


def reading_options(note: str = "", *, part: bool = True) -> Callable[[Command], Command]:
    """--format, --every, --topic, --labels...: how sources are to be read. The command gets `source_options`.

    `part`: whether a part of each can be read.
    """

    def decorated(function: Command) -> Command:
        @groups.source(
            "--format",
            "format_",
            type=click.Choice(["auto", "sequences", "places"]),
            default="auto",
            help=f"What a folder of folders{note} is: sequences, or one folder per place.",
        )
        @groups.source("--topic", metavar="NAME", help="The images of a bag to read, if it has several topics of them.")
        @groups.source(
            "--labels",
            metavar="FILE",
            type=PATH,
            help="Lines 'start end place' in seconds that label a video or a bag; or a folder of NAME.labels.  "
            "[default: NAME.labels beside it]",
        )
        @groups.source(
            "--camera", metavar="NAME", help="The camera to read of a run of several.  [default: colour, or left]"
        )
        @groups.source(
            "--rate",
            metavar="HZ",
            type=FiniteRange(min=0, min_open=True),
            help="Frames a second, where images have no times.",
        )
        @groups.source(
            "--label-clock",
            type=click.Choice(["auto", "stamps", "start"]),
            default="auto",
            help="What seconds in labels are: those of the frames' time stamps, or counted from the first frame.",
        )
        @functools.wraps(function)
        def read(*args: Any, format_: str, **options: Any) -> Any:
            from placerec.frames.sequence import SourceOptions

            settings = {field.name: options.pop(field.name) for field in fields(SourceOptions) if field.name in options}
            end = settings.get("end")
            with usage("--labels" if end is None or settings["begin"] < end else "--to"):
                source_options = SourceOptions(format_, **settings)
            return function(*args, source_options=source_options, **options)

        return _part_options(read) if part else read

    return decorated
