"""Where numbers stand in an array: a hash table, for many questions to one array."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints

_FACTOR = np.uint64(0x9E3779B97F4A7C15)
_INVERSE = np.uint64(pow(int(_FACTOR), -1, 1 << 64))
# Slots for each key, up to so many bits: where that is still in a cache, more room leaves fewer keys to one slot.
_ROOM = (2, 64), (4, 19), (32, 15)
# Keys that are put in, or looked up, at once: what is computed on the way stays in the processor's cache.
_PART = 1 << 15


class RowIndex:
    """Finds the places of numbers in `keys`, int64 (m,); `distinct`: none of them is there twice.

    A number's hash is the number times an odd factor, so that no two have the same. Its high bits are the number of a
    slot; there, the others are kept above the place of the key: one look is enough to find and to compare.
    """

    def __init__(self, keys: Ints) -> None:
        self._size = len(keys)
        bits = max(8, *(min((slots * self._size).bit_length(), most) for slots, most in _ROOM))
        self._shift, self._width = np.uint64(64 - bits), np.uint64(bits)
        # A free slot holds a place that there is not.
        self._slots = np.full(1 << bits, (1 << bits) - 1, np.uint64)
        parts = [slice(start, min(start + _PART, self._size)) for start in range(0, self._size, _PART)]
        for part in parts:
            slot, above = self._hashed(keys[part])
            self._slots[slot] = above | _places(part)
        # Of several keys for one slot the last is kept; the others, but for its equals, go to a table of their own.
        lost, others = [np.zeros(0, np.int64)], 0
        self._contested = np.zeros(1 << bits, bool)
        for part in parts:
            slot, above = self._hashed(keys[part])
            kept = self._slots[slot] ^ above
            others += int(np.count_nonzero(kept != _places(part)))
            its = np.flatnonzero(kept >= self._size)
            self._contested[slot[its]] = True
            lost.append(its + part.start)
        self._lost = np.concatenate(lost)
        self._rest = RowIndex(keys[self._lost]) if len(self._lost) else None
        self.distinct: bool = others == len(self._lost)
        self.distinct &= self._rest is None or self._rest.distinct

    def _hashed(self, keys: Ints) -> tuple[Ints, NDArray[np.uint64]]:
        mixed = keys.view(np.uint64) * _FACTOR
        slot = (mixed >> self._shift).view(np.int64)
        mixed <<= self._width
        return slot, mixed

    def find(self, wanted: Ints) -> Ints:
        """The place of each of `wanted` int64 (q,), -1 where it is none of the keys; of equal keys one of them."""
        if len(wanted) <= 4 * _PART:
            return self._find(wanted)
        found = np.empty(len(wanted), np.int64)
        for start in range(0, len(found), _PART):
            found[start : start + _PART] = self._find(wanted[start : start + _PART])
        return found

    def _find(self, wanted: Ints) -> Ints:
        slot, place = self._hashed(wanted)
        # No slot is out of range: nothing to check, nothing to wrap.
        place ^= self._slots.take(slot, mode="wrap")
        missed = (place >= self._size).nonzero()[0]
        found = place.view(np.int64)
        found[missed] = -1
        if self._rest is not None and len(missed := missed[self._contested[slot[missed]]]):
            again = self._rest.find(wanted[missed])
            found[missed] = np.where(again >= 0, self._lost[again], -1)
        return found

    def finder(self) -> Callable[[int], int]:
        """A function that finds the place of one number >= 0 at a time, sooner than arrays of one are made."""
        slots, size, shift, width = self._slots.data, self._size, int(self._shift), int(self._width)
        factor, bits, contested, lost = int(_FACTOR), (1 << 64) - 1, self._contested.data, self._lost.data
        find_lost = None if self._rest is None else self._rest.finder()

        def find(wanted: int) -> int:
            mixed = wanted * factor & bits
            slot = mixed >> shift
            place: int = slots[slot] ^ (mixed << width & bits)
            if place < size:
                return place
            if find_lost is not None and contested[slot] and (again := find_lost(wanted)) >= 0:
                return lost[again]
            return -1

        return find

    def keys(self) -> Ints:
        """The numbers again, int64 (m,), if they are `distinct`: the slots hold all of each, so that none is stored."""
        keys = np.empty(self._size, np.int64)
        place = self._slots & ((np.uint64(1) << self._width) - np.uint64(1))
        slot = np.flatnonzero(place < self._size)
        mixed = slot.view(np.uint64) << self._shift | self._slots[slot] >> self._width
        keys[place[slot].view(np.int64)] = (mixed * _INVERSE).view(np.int64)
        if self._rest is not None:
            keys[self._lost] = self._rest.keys()
        return keys


def _places(part: slice) -> NDArray[np.uint64]:
    return np.arange(part.start, part.stop).view(np.uint64)
