"""Who does the work, and what need not be done again: --jobs, --cluster, --cache."""

import functools
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from placerec.cli.shared import groups
from placerec.cli.shared.values import PATH, Command, usage

if TYPE_CHECKING:
    from placerec.jobs import Executor


def _cluster_address(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    if value is not None:
        from placerec.cluster import check_address

        with usage("--cluster"):
            check_address(value)
    return value


jobs_option = groups.work(
    "-j",
    "--jobs",
    metavar="N",
    type=click.IntRange(min=1),
    help="Processes that share the work; the output is the same for any number.  [default: one a processor]",
)
# That of placerec.files, written out: --help would wait for what it loads.
CACHE = ".placerec-cache"
_CLUSTER = groups.work(
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


def cache_option(function: Command) -> Command:
    """--cache, --no-cache: where descriptors are kept for other commands. The command gets `cache`, and has `out`."""

    @groups.kept(
        "--cache",
        metavar="DIR",
        type=PATH,
        help=f"Where descriptors are kept for other commands that see the images.  [default: {CACHE}/ beside -o]",
    )
    @groups.kept("--no-cache", is_flag=True, help="Keep no descriptors, and use none that were kept.")
    @functools.wraps(function)
    def keeping(*args: Any, cache: Path | None, no_cache: bool, out: Path | None, **options: Any) -> Any:
        if no_cache and cache is not None:
            raise click.UsageError("--cache and --no-cache contradict each other; leave one of them out")
        beside = None if no_cache or out is None else out.parent / CACHE
        return function(*args, out=out, cache=cache or beside, **options)

    return keeping
