"""uniform-classes: equal shares where a classes file gives no probability; section T3 of our specification."""

from collections import Counter
from collections.abc import Sequence

from placerec.srilm.text.classes_file import split_expansion
from placerec.srilm.text.streams import Streams, exit_status, tokens
from placerec.srilm.tools.assignments import records, split_assignments

TOOL = "uniform-classes"
USAGE = "usage: {tool} [CLASSES ...]  (default: standard input)"


@exit_status
def uniform_classes(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Print the classes, an equal share for each expansion without a probability; returns the exit status."""
    _, files = split_assignments(arguments, USAGE.format(tool=tool))
    lines = [line for name in files for line in records(name, streams) if tokens(line)]
    expansions = [split_expansion(tokens(line)) for line in lines]
    streams.say(f"read {len(lines)} class expansions")
    many = Counter(expansion.name for expansion in expansions)
    for line, (name, p, words) in zip(lines, expansions, strict=True):
        streams.print((line if p is not None else " ".join((name, f"{1 / many[name]:g}", *words))) + "\n")
    return 0
