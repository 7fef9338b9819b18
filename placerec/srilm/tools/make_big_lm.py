"""make-big-lm: a model of counts, whose rare n-grams are not held (SRILM's manual page training-scripts)."""

from collections.abc import Sequence
from io import BytesIO

from placerec.srilm.text.pipes import as_file, filtered, joined
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools import ngram_count
from placerec.srilm.tools.discounting import given_method
from placerec.srilm.tools.options import Option, parse

TOOL = "make-big-lm"
USAGE = "usage: {tool} -name NAME -read COUNTS ... -lm MODEL [-ngram-filter COMMAND] [options of ngram-count]"
_META_TAG = "__meta__"
_MOST_ORDERS = 9


@exit_status
def make_big_lm(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Write Good-Turing parameters of all counts to NAME.gtN, then a model of the n-grams that are frequent enough."""
    own = {name: Option("string") for name in ("name", "max-per-file", "ngram-filter")}
    # What is wrong with the options is told by ngram-count.
    silent = Streams(streams.stdin, streams.stdout, BytesIO())
    options = parse(tool, {**ngram_count.OPTIONS, **own}, arguments, silent)
    if not (options["name"] and options["read"] and options["lm"]):
        raise SrilmError(USAGE.format(tool=tool), 2)
    rest, reads = _split(arguments)
    if "-" in reads or options["text"]:
        raise SrilmError(f"{tool}: counts are read twice from files; -read - and -text are not for it", 2)

    def estimate(*arguments: str) -> int:
        if len(reads) == 1 and not options["ngram-filter"]:
            return ngram_count.ngram_count(["-read", *reads, *arguments], streams, tool)
        counts = joined(reads, streams)
        if options["ngram-filter"]:
            counts = filtered(options["ngram-filter"], counts)
        inner = Streams(as_file(counts), streams.stdout, streams.stderr)
        return ngram_count.ngram_count(["-read", "-", *arguments], inner, tool)

    order = max(1, options["order"])
    if order > _MOST_ORDERS:
        raise SrilmError(f"{tool}: -order {order}: parameters have files up to order {_MOST_ORDERS}", 2)
    # Other methods than Good-Turing's need no parameters, or the counts of all n-grams.
    if given_method(options, "")[0] or any(
        given_method(options, str(n))[0] not in (None, "gt") for n in range(1, order + 1)
    ):
        return estimate(*rest)
    files = [text for n in range(1, order + 1) for text in (f"-gt{n}", f"{options['name']}.gt{n}")]
    bounds = [
        text
        for name in options.given
        if name.startswith("gt") and name.endswith(("min", "max"))
        for text in (f"-{name}", f"{options[name]:g}")
    ]
    status = estimate("-order", str(order), *bounds, *files)
    return status or estimate(*rest, *files, "-read-with-mincounts", "-meta-tag", _META_TAG)


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments that ngram-count has, too, without -read; and the files that -read names, each time it is given."""
    kept, reads = [], []
    queue = list(arguments)
    while queue:
        argument = queue.pop(0)
        if argument in ("-name", "-max-per-file", "-ngram-filter") and queue:
            queue.pop(0)
        elif argument == "-read" and queue:
            reads.append(queue.pop(0))
        else:
            kept.append(argument)
    return kept, reads
