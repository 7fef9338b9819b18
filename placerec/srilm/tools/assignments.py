"""Arguments of SRILM's scripts: `name=value` before the files, as gawk takes them (section T3)."""

import re
from collections.abc import Iterator, Sequence

from placerec.srilm.text.streams import SrilmError, Streams

HELP = ("-help", "-?", "--help", "-h")
_BLOCK = 1 << 19
_ASSIGNMENT = re.compile(r"([A-Za-z_]\w*)=(.*)", re.DOTALL)


def split_assignments(arguments: Sequence[str], usage: str) -> tuple[dict[str, str], list[str]]:
    """The values by name, and the files, `-` if there are none; SrilmError (status 0) with `usage` where help is asked.

    As with gawk, an assignment holds wherever it stands, and one of no known name does nothing.
    """
    if arguments and arguments[0] in HELP:
        raise SrilmError(usage, 0)
    values: dict[str, str] = {}
    files = []
    for argument in arguments:
        if match := _ASSIGNMENT.fullmatch(argument):
            values[match[1]] = match[2]
        else:
            files.append(argument)
    return values, files or ["-"]


def records(name: str, streams: Streams) -> Iterator[str]:
    """All lines of a file (`-`: standard input), blank ones and comments too, as gawk takes them."""
    for block in streams.lines(name).blocks(_BLOCK):
        yield from block.decode("latin-1").removesuffix("\n").split("\n")
