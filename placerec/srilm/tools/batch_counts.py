"""make-batch-counts and merge-batch-counts: counts of more text than memory holds (manual page training-scripts).

Batches of texts are counted one after the other, and the sorted counts merged. What the counts files are called is
known from users' recipes, not from the manual: COUNT-DIR/merge-iterI-1.ngrams.gz is the one that is left in the end.
"""

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from placerec.srilm.text.numbers import leading_int
from placerec.srilm.text.pipes import as_file, filtered, joined
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, path_of
from placerec.srilm.tools.assignments import HELP, records
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.ngram_merge import ngram_merge

USAGE = "usage: {tool} FILE-LIST [BATCH-SIZE [FILTER [COUNT-DIR [options of ngram-count]]]]"
MERGE_USAGE = "usage: {tool} [-float-counts] [-l N] COUNT-DIR [FILE-LIST|ITERATION]"
_DEFAULTS = ("10", "cat", "counts")
_BATCH, _MERGED = re.compile(r"batch-[0-9]+\.ngrams\.gz"), re.compile(r"merge-iter[0-9]+-1\.ngrams\.gz")
# Files that are merged at once: systems let a process open some hundred.
_AT_ONCE = 64


@exit_status
def make_batch_counts(arguments: Sequence[str], streams: Streams, tool: str = "make-batch-counts") -> int:
    """Count the texts of a list, some at a time, into sorted counts files in a folder."""
    if not arguments or arguments[0] in HELP:
        raise SrilmError(USAGE.format(tool=tool), 0 if arguments else 2)
    names, options = _listed(arguments[0], streams), arguments[4:]
    size_text, command, folder = (*arguments[1:4], *_DEFAULTS[len(arguments) - 1 :])[:3]
    size = leading_int(size_text)
    if size is None or size < 1:
        raise SrilmError(f"{tool}: batch size {size_text}: a number above 0 is needed", 2)
    if not names:
        raise SrilmError(f"{tool}: {arguments[0]}: no texts are listed")
    batches = [names[i : i + size] for i in range(0, len(names), size)]
    files = [f"{folder}/batch-{i}.ngrams.gz" for i in range(1, len(batches) + 1)]
    older = sorted(set(_found(folder, _BATCH)) - set(files))
    if older:
        raise SrilmError(f"{tool}: {older[0]} is of a run with more batches; remove it, or name another folder")
    _make_folder(folder)
    for batch, file in zip(batches, files, strict=True):
        inner = Streams(as_file(filtered(command, joined(batch, streams))), streams.stdout, streams.stderr)
        status = ngram_count([*options, "-text", "-", "-sort", "-write", file], inner, tool)
        if status:
            return status
        streams.say(f"counted {len(batch)} texts into {file}")
    return 0


@exit_status
def merge_batch_counts(arguments: Sequence[str], streams: Streams, tool: str = "merge-batch-counts") -> int:
    """Merge the counts that make-batch-counts left in a folder, or those of a list, into one file in the folder.

    What make-batch-counts wrote is removed once it is merged, so that one counts file is left; listed files stay.
    """
    width, options, rest = _merge_arguments(arguments, tool)
    folder = rest[0]
    # A number restarts the merging in the middle, which begins anew here.
    listed = len(rest) > 1 and not rest[1].isdecimal()
    files = _listed(rest[1], streams) if listed else _found(folder, _BATCH)
    if not files:
        raise SrilmError(f"{tool}: {rest[1] if listed else folder}: no counts to merge; see make-batch-counts")
    final = files[0] if len(files) == 1 else f"{folder}/merge-iter{_iterations(len(files), width)}-1.ngrams.gz"
    older = [] if listed else sorted(set(_found(folder, _MERGED)) - {final})
    if older:
        raise SrilmError(f"{tool}: {older[0]} is of a run with other batches; remove it, or name another folder")
    if len(files) == 1:
        streams.say(f"final counts in {final}")
        return 0
    _make_folder(folder)
    with TemporaryDirectory(dir=path_of(folder)) as between:
        status = _merge(files, final, options, streams, tool, os.fsencode(between).decode("latin-1"))
    if status:
        return status
    for file in () if listed else files:
        os.unlink(path_of(file))
    streams.say(f"final counts in {final}")
    return 0


def _merge_arguments(arguments: Sequence[str], tool: str) -> tuple[int, list[str], list[str]]:
    """How many files an iteration merges, options of ngram-merge, and the folder with what stands behind it."""
    if not arguments or arguments[0] in HELP:
        raise SrilmError(MERGE_USAGE.format(tool=tool), 0 if arguments else 2)
    width, options, rest = "2", [], list(arguments)
    while rest and rest[0].startswith("-"):
        option = rest.pop(0)
        if option == "-l" and rest:
            width = rest.pop(0)
        elif option == "-float-counts":
            options.append(option)
        else:
            raise SrilmError(f"{tool}: unknown option {option}\n{MERGE_USAGE.format(tool=tool)}", 2)
    number = leading_int(width)
    if number is None or number < 2:
        raise SrilmError(f"{tool}: -l {width}: a number above 1 is needed", 2)
    if not 1 <= len(rest) <= 2:
        raise SrilmError(MERGE_USAGE.format(tool=tool), 2)
    return number, options, rest


def _iterations(files: int, width: int) -> int:
    """How often `width` files become one until one is left."""
    times = 0
    while files > 1:
        files, times = math.ceil(files / width), times + 1
    return times


def _merge(files: Sequence[str], final: str, options: Sequence[str], streams: Streams, tool: str, between: str) -> int:
    """Merge sorted counts, by way of files in the folder `between` if they are many; the exit status."""
    for level in range(len(files)):
        groups = [files[i : i + _AT_ONCE] for i in range(0, len(files), _AT_ONCE)]
        if len(groups) == 1:
            break
        files = [f"{between}/{level}-{i}.gz" for i in range(len(groups))]
        for group, file in zip(groups, files, strict=True):
            # ngram-merge wants two.
            two = [*group, os.devnull] if len(group) == 1 else group
            status = ngram_merge([*options, "-write", file, "--", *two], streams, tool)
            if status:
                return status
    return ngram_merge([*options, "-write", final, "--", *files], streams, tool)


def _make_folder(name: str) -> None:
    try:
        Path(path_of(name)).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SrilmError(f"{name}: {error.strerror or error}") from error


def _found(folder: str, pattern: re.Pattern[str]) -> list[str]:
    """The counts files of a folder that have such names, in the order of their numbers."""
    try:
        names = [name for name in os.listdir(path_of(folder)) if pattern.fullmatch(name)]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise SrilmError(f"{folder}: {error.strerror or error}") from error
    return [f"{folder}/{name}" for name in sorted(names, key=lambda name: (len(name), name))]


def _listed(name: str, streams: Streams) -> list[str]:
    """The files that a list names, one a line; lines that start with # name none."""
    lines = (line.strip(" \t\r") for line in records(name, streams))
    return [line for line in lines if line and not line.startswith("#")]
