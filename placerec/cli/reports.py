"""Pages of what was believed: `placerec report`."""

from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import click

from placerec.cli import shared
from placerec.cli.shared.groups import GroupedCommand

_FRAMES = "--frames"


class _ReportCommand(GroupedCommand):
    """`--frames` has all arguments up to the next option, as a shell writes what a pattern stands for."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put `--frames` before each of its sources."""
        taking, spelled = False, []
        for arg, after in zip_longest(args, args[1:], fillvalue="-"):
            if arg == _FRAMES and after.startswith("-"):
                raise click.BadOptionUsage(_FRAMES, f"Option {_FRAMES!r} needs a source behind it.", ctx)
            if arg.startswith("-") and arg != "-":
                taking = arg == _FRAMES
                spelled.append([] if taking else [arg])
            else:
                spelled.append([_FRAMES, arg] if taking else [arg])
        return super().parse_args(ctx, [*chain(*spelled)])


@click.command(
    cls=_ReportCommand, epilog="Example: placerec report beliefs/ --frames RUNS/run3 RUNS/run7 -o report.html"
)
@click.argument("beliefs", metavar="BELIEFS...", nargs=-1, required=True, type=shared.PATH_OR_STREAM)
@click.option(
    _FRAMES,
    metavar="SOURCE...",
    multiple=True,
    type=shared.PATH,
    help="The images that were decoded, to be seen in the page.",
)
@shared.words_option(False, "Show the typical frame of each word, too; needs --frames.")
@shared.network_option
@shared.reading_options()
@shared.output_option("report.html", "The page to write: one file.")
@shared.cache_option
@shared.talk_options
def report(beliefs: tuple[Path, ...], frames: tuple[Path, ...], words: Path | None, out: Path, **how: Any) -> None:
    """Write beliefs as a page to point at.

    BELIEFS are files of decode (.tsv) or folders of them. One file that opens from disk, without a network: point at a
    moment of a drive, and see the frame, its words, how probable the places are, and what argued for and against, if
    `decode --explain` wrote that beside the beliefs. It steps through errors, changes and what is least sure. Files of
    one name and the same frames, in several folders, are shown beside each other: who is right where the other is
    wrong.
    """
    from placerec.page.report import report as run

    if words is not None and not frames:
        raise click.UsageError("-w shows typical frames of words, and there are none without --frames")
    drives = run(beliefs, out, frames=frames, words=words, progress=shared.progress_bar, **how)
    shared.log.info("%s: %d frames; now open it", out, sum(len(drive.frames) for drive in drives))
