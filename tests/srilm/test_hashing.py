"""The order of SRILM's hash tables: section 15's numbers, a plain twin, and unsorted counts of the golden cases."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.lm.counts import count_text
from placerec.lm.stored_text import StoredText
from placerec.srilm.order.counts import FirstSeen
from placerec.srilm.order.hashing import capacities, needed, table_order
from placerec.srilm.text.streams import tokens
from placerec.srilm.text.vocabulary import WordList

UNSORTED = ("nc-out-unsorted", "nc-out-unsorted2", "nc-out-unsorted3")


def plain_order(keys: list[int], size_hint: int = 0) -> list[int]:
    """The table filled entry by entry, as section 15 tells it."""

    def need(entries: int) -> int:
        return entries if entries < 8 else int(np.float32(entries + 1) / np.float32(0.8))

    def fill(places: list[int], capacity: int) -> list[int | None]:
        slots: list[int | None] = [None] * capacity
        for count, place in enumerate(places):
            bits = capacity.bit_length() - 1
            slot = count if capacity < 8 else ((keys[place] * 1103515245 + 12345) % 2**64 >> (30 - bits)) % capacity
            while slots[slot] is not None:
                slot = (slot + 1) % capacity
            slots[slot] = place
        return slots

    capacity = 1
    while capacity < need(size_hint):
        capacity *= 2
    slots: list[int | None] = [None] * capacity
    for place in range(len(keys)):
        held = [entry for entry in slots if entry is not None]
        if need(place + 1) > capacity:
            while need(place + 1) > capacity:
                capacity *= 2
            slots = fill([*fill_order(slots), place], capacity)
        elif capacity < 8:
            slots = fill([*held, place], capacity)
        else:
            slots = insert(slots, place, keys[place])
    return fill_order(slots)


def fill_order(slots: list[int | None]) -> list[int]:
    return [entry for entry in slots if entry is not None]


def insert(slots: list[int | None], place: int, key: int) -> list[int | None]:
    bits = len(slots).bit_length() - 1
    slot = ((key * 1103515245 + 12345) % 2**64 >> (30 - bits)) % len(slots)
    while slots[slot] is not None:
        slot = (slot + 1) % len(slots)
    slots[slot] = place
    return slots


def in_one_table(keys: list[int], size_hint: int = 0) -> list[int]:
    order = table_order(np.zeros(len(keys), np.int64), np.array(keys, np.uint64), size_hint=size_hint)
    return [int(place) for place in order]


def test_capacities_are_those_of_section_15() -> None:
    entries = np.arange(1, 14)
    assert capacities(entries).tolist() == [1, 2, 4, 4, 8, 8, 8, 16, 16, 16, 16, 16, 32]
    assert needed(np.array([0, 7, 8, 12, 13])).tolist() == [0, 7, 11, 16, 17]


def test_small_tables_keep_the_order_of_insertion() -> None:
    assert in_one_table([9, 3, 7, 1]) == [0, 1, 2, 3]


@settings(max_examples=150, deadline=None)
@given(st.lists(st.integers(0, 400), unique=True, max_size=150), st.sampled_from([0, 3, 5, 40, 300]))
def test_all_at_once_equals_entry_by_entry(keys: list[int], size_hint: int) -> None:
    assert in_one_table(keys, size_hint) == plain_order(keys, size_hint)


def test_a_large_table_equals_entry_by_entry() -> None:
    keys = np.random.default_rng(0).permutation(5000).tolist()
    assert in_one_table(keys) == plain_order(keys)


def text_of(path: Path, words: WordList) -> StoredText:
    """A text as SRILM's word numbers, in sentences between <s> and </s>."""
    text = StoredText()
    for line in path.read_text("latin-1").split("\n"):
        if found := tokens(line):
            numbers = [words.add(word) for word in ["<s>", *found, "</s>"]]
            text.add(np.array(numbers), np.array([len(numbers)]))
    return text


@pytest.mark.parametrize("case_id", UNSORTED)
def test_unsorted_counts_come_in_the_order_of_srilm(case_id: str, shared: Path) -> None:
    golden = shared / "srilm/golden"
    lines = (golden / "cases.jsonl").read_text().splitlines()
    case = next(case for case in map(json.loads, lines) if case["id"] == case_id)
    order = int(case["args"][case["args"].index("-order") + 1])
    folder = golden / "expected" / case_id
    name = "x.counts" if case["outputs"] else "stdout"
    packed = folder / f"{name}.gz"
    expected = gzip.decompress(packed.read_bytes()) if packed.exists() else (folder / name).read_bytes()

    words = WordList()
    text = text_of(golden / case["inputs"][0], words)
    vocabulary, sorted_number = words.sorted()
    counts = count_text(text, order, vocabulary, renumbered=sorted_number)
    assert FirstSeen([], text, words).format(counts).encode("latin-1") == expected


def test_a_walk_of_nothing_is_empty() -> None:
    words = WordList()
    counts = count_text(StoredText(), 3, words.sorted()[0])
    assert FirstSeen([], StoredText(), words).format(counts) == ""
