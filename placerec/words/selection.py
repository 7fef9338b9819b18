"""Word selection: which words of a stream are counted and filtered (paper section 2.3, readings A15 to A22).

The same rule serves a whole stream (`select`) and one word at a time (`selector`), with the same result.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from placerec.arrays import Mask
from placerec.errors import StreamError, refuse_string


@dataclass(frozen=True)
class Selection:
    """A rule: `none`, `subsample` one word of every `step`, `compress` runs by `step`, `unique` (one word a run)."""

    kind: str = "none"
    step: int = 1

    def __str__(self) -> str:
        return f"{self.kind}:{self.step}" if self.kind in ("subsample", "compress") else self.kind


def parse_selection(text: str) -> Selection:
    """The rule that `none`, `subsample:S`, `compress:M` or `unique` names; StreamError for anything else."""
    kind, _, step = text.partition(":")
    if kind in ("subsample", "compress") and step.isascii() and step.isdigit() and int(step) > 0:
        return Selection(kind, int(step))
    if text in ("none", "unique"):
        return Selection(text)
    raise StreamError(
        f"selection {text!r} is unknown; give none, unique, subsample:S or compress:M with a number above 0"
    )


def select(words: Sequence[str], selection: Selection) -> Mask:
    """Which of T consecutive words of one sequence are kept, bool (T,).

    `subsample`: positions 0, S, 2S... `unique`: the first word of every run of equal words. `compress`: of a run of L
    equal words the 1st, (M+1)th, (2M+1)th...: ceil(L/M) words (readings A20, `first`). StreamError for a string.
    """
    refuse_string(words, StreamError)
    position = np.arange(len(words))
    kept: Mask
    if selection.kind == "none":
        return np.ones(len(words), bool)
    if selection.kind == "subsample":
        kept = position % selection.step == 0
        return kept
    new_run = np.array([i == 0 or word != words[i - 1] for i, word in enumerate(words)], bool)
    if selection.kind == "unique":
        return new_run
    run_start = np.maximum.accumulate(np.where(new_run, position, 0))
    kept = (position - run_start) % selection.step == 0
    return kept


def selector(selection: Selection) -> Callable[[str], bool]:
    """A function to be asked for each word of one sequence in turn: is it kept? Constant memory."""
    seen, in_run, last = 0, 0, None

    def keep(word: str) -> bool:
        nonlocal seen, in_run, last
        in_run = in_run + 1 if word == last else 0
        last = word
        seen += 1
        match selection.kind:
            case "subsample":
                return (seen - 1) % selection.step == 0
            case "unique":
                return in_run == 0
            case "compress":
                return in_run % selection.step == 0
        return True

    return keep
