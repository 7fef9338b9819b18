"""The bytes of ARPA lines: numbers as printf prints them, and the same lines from both ways of making them."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from placerec.arrays import Singles
from placerec.lm import arpa_text
from placerec.lm.arpa import format_arpa, read_arpa
from placerec.lm.arpa_text import PackedLines, PlainLines, first_lines, number_cells
from placerec.lm.backoff import BackoffModel
from placerec.lm.trie import Trie
from placerec.lm.vocabulary import Vocabulary

SINGLES = st.floats(width=32, allow_nan=False)
NEAR = [np.nextafter(np.float32(10.0**e), np.float32(way)) for e in range(-6, 8) for way in (0, 10.0**e, np.inf)]


def _printed(values: Singles) -> list[str]:
    cells = np.empty((len(values), 2), np.uint64)
    number_cells(values, "\n", cells)
    return cells.tobytes().replace(b"\0", b"").decode().split("\n")[1:]


def _expected(values: Singles) -> list[str]:
    return ["%.7g" % (-99 if value == -np.inf else value) for value in values.tolist()]


@given(st.lists(SINGLES, max_size=20))
def test_any_number_is_printed_as_printf_does(values: list[float]) -> None:
    numbers = np.array(values, np.float32)
    assert _printed(numbers) == _expected(numbers)


@given(st.lists(st.floats(-128, 128, width=32), min_size=1, max_size=20))
def test_usual_numbers_are_printed_as_printf_does(values: list[float]) -> None:
    numbers = np.array(values, np.float32)
    assert _printed(numbers) == _expected(numbers)


def test_many_random_numbers() -> None:
    rng = np.random.default_rng(1)
    # Few bits behind the point make exact ties in the seventh digit.
    ties = rng.integers(0, 1 << 24, 100_000) / 2.0 ** rng.integers(0, 40, 100_000)
    scales = rng.choice([-1, 1], 100_000) * 10 ** rng.uniform(-8, 8, 100_000)
    numbers = np.concatenate([-8 * rng.random(200_000), ties, scales, np.array(NEAR)]).astype(np.float32)
    assert _printed(numbers) == _expected(numbers)


def test_powers_of_ten_zeros_and_log_zero() -> None:
    numbers = np.array([0, -0.0, 1, -1, 10, 0.1, 1e-4, 1e-5, 99, -99, 100, np.inf, -np.inf, 99.5, 99.49999], np.float32)
    expected = "0 -0 1 -1 10 0.1 0.0001 1e-05 99 -99 100 inf -99 99.5 99.49999"
    assert " ".join(_printed(numbers)) == expected == " ".join(_expected(numbers))


def _model(rng: np.random.Generator, words: list[str]) -> BackoffModel:
    vocabulary = Vocabulary.of(words)
    keys = [np.arange(len(vocabulary))]
    for _ in range(3):
        every = len(keys[-1]) * len(vocabulary)
        keys.append(np.sort(rng.choice(every, min(every, 60_000), replace=False)))
    log10_probs = tuple((-8 * rng.random(len(key))).astype(np.float32) for key in keys)
    backoffs = tuple(rng.normal(size=len(key)).astype(np.float32) for key in keys)
    for backoff in backoffs:
        backoff[rng.random(len(backoff)) < 0.3] = np.nan
    backoffs[-1][:] = np.nan
    return BackoffModel(Trie(vocabulary, tuple(keys)), log10_probs, backoffs)


@pytest.mark.parametrize(
    "words", [["<s>", "</s>", "ä", "漢字", "x" * 7], [f"v{i}" for i in range(300)], ["y" * 31, "z"]]
)
def test_both_ways_give_the_same_file(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    model = _model(np.random.default_rng(len(words)), words)
    assert isinstance(first_lines(model.words, "utf-8"), PackedLines)
    packed = format_arpa(model)
    monkeypatch.setattr(arpa_text, "_WIDEST", 0)
    assert isinstance(first_lines(model.words, "utf-8"), PlainLines)
    assert format_arpa(model) == packed


def test_a_big_file_reads_as_the_model(tmp_path_factory: pytest.TempPathFactory) -> None:
    model = _model(np.random.default_rng(0), [f"v{i}" for i in range(300)])
    path = tmp_path_factory.mktemp("arpa") / "model.arpa"
    path.write_text(format_arpa(model), encoding="utf-8")
    again = read_arpa(path)
    assert all(np.array_equal(a, b) for a, b in zip(again.trie.keys, model.trie.keys, strict=True))
    for a, b in zip(again.log10_probs, model.log10_probs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)


@pytest.mark.parametrize("word", ["w" * 40, "a\0b"])
def test_long_words_and_nuls_are_written_plainly(word: str) -> None:
    lines = first_lines([word, "b"], "latin-1")
    assert isinstance(lines, PlainLines)
    place = np.zeros(1, np.int64)
    number = np.array([-1.5], np.float32)
    written = b"".join(lines.blocks(number, number, np.zeros(1, bool), place, place))
    assert written == f"\n-1.5\t{word}".encode()
