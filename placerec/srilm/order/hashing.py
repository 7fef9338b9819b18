"""The order in which SRILM's hash tables give back what was put in: section 15 of our SRILM specification.

A table of 2^b slots: an entry takes the slot that its key hashes to, or the next free one (wrapping). Before it gets
too full a table is replaced by a larger one, into which the old slots go in their order. Tables of fewer than 8 slots
keep the order of insertion. Iteration is by slot.

All tables of a walk are filled at once: entries that come one after the other to slots in search of the first free
one end up where they would if all asked at once, each slot kept its earliest claimant, and the others asked the next.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask
from placerec.lm.trie import Trie

_SMALL = 8


def needed(entries: Ints) -> Ints:
    """The least slots of tables for so many `entries` each, int64."""
    single = np.float32(0.8)
    return np.where(entries < _SMALL, entries, ((entries + 1).astype(np.float32) / single).astype(np.int64))


def capacities(entries: Ints) -> Ints:
    """The slots of tables that are made for so many `entries` each: powers of two, int64."""
    return 1 << np.ceil(np.log2(np.maximum(needed(entries), 1))).astype(np.int64)


def table_order(table: Ints, keys: NDArray[np.uint64], *, size_hint: int = 0) -> Ints:
    """The entries of several tables in the order in which these give them back, table after table: places int64 (E,).

    `table` int64 (E,), ascending from 0: the table of each entry; `keys` uint64 (E,). The entries of a table come in
    order of insertion. `size_hint`: the number of entries that each table was created for (0: created empty).
    """
    order = np.arange(len(table))
    size = np.bincount(table) if len(table) else np.zeros(0, np.int64)
    final = np.maximum(capacities(size), capacities(np.array(size_hint)) if size_hint else 1)
    capacity = max(_SMALL, int(capacities(np.array(size_hint))))
    while (growing := final >= capacity).any():
        # The entries that go into the tables of this capacity: all that these hold before they grow once more.
        most = _entries_at_most(capacity)
        begin = np.cumsum(size) - size
        entries = _ranges(begin[growing], np.minimum(size[growing], most))
        order[entries] = order[entries][_fill(table[entries], keys[order[entries]], capacity)]
        capacity *= 2
    return order


def name_order(names: Sequence[str]) -> Ints:
    """The places int64 (N,) of names (Latin-1), put in one after the other, in the order of SRILM's vocabulary."""
    keys = []
    for name in names:
        key = 0
        for byte in name.encode("latin-1"):
            key = (9 * key + (byte if byte < 128 else byte - 256)) % 2**64
        keys.append(key)
    return table_order(np.zeros(len(keys), np.int64), np.array(keys, np.uint64))


def _entries_at_most(capacity: int) -> int:
    """How many entries a table of this capacity takes before it grows."""
    entries = int(capacity * 0.8) + 2
    while int(needed(np.array(entries))) > capacity:
        entries -= 1
    return entries


def _ranges(starts: Ints, lengths: Ints) -> Ints:
    """The numbers starts[0], starts[0]+1, ... (lengths[0] of them), starts[1], ..., int64."""
    return np.repeat(starts - (np.cumsum(lengths) - lengths), lengths) + np.arange(int(lengths.sum()))


def _fill(table: Ints, keys: NDArray[np.uint64], capacity: int) -> Ints:
    """Put entries into empty tables of `capacity` slots; their places in slot order, table after table."""
    bits = capacity.bit_length() - 1
    hashed = (keys * np.uint64(1103515245) + np.uint64(12345)) >> np.uint64(30 - bits)
    slot = (hashed % np.uint64(capacity)).astype(np.int64)
    number = np.cumsum(np.diff(table, prepend=table[:1]) > 0)
    base = number * capacity
    free = len(table)
    holder = np.full((int(number[-1]) + 1) * capacity, free, np.int64)
    asking = np.arange(len(table))
    while len(asking):
        wanted = base[asking] + slot[asking]
        before = holder[wanted]
        # Of several values for one slot the last is kept: asking is ascending, so reversed, the earliest.
        holder[wanted[::-1]] = np.minimum(asking, before)[::-1]
        after = holder[wanted]
        displaced = before[(after == asking) & (before < free)]
        asking = np.sort(np.concatenate([asking[after != asking], displaced]))
        slot[asking] = (slot[asking] + 1) % capacity
    return holder[holder < free]


def walk_order(trie: Trie, seen: Sequence[Mask], first: Sequence[Ints], numbers: Ints) -> tuple[Ints, Ints]:
    """The n-grams of a count trie as SRILM walks it, each before its extensions: orders and rows, int64 (M,).

    `seen`, bool (m_n,) per order: which rows are there (their prefixes must be). `first`, int64 (m_n,) per order: when
    a row was put in, comparable among the rows of one prefix. `numbers` int64 (V,): SRILM's number of each word.
    """
    rows = [np.flatnonzero(there) for there in seen]
    parents = [
        trie.prefix(n)[rows[n - 1]] if n > 1 else np.zeros(len(rows[0]), np.int64) for n in range(1, len(seen) + 1)
    ]
    # How many n-grams start with each row, itself included.
    below = [np.ones(len(there), np.int64) for there in seen]
    for n in range(len(seen), 1, -1):
        counted = np.bincount(parents[n - 1], weights=below[n - 1][rows[n - 1]], minlength=len(below[n - 2]))
        below[n - 2] += counted.astype(np.int64)
    orders, walked = np.empty(sum(map(len, rows)), np.int64), np.empty(sum(map(len, rows)), np.int64)
    behind = np.zeros(1, np.int64)
    for n in range(1, len(seen) + 1):
        by_first = np.lexsort((first[n - 1][rows[n - 1]], parents[n - 1]))
        parent = parents[n - 1][by_first]
        starts = np.diff(parent, prepend=-1) > 0
        keys = numbers[trie.word(n)[rows[n - 1]]].astype(np.uint64)
        ordered = by_first[table_order(np.cumsum(starts) - 1, keys[by_first])]
        row = rows[n - 1][ordered]
        size = below[n - 1][row]
        before = np.cumsum(size) - size
        at_start = before[starts][np.cumsum(starts) - 1]
        place = behind[parent] + before - at_start
        orders[place], walked[place] = n, row
        behind = np.empty(len(seen[n - 1]), np.int64)
        behind[row] = place + 1
    return orders, walked
