"""Many lines at once: their fields, the numbers of words, and decimal numbers, as one by one."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.srilm.model import arpa_lines
from placerec.srilm.text import fields as fields_module
from placerec.srilm.text.fields import Fields, NameTable, comments, split_lines, with_odd_bytes, without_lines
from placerec.srilm.text.streams import tokens

lines = st.lists(st.text("ab#\t \r\x01\xe9", max_size=8), max_size=6)
names = st.text("abc", min_size=1, max_size=20) | st.sampled_from(["a" * size for size in (8, 16, 63, 64, 65, 80)])


def fields_of(text: str, *, with_comments: bool = True) -> list[list[str]]:
    data = text.encode("latin-1")
    fields, count = split_lines(data)
    if not with_comments:
        fields, count = without_lines(fields, count, comments(fields, count))
    found = [fields.text(i).decode("latin-1") for i in range(len(fields.starts))]
    stops = np.cumsum(count).tolist()
    assert stops[-1:] in ([], [len(found)])
    return [found[start:stop] for start, stop in zip([0, *stops], stops, strict=False)]


@given(lines, st.booleans())
def test_lines_are_split_as_one_by_one(lines: list[str], last_end: bool) -> None:
    text = "\n".join(lines) + ("\n" if last_end else "")
    physical = text.removesuffix("\n").split("\n") if text else []
    assert fields_of(text) == [tokens(line) for line in physical]
    kept = [[] if line.startswith("##") else tokens(line) for line in physical]
    assert fields_of(text, with_comments=False) == kept


def test_a_line_has_no_line_behind_its_end() -> None:
    assert fields_of("a b\nc\n") == fields_of("a b\nc") == [["a", "b"], ["c"]]
    assert fields_of("a  b\n\nc\n") == [["a", "b"], [], ["c"]]
    assert fields_of("") == []


@given(st.lists(names, unique=True), st.lists(names), st.sampled_from([1, 3]))
def test_names_are_found(listed: list[str], asked: list[str], step: int) -> None:
    table = NameTable({name: step * number for number, name in enumerate(listed)})
    data = "".join(f"{name}\n" for name in asked).encode()
    fields, _ = split_lines(data)
    expected = [step * listed.index(name) if name in listed else -1 for name in asked]
    assert table.find(fields, slice(None)).tolist() == expected


def test_names_for_one_slot_are_told_apart() -> None:
    # More names than slots for as few, of all kinds of length, and some with the same first eight bytes.
    sizes = (4, 8, 9, 12, 16, 17, 64, 65)
    listed = [f"{'x' * (size - 4)}{number:04d}" for size in sizes for number in range(3000)]
    table = NameTable({name: number for number, name in enumerate(listed)})
    data = "".join(f"{name}\n{name}x\n" for name in listed).encode()
    fields, _ = split_lines(data)
    found = table.find(fields, slice(None)).reshape(-1, 2)
    assert found[:, 0].tolist() == list(range(len(listed)))
    assert (found[:, 1] == -1).all()


def test_long_names_with_one_mixture_are_told_apart() -> None:
    listed = [f"a_long_name_{number:09d}" for number in range(50)]
    fields, _ = split_lines("".join(f"{name}\n{name}x\n" for name in listed).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fields_module, "_SPREAD", np.zeros(8, np.uint64))
        table = NameTable({name: number for number, name in enumerate(listed)})
        found = table.find(fields, slice(None)).reshape(-1, 2)
    assert found[:, 0].tolist() == list(range(50))
    assert (found[:, 1] == -1).all()


decimals = st.one_of(
    st.floats(-150, 0, width=32).map("{:.7g}".format),
    st.decimals(-200, 0, places=7, allow_nan=False).map(str),
    st.sampled_from(["0", "-0", "-1.", "-1", "-12345678.12345", "-0.000123456789012345", "-1e-05"]),
)


@given(st.lists(decimals, min_size=1), st.sampled_from([0, arpa_lines._FEW]))
def test_decimal_numbers_are_rounded_as_python_rounds_them(texts: list[str], few: int) -> None:
    data = "".join(f"{text}\n" for text in texts).encode()
    fields, _ = split_lines(data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arpa_lines, "_FEW", few)
        values = arpa_lines._numbers(fields, np.arange(len(texts)), most=0.0)
    assert values is not None
    expected = np.array([float(text) for text in texts]).astype(np.float32)
    np.testing.assert_array_equal(values, np.where(expected == -99, -np.inf, expected))


@given(st.lists(st.text("0123456789.-+ex/:", min_size=1, max_size=12), min_size=1))
def test_what_is_taken_for_a_short_decimal_is_one(texts: list[str]) -> None:
    data = "".join(f"{text}\n" for text in texts).encode()
    fields, _ = split_lines(data)
    for decode in (arpa_lines._short_decimals, arpa_lines._decimals):
        values, plain = decode(fields, np.arange(len(texts)))
        for text, value, is_plain in zip(texts, values.tolist(), plain.tolist(), strict=True):
            assert not is_plain or (value == float(text) and set(text) <= set("0123456789.-"))


def test_fields_near_the_end_can_be_packed() -> None:
    for text in (b"a\n", b"a bc\n", b"abcdefgh\n", b"abcdefghijklmnop\n"):
        fields = Fields(text, np.array([0]), np.array([len(text) - 1]))
        low, high = fields.packed(np.array([0]), 2)
        assert (low.tobytes() + high.tobytes()).rstrip(b"\0") == text[:-1]


@pytest.mark.parametrize("data", [b"a\0b", b"a\v", b"\f"])
def test_odd_bytes_are_found(data: bytes) -> None:
    assert with_odd_bytes(data)
    assert not with_odd_bytes(b"a # b\r\n## \t\xff")
