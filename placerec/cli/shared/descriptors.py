"""What a descriptor is, or the file of descriptors that were computed elsewhere."""

import functools
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from placerec.cli.shared import groups
from placerec.cli.shared.values import FILE, Command

if TYPE_CHECKING:
    from placerec.vision.network import Network

# Of `vision.KINDS`, which takes numpy to import.
KINDS = ("gist", "lbp", "ranks", "centrist", "colour")
_NETWORK = re.compile(rf"(^|\+)onnx:(?P<named>.+?)(?=\+({'|'.join(KINDS)})([+:]|$)|:(plain|pn|half)$|$)")
_KEPT = "placerec.network"


def take_network(ctx: click.Context, param: click.Parameter, text: str) -> str:
    """`gist+onnx` of `gist+onnx:FILE`: FILE, perhaps with #LAYER, is kept for `descriptor_options`.

    Raises BadParameter for another file than the one that was named before.
    """
    found = _NETWORK.search(text)
    if found is None:
        return text
    named = ctx.meta.setdefault(_KEPT, found["named"])
    if named != found["named"]:
        raise click.BadParameter(f"names two networks, {named} and {found['named']}; one is possible", ctx, param)
    return f"{text[: found.start()]}{found[1]}onnx{text[found.end() :]}"


def descriptor_option(text: str, *kinds: str) -> Callable[[Command], Command]:
    """--descriptor: one of `kinds`, or several joined by +, or npy:FILE; as the kind and the file, if there is one."""

    shown = (*kinds, "onnx:FILE[#LAYER]", "npy:FILE") if kinds else ("npy:FILE",)

    def parse(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, Path | None] | None:
        if value is None:
            return None
        value = take_network(ctx, param, value) if kinds else value
        if {*value.split("+")} <= {*kinds} | ({"onnx"} if _KEPT in ctx.meta else set()):
            return value, None
        kind, _, path = value.partition(":")
        if kind != "npy" or not path:
            raise click.BadParameter(f"{value!r} is not one of {', '.join(shown)}", ctx, param)
        return kind, Path(path)

    return groups.descriptor(
        "--descriptor",
        metavar="|".join(shown),
        callback=parse,
        help=text,
    )


def descriptor_options(function: Command) -> Command:
    """--descriptor, --variant, --image-size, --fit: what a descriptor is.

    The command gets `spec`, None if nobody asked for anything, and `matrix`.
    """

    @descriptor_option(
        "What describes a frame, or several joined by +. onnx:FILE: an image network; npy:FILE: a matrix computed "
        "elsewhere, one row a frame.  [default: gist, or what --views need]",
        *KINDS,
    )
    @groups.descriptor(
        "--variant",
        type=click.Choice(["lmgist", "classic"]),
        default="lmgist",
        help="Which GIST: LMgist (2011), or that of 2006 and lear_gist.",
    )
    @groups.descriptor(
        "--image-size",
        # Above 1024 the filters alone take gigabytes, and the descriptor has no use for the detail.
        type=click.IntRange(8, 1024),
        default=128,
        help="Side of the square that is described, in pixels.",
    )
    @groups.descriptor(
        "--fit",
        type=click.Choice(["squash", "crop"]),
        default="squash",
        help="How a picture becomes a square: stretched, or its middle.",
    )
    @functools.wraps(function)
    def described(*args: Any, descriptor: tuple[str, Path | None] | None, **options: Any) -> Any:
        from placerec.vision import KINDS as KNOWN, DescriptorSpec

        words = options.get("words")
        kind, matrix = descriptor or (words.kind() if words else "gist", None)
        settings = {name: options.pop(name) for name in ("variant", "image_size", "fit")}
        context = click.get_current_context()
        given = {name for name in settings if context.get_parameter_source(name) is not ParameterSource.DEFAULT}
        known = {} if matrix else dict.fromkeys(name for part in kind.split("+") for name in KNOWN[part].settings)
        for name in given.difference(known):
            raise click.UsageError(f"--{name.replace('_', '-')} says nothing about {kind} descriptors; leave it out")
        # What nobody asked for is the default, or what a file of descriptors holds.
        network = context.meta.get(_KEPT)
        asked = (descriptor or given or network) and not matrix
        if asked and network:
            settings["network"] = _opened(network)
        settings = {name: settings[name] for name in known if name in settings}
        spec = DescriptorSpec(kind=kind, **settings) if asked else None
        return function(*args, spec=spec, matrix=matrix, **options)

    return described


def _opened(named: str) -> "Network":
    from placerec.vision.onnx import open_network

    file, _, layer = named.partition("#")
    return open_network(file, layer)


def network_option(function: Command) -> Command:
    """--network: the file of the image network that a dictionary's words are of. The command gets `network`."""
    text = "The file of the image network, if the words are of one (onnx:FILE)."
    return click.option("--network", metavar="FILE", type=FILE, help=text)(function)


def matrix_option(function: Command) -> Command:
    """--descriptor npy:FILE alone. The command gets `matrix`, the file or None."""

    @descriptor_option("The frames' descriptors, if those of the dictionary were computed elsewhere.")
    @functools.wraps(function)
    def described(*args: Any, descriptor: tuple[str, Path] | None, **options: Any) -> Any:
        return function(*args, matrix=descriptor and descriptor[1], **options)

    return described
