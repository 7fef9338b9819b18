"""make-big-lm: a model of counts, whose rare n-grams are not held (SRILM's manual page training-scripts)."""

from collections.abc import Sequence
from io import BytesIO

from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.tools import ngram_count
from placerec.srilm.tools.discounting import given_method
from placerec.srilm.tools.options import Option, parse

TOOL = "make-big-lm"
USAGE = "usage: {tool} -name NAME -read COUNTS -lm MODEL [-trust-totals] [options of ngram-count]"
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
    if options["read"] == "-" or options["ngram-filter"] or options["text"]:
        raise SrilmError(
            f"{tool}: counts are read twice from a file; -read -, -ngram-filter and -text are not for it", 2
        )
    order = max(1, options["order"])
    if order > _MOST_ORDERS:
        raise SrilmError(f"{tool}: -order {order}: parameters have files up to order {_MOST_ORDERS}", 2)
    # Other methods than Good-Turing's need no parameters, or the counts of all n-grams.
    if given_method(options, "")[0] or any(
        given_method(options, str(n))[0] not in (None, "gt") for n in range(1, order + 1)
    ):
        return ngram_count.ngram_count(_without(arguments), streams, tool)
    files = [text for n in range(1, order + 1) for text in (f"-gt{n}", f"{options['name']}.gt{n}")]
    bounds = [
        text
        for name in options.given
        if name.startswith("gt") and name.endswith(("min", "max"))
        for text in (f"-{name}", f"{options[name]:g}")
    ]
    first = ["-read", options["read"], "-order", str(order), *bounds, *files]
    status = ngram_count.ngram_count(first, streams, tool)
    if status:
        return status
    rest = [*_without(arguments), *files, "-read-with-mincounts", "-meta-tag", _META_TAG]
    return ngram_count.ngram_count(rest, streams, tool)


def _without(arguments: Sequence[str]) -> list[str]:
    """The arguments that ngram-count has, too."""
    kept = []
    queue = list(arguments)
    while queue:
        argument = queue.pop(0)
        if argument in ("-name", "-max-per-file") and queue:
            queue.pop(0)
        else:
            kept.append(argument)
    return kept
