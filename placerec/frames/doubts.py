"""What makes results look better or worse than they are, and shows in no number: it is told as a warning."""

import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

log = logging.getLogger(__name__)
# The most names that a warning lists.
_SHOWN = 5


def warn_of_still_sequences(labels: Iterable[Iterable[str]]) -> None:
    """Say so if every sequence, given by the labels of its frames ("": none), holds one place throughout."""
    visited = [places for one in labels if (places := {*one} - {""})]
    if visited and all(len(places) == 1 for places in visited):
        log.warning(
            "every test sequence holds one place throughout, which flatters whatever remembers the frames before; "
            "test on sequences that change place"
        )


def warn_of_strange_labels(labels: Iterable[Iterable[str]], known: Sequence[str], expected: bool = False) -> None:
    """Say which labels of some sequences are none of the `known` places, and which of these is called alike.

    `expected`: new places are looked for, so that only what may be a slip of the pen is told.
    """
    counts = Counter(label for one in labels for label in one)
    for label in sorted(counts.keys() - {"", *known}):
        if nearest := get_close_matches(label, known, 1):
            remedy = f"the nearest name is {nearest[0]!r}"
        elif expected:
            continue
        else:
            remedy = f"they know {listed(known)}"
        log.warning("%d test frames are of %r, which the models do not know; %s", counts[label], label, remedy)


def warn_of_training(names: Sequence[str], what: str) -> None:
    """Say that the labelled sequences of these names, if any, trained the words or the models that they test."""
    if names:
        log.warning("%s: trained the %s, and tells nothing of what is new to them; test on others", listed(names), what)


def listed(names: Sequence[str]) -> str:
    """Some names in a row, and how many more there are."""
    more = f" and {len(names) - _SHOWN} more" * (len(names) > _SHOWN)
    return ", ".join(names[:_SHOWN]) + more
