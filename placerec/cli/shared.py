"""Options that several commands share: one spelling, one meaning."""

import functools
import itertools
import json
import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from placerec.errors import PlacerecError

if TYPE_CHECKING:
    from placerec.jobs import Executor

Command = Callable[..., Any]
log = logging.getLogger("placerec")


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
def usage(option: str) -> Iterator[None]:
    """What the library says of a value within is an error of usage: the value of `option` is not understood."""
    try:
        yield
    except PlacerecError as error:
        raise click.BadParameter(str(error), ctx=click.get_current_context(), param_hint=repr(option)) from error


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


def source_arguments(function: Command) -> Command:
    """SOURCE..., and how it is read. The command gets `sources` and `source_options`."""
    function = reading_options()(function)
    return click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=PATH_OR_STREAM)(function)


def _cluster_address(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    if value is not None:
        from placerec.cluster import check_address

        with usage("--cluster"):
            check_address(value)
    return value


tokens_argument = click.argument("tokens", metavar="TOKENS...", nargs=-1, required=True, type=PATH)
jobs_option = click.option(
    "-j",
    "--jobs",
    metavar="N",
    type=click.IntRange(min=1),
    help="Processes that share the work; the output is the same for any number.  [default: one a processor]",
)
_CLUSTER = click.option(
    "--cluster",
    metavar="ADDRESS|local:N",
    callback=_cluster_address,
    help="Let a Dask cluster do the work: its scheduler's address, or N processes here; the output is the same.",
)


def _cluster(address: str | None) -> "AbstractContextManager[Executor | None]":
    if address is None:
        return nullcontext()
    from placerec.cluster import cluster

    return cluster(address)


def cluster_option(function: Command) -> Command:
    """--cluster: other machines that take a share. The command gets `work`, None without."""

    @_CLUSTER
    @functools.wraps(function)
    def working(*args: Any, cluster: str | None, **options: Any) -> Any:
        with _cluster(cluster) as work:
            return function(*args, work=work, **options)

    return working


def work_options(function: Command) -> Command:
    """--jobs, --cluster: who does the work. The command gets `work`."""

    @jobs_option
    @_CLUSTER
    @functools.wraps(function)
    def working(*args: Any, jobs: int | None, cluster: str | None, **options: Any) -> Any:
        from placerec.jobs import processors, workers

        if jobs and cluster:
            raise click.UsageError("--jobs is of this machine, and --cluster of others; leave one of them out")
        with _cluster(cluster) as work:
            return function(*args, work=work or workers(jobs or processors()), **options)

    return working


def reading_options(note: str = "") -> Callable[[Command], Command]:
    """--format, --every, --topic, --labels...: how sources are to be read. The command gets `source_options`."""

    def decorated(function: Command) -> Command:
        @click.option(
            "--format",
            "format_",
            type=click.Choice(["auto", "sequences", "places"]),
            default="auto",
            help=f"What a folder of folders{note} is: sequences, or one folder per place.",
        )
        @click.option(
            "--every", metavar="N", type=click.IntRange(min=1), default=1, help="Read the first of every N frames."
        )
        @click.option("--topic", metavar="NAME", help="The images of a bag to read, if it has several topics of them.")
        @click.option(
            "--labels",
            metavar="FILE",
            type=PATH,
            help="Lines 'start end place' in seconds that label a video or a bag; or a folder of NAME.labels.  "
            "[default: NAME.labels beside it]",
        )
        @click.option(
            "--camera", metavar="NAME", help="The camera to read of a run of several.  [default: colour, or left]"
        )
        @click.option(
            "--from",
            "begin",
            metavar="S",
            type=FiniteRange(min=0),
            default=0.0,
            help="Read each sequence from this second on, counted from the first frame.",
        )
        @click.option(
            "--to",
            "end",
            metavar="S",
            type=FiniteRange(min=0, min_open=True),
            help="Read no frame from this second on.",
        )
        @click.option(
            "--rate",
            metavar="HZ",
            type=FiniteRange(min=0, min_open=True),
            help="Frames a second, where images have no times.",
        )
        @click.option(
            "--label-clock",
            type=click.Choice(["auto", "stamps", "start"]),
            default="auto",
            help="What seconds in labels are: those of the frames' time stamps, or counted from the first frame.",
        )
        @functools.wraps(function)
        def read(*args: Any, format_: str, **options: Any) -> Any:
            from placerec.frames.sequence import SourceOptions

            settings = {field.name: options.pop(field.name) for field in fields(SourceOptions) if field.name in options}
            end = settings["end"]
            with usage("--labels" if end is None or settings["begin"] < end else "--to"):
                source_options = SourceOptions(format_, **settings)
            return function(*args, source_options=source_options, **options)

        return read

    return decorated


def descriptor_option(text: str, *kinds: str) -> Callable[[Command], Command]:
    """--descriptor: one of `kinds`, the first by default, or npy:FILE; as the kind and the file, if there is one."""

    def parse(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, Path | None] | None:
        if value is None:
            return None
        if value in kinds:
            return value, None
        kind, _, path = value.partition(":")
        if kind != "npy" or not path:
            raise click.BadParameter(f"{value!r} is not one of {', '.join((*kinds, 'npy:FILE'))}", ctx, param)
        return kind, Path(path)

    return click.option(
        "--descriptor",
        metavar="|".join((*kinds, "npy:FILE")),
        callback=parse,
        default=kinds[0] if kinds else None,
        show_default=bool(kinds),
        help=text,
    )


def descriptor_options(function: Command) -> Command:
    """--descriptor, --variant, --image-size, --fit: what a descriptor is. The command gets `spec` and `matrix`."""

    @descriptor_option(
        "What describes a frame; FILE: a matrix computed elsewhere, one row a frame.", "gist", "centrist"
    )
    @click.option(
        "--variant",
        type=click.Choice(["lmgist", "classic"]),
        default="lmgist",
        help="Which GIST: LMgist (2011), or that of 2006 and lear_gist.",
    )
    @click.option(
        "--image-size",
        # Above 1024 the filters alone take gigabytes, and the descriptor has no use for the detail.
        type=click.IntRange(8, 1024),
        default=128,
        help="Side of the square that is described, in pixels.",
    )
    @click.option(
        "--fit",
        type=click.Choice(["squash", "crop"]),
        default="squash",
        help="How a picture becomes a square: stretched, or its middle.",
    )
    @functools.wraps(function)
    def described(*args: Any, descriptor: tuple[str, Path | None], **options: Any) -> Any:
        from placerec.vision import KINDS, DescriptorSpec

        kind, matrix = descriptor
        settings = {name: options.pop(name) for name in ("variant", "image_size", "fit")}
        context = click.get_current_context()
        for name in [name for name in settings if name not in KINDS[kind].settings]:
            if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
                raise click.UsageError(
                    f"--{name.replace('_', '-')} says nothing about {kind} descriptors; leave it out"
                )
            del settings[name]
        spec = None if matrix else DescriptorSpec(kind=kind, **settings)
        return function(*args, spec=spec, matrix=matrix, **options)

    return described


def matrix_option(function: Command) -> Command:
    """--descriptor npy:FILE alone. The command gets `matrix`, the file or None."""

    @descriptor_option("The frames' descriptors, if those of the dictionary were computed elsewhere.")
    @functools.wraps(function)
    def described(*args: Any, descriptor: tuple[str, Path] | None, **options: Any) -> Any:
        return function(*args, matrix=descriptor and descriptor[1], **options)

    return described


def size_option(default: int) -> Callable[[Command], Command]:
    """--size: of the map."""
    text = "Side of the map: size x size words."
    return click.option("--size", type=click.IntRange(2, 200), default=default, help=text)


def listed(item: "click.ParamType[Any]") -> Callable[[click.Context, click.Parameter, str], tuple[Any, ...]]:
    """A callback that reads values with commas between them, none of them twice, as a tuple."""

    def parse(ctx: click.Context, param: click.Parameter, value: str) -> tuple[Any, ...]:
        values = tuple(item.convert(each.strip(), param, ctx) for each in value.split(","))
        twice = [each for number, each in enumerate(values) if each in values[:number]]
        if twice:
            raise click.BadParameter(f"{twice[0]} is named twice", ctx, param)
        return values

    return parse


def as_in_paper(text: str, **values: str) -> Callable[[Command], Command]:
    """--as-in-paper: other defaults for some options, by the names of their parameters; what is given wins."""

    def preset(ctx: click.Context, param: click.Parameter, chosen: bool) -> None:
        if chosen:
            ctx.default_map = {**(ctx.default_map or {}), **values}

    return click.option("--as-in-paper", is_flag=True, is_eager=True, expose_value=False, callback=preset, help=text)


def seed_option(text: str) -> Callable[[Command], Command]:
    """--seed: 0 or above, 0 by default."""
    return click.option("--seed", type=click.IntRange(min=0), default=0, help=text)


def words_option(required: bool, text: str) -> Callable[[Command], Command]:
    """-w: the visual dictionary."""
    return click.option("-w", "--words", metavar="words.npz", type=PATH, required=required, help=text)


def dictionary_option(function: Command) -> Command:
    """--dictionary: one of the file's. The command gets `name`."""
    text = "Which dictionary, if train-words learned several: pn20, for instance.  [default: the first]"
    return click.option(
        "--dictionary", "name", metavar="NAME", callback=lambda ctx, param, value: value or "", help=text
    )(function)


def output_option(metavar: str, text: str, required: bool = True) -> Callable[[Command], Command]:
    """-o: the output, replaced whole if it exists; a folder if `metavar` ends in a slash, else a file."""
    path = PATH if metavar.endswith("/") else FILE
    return click.option("-o", "--out", metavar=metavar, type=path, required=required, help=text)


def json_option(text: str = "Print JSON.") -> Callable[[Command], Command]:
    """--json: output for programs."""
    return click.option("--json", "as_json", is_flag=True, help=text)


def echo_json(found: object) -> None:
    """Print JSON for people and programs."""
    click.echo(json.dumps(found, indent=2, ensure_ascii=False))


def decoding_options(function: Command) -> Command:
    """What beliefs depend on: --transition, --stay, --per, --alpha, --memory, ... The command gets `options`.

    Other options of the command that are fields of `Decoding` become part of it, too.
    """

    @click.option(
        "--transition",
        metavar="fixed|learned|FILE",
        help="How the place changes: --stay, as the training counted it, or a table of probabilities.  "
        "[default: learned, if the training learned how words weigh]",
    )
    @click.option(
        "--stay", type=FiniteRange(0, 1), help="Probability of staying in a place for one step.  [default: 0.99]"
    )
    @click.option(
        "--per",
        type=click.Choice(["update", "frame", "second"]),
        help="What one step is: a selected word, a frame, a second.  [default: update]",
    )
    @click.option(
        "--alpha",
        metavar="X",
        type=FiniteRange(0, min_open=True),
        help="The exponent of words' probabilities: how much they weigh.  [default: as learned, else 1]",
    )
    @click.option(
        "--memory",
        metavar="X",
        type=FiniteRange(0, 1),
        help="The share of the belief that each step forgets.  [default: as learned, else 0]",
    )
    @as_in_paper(
        "What is not given is as in the paper: --transition fixed --alpha 1 --memory 0.",
        transition="fixed",
        alpha="1",
        memory="0",
    )
    @click.option(
        "--max-gap",
        metavar="SECONDS",
        type=FiniteRange(0, min_open=True),
        help="More time than this between two frames begins a new sequence.",
    )
    @click.option("--smooth", is_flag=True, help="Let all words of a sequence count for every frame.")
    @click.option(
        "--lag", metavar="N", type=click.IntRange(0), help="Let the words up to N frames later count for each frame."
    )
    @functools.wraps(function)
    def decoding(*args: Any, **options: Any) -> Any:
        from dataclasses import fields

        from placerec.model import Decoding

        try:
            chosen = Decoding(**{one.name: options.pop(one.name) for one in fields(Decoding) if one.name in options})
        except PlacerecError as error:
            raise click.UsageError(str(error)) from error
        return function(*args, options=chosen, **options)

    return decoding
