"""What a descriptor is, or the file of descriptors that were computed elsewhere."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from placerec.cli.shared import groups
from placerec.cli.shared.values import Command

# Of `vision.KINDS`, which takes numpy to import.
KINDS = ("gist", "lbp", "ranks", "centrist")


def descriptor_option(text: str, *kinds: str) -> Callable[[Command], Command]:
    """--descriptor: one of `kinds`, or several joined by +, or npy:FILE; as the kind and the file, if there is one."""

    def parse(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, Path | None] | None:
        if value is None:
            return None
        if {*value.split("+")} <= {*kinds}:
            return value, None
        kind, _, path = value.partition(":")
        if kind != "npy" or not path:
            raise click.BadParameter(f"{value!r} is not one of {', '.join((*kinds, 'npy:FILE'))}", ctx, param)
        return kind, Path(path)

    return groups.descriptor(
        "--descriptor",
        metavar="|".join((*kinds, "npy:FILE")),
        callback=parse,
        help=text,
    )


def descriptor_options(function: Command) -> Command:
    """--descriptor, --variant, --image-size, --fit: what a descriptor is.

    The command gets `spec`, None if nobody asked for anything, and `matrix`.
    """

    @descriptor_option(
        "What describes a frame, or several joined by +; FILE: a matrix computed elsewhere, one row a frame.  "
        "[default: gist, or what --views need]",
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
        from placerec.vision import DescriptorSpec

        words = options.get("words")
        kind, matrix = descriptor or (words.kind() if words else "gist", None)
        settings = {name: options.pop(name) for name in ("variant", "image_size", "fit")}
        context = click.get_current_context()
        given = {name for name in settings if context.get_parameter_source(name) is not ParameterSource.DEFAULT}
        known = () if matrix else DescriptorSpec(kind=kind).settings
        for name in given.difference(known):
            raise click.UsageError(f"--{name.replace('_', '-')} says nothing about {kind} descriptors; leave it out")
        # What nobody asked for is the default, or what a file of descriptors holds.
        asked = (descriptor or given) and not matrix
        spec = DescriptorSpec(kind=kind, **{name: settings[name] for name in known}) if asked else None
        return function(*args, spec=spec, matrix=matrix, **options)

    return described


def matrix_option(function: Command) -> Command:
    """--descriptor npy:FILE alone. The command gets `matrix`, the file or None."""

    @descriptor_option("The frames' descriptors, if those of the dictionary were computed elsewhere.")
    @functools.wraps(function)
    def described(*args: Any, descriptor: tuple[str, Path] | None, **options: Any) -> Any:
        return function(*args, matrix=descriptor and descriptor[1], **options)

    return described
