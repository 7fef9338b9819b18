"""The distinct windows of a text, and how often each occurs: blocks are reduced to sorted runs, and these merged.

A window is `order` words from a position on, packed into as few numbers as hold them; what would lie behind the
sentence's end is 0. Runs are merged whenever those that wait outgrow what is merged already, so that memory holds a
few times the distinct windows, however long the text is, and no window is merged often.
"""

from collections.abc import Sequence
from functools import partial, reduce

import numpy as np

from placerec.ahead import work_ahead
from placerec.arrays import Ints, Mask
from placerec.lm.stored_text import Block, Numbers, StoredText

# Windows that may wait for being merged.
WAITING = 1 << 21
Run = tuple[list[Ints], Numbers]


def distinct_windows(
    text: StoredText, spans: Sequence[range], bits: int, *, renumbered: Ints | None = None, weighted: bool = True
) -> Run:
    """The distinct windows, ascending: a column int64 (m,) of packed words per span, and their counts int64 (m,).

    `spans`: the words of a window that share a number, `bits` bits each. `renumbered`: the number to use for each
    word number of the text. `weighted`: whether a window counts as much as its sentence weighs (an integer), or once.
    """
    runs: list[Run] = []
    reduced = partial(_reduced, spans=spans, bits=bits, renumbered=renumbered, weighted=weighted)
    for run in work_ahead(reduced, text):
        runs.append(run)
        if sum(len(counts) for _, counts in runs[1:]) > max(WAITING, len(runs[0][1])):
            runs = [_merged(runs)]
    return _merged(runs) if runs else ([np.zeros(0, np.int64) for _ in spans], np.zeros(0, np.int64))


def _reduced(block: Block, *, spans: Sequence[range], bits: int, renumbered: Ints | None, weighted: bool) -> Run:
    symbols = (block.ids.astype(np.int64) if renumbered is None else renumbered[block.ids]) + 1
    lengths = block.lengths.astype(np.int64)
    columns = [_packed(symbols, lengths, span, bits) for span in spans]
    if block.weights is None or not weighted:
        return _summed(columns, None)
    return _summed(columns, np.repeat(block.weights, lengths))


def _merged(runs: Sequence[Run]) -> Run:
    if len(runs) == 1:
        return runs[0]
    columns = [np.concatenate(parts) for parts in zip(*(columns for columns, _ in runs), strict=True)]
    return _summed(columns, np.concatenate([counts for _, counts in runs]))


def _summed(columns: list[Ints], counts: Numbers | None) -> Run:
    """The distinct windows, ascending, and the sums of their counts (by default each counts 1)."""
    if counts is None and len(columns) == 1:
        windows = np.sort(columns[0])
        starts = np.flatnonzero(changes(windows))
        return [windows[starts]], np.diff(starts, append=len(windows))
    by_window = np.lexsort(columns[::-1])
    columns = [column[by_window] for column in columns]
    starts = np.flatnonzero(reduce(np.logical_or, map(changes, columns)))
    if counts is None:
        sums = np.diff(starts, append=len(by_window))
    else:
        sums = np.add.reduceat(counts[by_window], starts) if len(starts) else counts
    return [column[starts] for column in columns], sums


def _packed(symbols: Ints, lengths: Ints, span: range, bits: int) -> Ints:
    """The words at these distances from each position, packed (T,)."""
    packed = np.zeros(len(symbols), np.int64)
    ends = np.cumsum(lengths)
    for distance in span:
        packed <<= bits
        packed[: max(0, len(symbols) - distance)] |= symbols[distance:]
    # The last words of each sentence reached into the next one.
    for left in range(1, span.stop):
        at = (ends - left)[lengths >= left]
        shifts = [bits * (span.stop - 1 - distance) for distance in span if distance >= left]
        keep = ~sum(((1 << bits) - 1) << shift for shift in shifts)
        packed[at] &= keep
    return packed


def changes(values: Ints) -> Mask:
    """Where a value differs from the one before, bool (m,); the first one does."""
    changed = np.ones(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=changed[1:])
    return changed
