"""subtract-ppls: what is left of one `ngram -ppl` output without others (SRILM's manual page ppl-scripts)."""

from collections.abc import Sequence

from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools.add_ppls import print_total, totals_of
from placerec.srilm.tools.assignments import HELP

TOOL = "subtract-ppls"
USAGE = "usage: {tool} PPL1 [PPL2 ...]  (outputs of ngram -ppl)"


@exit_status
def subtract_ppls(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Take the totals of all files but the first from those of the first, and print the block of the rest."""
    if not arguments or arguments[0] in HELP:
        raise SrilmError(USAGE.format(tool=tool), 0 if arguments else 2)
    total, others = totals_of(arguments[:1], streams), totals_of(arguments[1:], streams)
    print_total(total.plus(others.times(-1)), streams)
    return 0
