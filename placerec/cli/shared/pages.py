"""Where a page is served, and whether it is opened."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from placerec.cli.shared import groups
from placerec.cli.shared.values import PATH, Command

if TYPE_CHECKING:
    from placerec.page.server import PageServer

ShowPage = Callable[["PageServer"], None]
_ADDRESS = ("host", "port", "no_browser")


def page_options(function: Command) -> Command:
    """--no-browser, --port, --host. The command gets `host`, `port` and `show`, to be called with the server."""

    @_address_options
    @functools.wraps(function)
    def serving(*args: Any, no_browser: bool, **options: Any) -> Any:
        return function(*args, show=functools.partial(_show, browser=not no_browser, err=False), **options)

    return serving


def live_page_options(function: Command) -> Command:
    """--page, --keep and those of `page_options`. The command gets `page`: these as a dict, or None without --page.

    The address is on stderr, for the answers are on stdout.
    """

    @groups.page("--page", is_flag=True, help="Show what is seen and believed in the browser, too; with --live.")
    @groups.page(
        "--keep",
        metavar="FOLDER/",
        type=PATH,
        help="Keep frames of places that are named on the page there, with labels, and tokens for update.",
    )
    @_address_options
    @functools.wraps(function)
    def serving(*args: Any, page: bool, keep: Any, host: str, port: int, no_browser: bool, **options: Any) -> Any:
        context = click.get_current_context()
        for name in ("keep", *_ADDRESS):
            if not page and context.get_parameter_source(name) is not ParameterSource.DEFAULT:
                raise click.UsageError(f"--{name.replace('_', '-')} is of the page; it needs --page")
        show = functools.partial(_show, browser=not no_browser, err=True)
        served = {"host": host, "port": port, "keep": keep, "show": show} if page else None
        return function(*args, page=served, **options)

    return serving


def _address_options(function: Command) -> Command:
    browser = groups.page("--no-browser", is_flag=True, help="Open no browser: the address is told.")
    port = groups.page("--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="The port; 0: a free one.")
    host = groups.page(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="The network address to answer at, where others may ask, if they have the token in the address.",
    )
    return browser(port(host(function)))


def _show(server: "PageServer", *, browser: bool, err: bool) -> None:
    """Tell the address, and open it."""
    click.echo(server.address, err=err)
    if browser:
        import webbrowser

        webbrowser.open(server.address)
