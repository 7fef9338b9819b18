"""Where a page is served, and whether it is opened."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.values import Command

if TYPE_CHECKING:
    from placerec.page.server import PageServer


def page_options(function: Command) -> Command:
    """--no-browser, --port, --host. The command gets `host`, `port` and `show`, to be called with the server."""

    @groups.page("--no-browser", is_flag=True, help="Open no browser: the address is on stdout.")
    @groups.page("--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="The port; 0 is a free one.")
    @groups.page(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="The network address to answer at, where others may ask, if they have the token in the address.",
    )
    @functools.wraps(function)
    def serving(*args: Any, no_browser: bool, **options: Any) -> Any:
        return function(*args, show=functools.partial(_show, browser=not no_browser), **options)

    return serving


ShowPage = Callable[["PageServer"], None]


def _show(server: "PageServer", *, browser: bool) -> None:
    """Tell the address on stdout, and open it."""
    click.echo(server.address)
    if browser:
        import webbrowser

        webbrowser.open(server.address)
