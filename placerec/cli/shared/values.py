"""What values of options and arguments can be: paths, numbers, lists; and what is said of others."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from placerec.errors import PlacerecError

Command = Callable[..., Any]


class PathType(click.Path):
    """A path as a Path; no empty text (a shell variable that is not set), and `-` only where it is a stream."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if str(value) == "":
            self.fail("the path is empty", param, ctx)
        if str(value) == "-" and not self.allow_dash:
            self.fail("`-` is no stream here; name a path", param, ctx)
        if str(value).startswith("camera:") and isinstance(param, click.Argument):
            return value  # No path: one would lose a slash of the address.
        return super().convert(value, param, ctx)


class FiniteRange(click.FloatRange):
    """A range of numbers that NaN and infinity are not in."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number:g} is not a number that can be used", param, ctx)
        return number


PATH = PathType(path_type=Path)
PATH_OR_STREAM = PathType(path_type=Path, allow_dash=True)
FILE = PathType(path_type=Path, dir_okay=False)


@contextmanager
def usage(option: str) -> Iterator[None]:
    """What the library says of a value within is an error of usage: the value of `option` is not understood."""
    try:
        yield
    except PlacerecError as error:
        raise click.BadParameter(str(error), ctx=click.get_current_context(), param_hint=repr(option)) from error


def listed(item: "click.ParamType[Any]") -> Callable[[click.Context, click.Parameter, str], tuple[Any, ...]]:
    """A callback that reads values with commas between them, none of them twice, as a tuple."""

    def parse(ctx: click.Context, param: click.Parameter, value: str) -> tuple[Any, ...]:
        values = tuple(item.convert(each.strip(), param, ctx) for each in value.split(","))
        twice = [each for number, each in enumerate(values) if each in values[:number]]
        if twice:
            raise click.BadParameter(f"{twice[0]} is named twice", ctx, param)
        return values

    return parse
