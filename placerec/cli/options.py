"""Options that several commands share: one spelling, one meaning."""

import functools
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

Command = Callable[..., Any]
PATH = click.Path(path_type=Path)
log = logging.getLogger("placerec")


class _Talk(logging.Formatter):
    """Notes as they are, warnings with their name in front."""

    def format(self, record: logging.LogRecord) -> str:
        text = record.getMessage()
        return f"{record.levelname.lower()}: {text}" if record.levelno >= logging.WARNING else text


def talk_options(function: Command) -> Command:
    """-q and -v: how much is said on stderr."""

    @click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
    @click.option("-v", "--verbose", is_flag=True, help="Say more.")
    @functools.wraps(function)
    def talking(*args: Any, quiet: bool, verbose: bool, **options: Any) -> Any:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(_Talk())
        log.handlers = [handler]
        log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.INFO)
        return function(*args, **options)

    return talking


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A callback(done, total) that draws a bar on stderr while it is a terminal and nobody asked for quiet."""
    bars: list[Any] = []

    def show(done: int, total: int) -> None:
        if not bars:
            bars.append(click.progressbar(length=total, label=label, file=sys.stderr, show_pos=True, show_eta=True))
            bars[0].__enter__()
        bars[0].update(done - bars[0].pos)

    if not sys.stderr.isatty() or not log.isEnabledFor(logging.INFO):
        yield lambda done, total: None
        return
    try:
        yield show
    finally:
        for bar in bars:
            bar.__exit__(None, None, None)


def source_arguments(function: Command) -> Command:
    """SOURCE... and --format: where images come from."""
    function = click.option(
        "--format",
        "format_",
        type=click.Choice(["auto", "sequences", "places"]),
        default="auto",
        show_default=True,
        help="What a folder of folders is: sequences, or one folder per place.",
    )(function)
    return click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=PATH)(function)


def descriptor_options(function: Command) -> Command:
    """--variant, --image-size, --fit: what a descriptor is."""
    function = click.option(
        "--fit",
        type=click.Choice(["squash", "crop"]),
        default="squash",
        show_default=True,
        help="How a picture becomes a square.",
    )(function)
    function = click.option(
        "--image-size", type=click.IntRange(min=8), default=128, show_default=True, help="Side of that square, pixels."
    )(function)
    return click.option(
        "--variant",
        type=click.Choice(["lmgist", "classic"]),
        default="lmgist",
        show_default=True,
        help="Which GIST: LMgist (2011), or that of 2006 and lear_gist.",
    )(function)


def output_option(
    required: bool = True, metavar: str = "PATH", text: str = "Where to write."
) -> Callable[[Command], Command]:
    """-o: the output, replaced whole if it exists."""
    return click.option("-o", "--out", "out", metavar=metavar, type=PATH, required=required, help=text)


def json_option(function: Command) -> Command:
    """--json: output for programs."""
    return click.option("--json", "as_json", is_flag=True, help="Print JSON.")(function)
