"""replace-words-with-classes: a text with its words' classes; section T3 of our specification of SRILM's tools."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

from placerec.srilm.text.classes_file import Expansion, read_expansions
from placerec.srilm.text.numbers import leading_float
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.tools.assignments import records, split_assignments

TOOL = "replace-words-with-classes"
USAGE = (
    "usage: {tool} classes=FILE [outfile=FILE] [normalize=0|1] [addone=K] [have_counts=1] [TEXT ...]"
    "  (default: standard input)"
)
Expansions = dict[tuple[str, ...], str]


@exit_status
def replace_words_with_classes(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Print the texts with the longest expansions replaced by their classes; returns the exit status."""
    values, files = split_assignments(arguments, USAGE.format(tool=tool))
    if not values.get("classes"):
        raise SrilmError(f"{tool}: needs classes=FILE\n{USAGE.format(tool=tool)}", 2)
    expansions = list(read_expansions(streams.lines(values["classes"]), streams))
    streams.say(f"read {len(expansions)} class expansions")
    class_of: Expansions = {}
    for expansion in expansions:
        # Of several classes for the same words the manual page takes the first.
        class_of.setdefault(expansion.words, expansion.name)
    longest = max(map(len, class_of), default=0)
    seen: defaultdict[tuple[str, ...], float] = defaultdict(float)
    with_counts = bool(_number(values.get("have_counts", "")))
    for name in files:
        for line in records(name, streams):
            words = tokens(line)
            count = words.pop() if with_counts and words else ""
            replaced = list(_replaced(words, class_of, longest))
            for _, found in replaced:
                if found:
                    seen[found] += _number(count) if with_counts else 1
            shown = [text for text, _ in replaced] + [count] * with_counts
            streams.print(" ".join(shown) + "\n")
    if values.get("outfile"):
        streams.write(values["outfile"], _format(expansions, class_of, seen, values))
    return 0


def _number(text: str) -> float:
    return leading_float(text) or 0.0


def _replaced(words: Sequence[str], class_of: Expansions, longest: int) -> Iterator[tuple[str, tuple[str, ...]]]:
    """What stands for the words from left to right, and the words that it stands for."""
    at = 0
    while at < len(words):
        for size in range(min(longest, len(words) - at), 0, -1):
            found = tuple(words[at : at + size])
            if found in class_of:
                yield class_of[found], found
                at += size
                break
        else:
            yield words[at], ()
            at += 1


def _format(
    expansions: Sequence[Expansion],
    class_of: Expansions,
    seen: dict[tuple[str, ...], float],
    values: dict[str, str],
) -> str:
    """The expansions with their counts, or with shares of the counts of their class."""
    normalize = _number(values.get("normalize", "1")) != 0
    added = _number(values.get("addone", "1" if normalize else "0"))
    pairs = dict.fromkeys((expansion.name, expansion.words) for expansion in expansions)
    count = {(name, words): (seen[words] if class_of[words] == name else 0.0) + added for name, words in pairs}
    total: defaultdict[str, float] = defaultdict(float)
    for (name, _), value in count.items():
        total[name] += value
    lines = []
    for (name, words), value in count.items():
        share = (value / total[name] if total[name] else 0.0) if normalize else value
        lines.append(f"{name} {share:g} {' '.join(words)}\n")
    return "".join(lines)
