"""Counts files as arrays: many lines at once give what lines one by one give, and sums are exact."""

from io import BytesIO
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.srilm.text.counts_file import count_lines
from placerec.srilm.text.counts_table import Table, read_counts, tabled
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList

_WORDS = st.sampled_from(["a", "b", "C", "longer-than-eight", "\xe9", "<s>", "#"])
_COUNTS = st.sampled_from(["0", "7", "007", "12345678", "123456789", "999999999999999999"])
_PLAIN = st.tuples(st.lists(_WORDS, min_size=1, max_size=4), _COUNTS).map(
    lambda line: f"{' '.join(line[0])}\t{line[1]}"
)
_ODD = st.sampled_from(
    ["", "## a 1", "a  b 3", "a 1.9", "a\t+3", "a\r\t3", "a\0b\t3", "a", "a x", "a b\t9223372036854775807"]
)
_LINES = st.lists(st.one_of(_PLAIN, _PLAIN, _PLAIN, _ODD), max_size=30)


def _streams() -> Streams:
    return Streams(BytesIO(), BytesIO(), BytesIO())


def _rows(table: Table) -> list[tuple[int, list[int], float]]:
    columns = zip(table.ngrams, table.counts, table.places, strict=True)
    rows = [row for its in columns for row in zip(*(column.tolist() for column in its), strict=True)]
    return sorted((place, ngram, count) for ngram, count, place in rows)


@settings(max_examples=200, deadline=None)
@given(_LINES, st.integers(0, 5), st.booleans(), st.booleans(), st.booleans())
def test_many_lines_at_once_give_what_lines_one_by_one_give(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str], order: int, lower: bool, closed: bool, fractional: bool
) -> None:
    path = tmp_path_factory.mktemp("counts") / "counts"
    path.write_text("\n".join(lines), "latin-1")
    found = []
    for quick in (True, False):
        words, streams = WordList(lower=lower), _streams()
        words.closed = closed
        words.add("b")
        if quick:
            with patch("placerec.srilm.text.counts_table._BLOCK", 40):
                table = read_counts(str(path), order, words, streams, fractional=fractional)
        else:
            one_by_one = count_lines(str(path), fractional, streams)
            table = tabled(one_by_one, order, words, fractional=fractional)
        said = streams.stderr.getvalue() if isinstance(streams.stderr, BytesIO) else b""
        found.append((_rows(table), words.words, words.missed, said))
    # Places of n-grams that are too long are free here, and taken there.
    (quick_rows, *quick_rest), (rows, *rest) = found
    assert [row[1:] for row in quick_rows] == [row[1:] for row in rows]
    assert quick_rest == rest


def test_real_counts_are_the_nearest_ones(tmp_path: Path) -> None:
    (tmp_path / "counts").write_text("a\t0.12345678901234567\na b\t3.\n")
    table = read_counts(str(tmp_path / "counts"), 2, WordList(), _streams(), fractional=True)
    assert [count.tolist() for count in table.counts] == [[0.12345678901234567], [3.0]]


def test_the_total_is_exact_where_int64_ends() -> None:
    table = Table([np.zeros((3, 1), np.int64)], [np.full(3, 2**63 - 1)], [np.arange(3)])
    assert table.total == 3 * (2**63 - 1)
