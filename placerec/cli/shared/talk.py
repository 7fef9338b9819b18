"""What commands say, and how much of it: -q, -v, a bar on stderr, --json."""

import functools
import itertools
import json
import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.values import Command

log = logging.getLogger("placerec")


class _Talk(logging.Formatter):
    """Notes as they are, warnings with their name in front."""

    def format(self, record: logging.LogRecord) -> str:
        text = record.getMessage()
        return f"{record.levelname.lower()}: {text}" if record.levelno >= logging.WARNING else text


def talk_options(function: Command) -> Command:
    """-q and -v: how much is said on stderr."""

    @groups.general("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
    @groups.general("-v", "--verbose", is_flag=True, help="Say more.")
    @functools.wraps(function)
    def talking(*args: Any, quiet: bool, verbose: bool, **options: Any) -> Any:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(_Talk())
        log.addHandler(handler)
        log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.INFO)
        try:
            return function(*args, **options)
        finally:
            # Who calls the command line from Python keeps the logging that they had.
            log.removeHandler(handler)
            log.setLevel(logging.NOTSET)

    return talking


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """A callback(done, total) that draws a bar on stderr while it is a terminal and nobody asked for quiet."""
    bars: list[Any] = []
    began = time.monotonic()

    def show(done: int, total: int) -> None:
        if not bars:
            bars.append(
                click.progressbar(
                    # A camera has no end.
                    itertools.count(),
                    length=total or None,
                    label=label,
                    file=sys.stderr,
                    show_pos=True,
                    show_eta=True,
                    item_show_func=lambda rate: None if rate is None else f"{rate:.3g}/s",
                )
            )
            bars[0].__enter__()
        bars[0].update(done - bars[0].pos, done / max(time.monotonic() - began, 1e-3))

    if sys.stderr is None or not sys.stderr.isatty() or not log.isEnabledFor(logging.INFO):
        yield lambda done, total: None
        return
    try:
        yield show
    finally:
        for bar in bars:
            bar.__exit__(None, None, None)


def json_option(text: str = "Print JSON.") -> Callable[[Command], Command]:
    """--json: output for programs."""
    return click.option("--json", "as_json", is_flag=True, help=text)


def echo_json(found: object) -> None:
    """Print JSON for people and programs."""
    click.echo(json.dumps(found, indent=2, ensure_ascii=False))
