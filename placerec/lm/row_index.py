"""Where numbers stand in an array: a hash table, for many questions to one array."""

import numpy as np
from numpy.typing import NDArray

from placerec.lm.logs import Ints

_FACTOR = np.uint64(0x9E3779B97F4A7C15)
_SLOTS_PER_KEY = 4


class RowIndex:
    """Finds the places of numbers in `keys`, int64 (m,) >= 0; `distinct`: none of them is there twice."""

    def __init__(self, keys: Ints) -> None:
        self._keys = keys
        bits = max(8, int(_SLOTS_PER_KEY * len(keys)).bit_length())
        self._shift = np.uint64(64 - bits)
        self._slots = np.full(1 << bits, -1, np.int32 if len(keys) < 2**31 else np.int64)
        slot = self._slot(keys)
        # Of several keys for one slot the last is kept; those that lost it go to a table of their own.
        self._slots[slot] = np.arange(len(keys))
        winner = self._slots[slot]
        self._lost = np.flatnonzero(winner != np.arange(len(keys)))
        self._contested = np.zeros(1 << bits, bool)
        self._contested[slot[self._lost]] = True
        self._rest = RowIndex(keys[self._lost]) if len(self._lost) else None
        again = bool((keys[winner[self._lost]] == keys[self._lost]).any())
        self.distinct: bool = not again and (self._rest is None or self._rest.distinct)

    def _slot(self, keys: Ints) -> Ints:
        slot: Ints = (keys.view(np.uint64) * _FACTOR >> self._shift).view(np.int64)
        return slot

    def find(self, wanted: Ints) -> Ints:
        """The place of each of `wanted` int64 (q,), -1 where it is none of the keys; of equal keys one of them."""
        if not len(self._keys):
            return np.full(len(wanted), -1, np.int64)
        slot = self._slot(wanted)
        place: NDArray[np.int64] = self._slots[slot].astype(np.int64)
        missed = np.flatnonzero(self._keys[place] != wanted)
        place[missed] = -1
        if self._rest is not None:
            missed = missed[self._contested[slot[missed]]]
            again = self._rest.find(wanted[missed])
            place[missed] = np.where(again >= 0, self._lost[again], -1)
        return place
