"""change-lm-vocab: a model over another vocabulary (section 13 of our SRILM specification)."""

import re
from collections.abc import Iterable, Sequence, Set
from io import BytesIO

from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.assignments import records

TOOL = "change-lm-vocab"
USAGE = "usage: {tool} -vocab FILE [-lm FILE] [-write-lm FILE] [-subset] [-tolower] [options of ngram]"
_SECTION = re.compile(r"\\(\d{1,18})-grams", re.ASCII)


@exit_status
def change_lm_vocab(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Drop what lies outside the vocabulary, then let `ngram` add what is missing and renormalise."""
    values, flags, rest = _taken(arguments)
    if "help" in flags or "vocab" not in values:
        raise SrilmError(USAGE.format(tool=tool), 0)
    if values["vocab"] == "-":
        raise SrilmError(f"{tool}: -vocab -: the vocabulary is read twice; name a file", 2)
    from placerec.srilm.tools.ngram import ngram

    words = WordList(lower="tolower" in flags)
    # Whole lines, of which ngram takes the first words: n-grams of a word that does not stand alone there go.
    listed = {SENTENCE_START, SENTENCE_END, *map(words.normal, streams.lines(values["vocab"]))}
    # With the empty lines: ngram's messages count them.
    filtered = restricted(records(values.get("lm", "-"), streams), listed, words)
    inner = Streams(BytesIO(filtered.encode("latin-1")), streams.stdout, streams.stderr)
    vocabulary = [] if "subset" in flags else ["-vocab", values["vocab"]]
    lower = ["-tolower"] if "tolower" in flags else []
    return ngram(
        ["-lm", "-", *vocabulary, *lower, "-renorm", "-write-lm", values.get("write-lm", "-"), *rest], inner, tool
    )


def restricted(lines: Iterable[str], listed: Set[str], words: WordList) -> str:
    """An ARPA file's lines without the n-grams that have words which are not listed; the header stays as it is."""
    order, kept = 0, []
    for line in lines:
        if match := _SECTION.match(line):
            order = int(match[1])
        elif line.startswith("\\"):
            order = 0
        elif order and not all(words.normal(word) in listed for word in tokens(line)[1 : order + 1]):
            continue
        kept.append(f"{line}\n")
    return "".join(kept)


def _taken(arguments: Sequence[str]) -> tuple[dict[str, str], set[str], list[str]]:
    """Our own options with values, those without, and what is handed on to ngram."""
    values: dict[str, str] = {}
    flags: set[str] = set()
    rest: list[str] = []
    queue = list(arguments)
    while queue:
        argument = queue.pop(0)
        name = argument.removeprefix("-")
        if argument in ("-vocab", "-lm", "-write-lm") and queue:
            values[name] = queue.pop(0)
        elif argument in ("-subset", "-tolower", "-help"):
            flags.add(name)
        else:
            rest.append(argument)
    return values, flags, rest
