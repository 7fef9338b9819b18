"""Counts that are too large to be counted on: they end neither in a traceback nor in a warning of numpy's."""

from io import BytesIO
from pathlib import Path

import pytest

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram_count import ngram_count


def run(counts: str, *arguments: str) -> tuple[int, str, str]:
    out, err = BytesIO(), BytesIO()
    status = ngram_count(["-read", "-", *arguments], Streams(BytesIO(counts.encode()), out, err))
    return status, out.getvalue().decode(), err.getvalue().decode()


def test_counts_beyond_the_largest_number_end_in_a_message() -> None:
    for count in ("1" * 5000, str(2**63)):
        assert run(f"a\t{count}\n", "-write", "-") == (
            1,
            "",
            f"the count {count} is above {2**63 - 1}, the most that can be counted; divide the counts, or use"
            " -float-counts\n",
        )
    status, out, err = run(f"a\t{2**63 - 1}\na\t{2**63 - 1}\na\t5\n", "-write", "-")
    assert (status, out, err[:25]) == (1, "", "a sum of counts is above ")
    assert run(f"a\t{2**62}\na\t{2**62 - 1}\nb\t{2**63 - 1}\n")[1] == f"a\t{2**63 - 1}\nb\t{2**63 - 1}\n"


def test_counts_end_at_the_largest_number() -> None:
    largest = 2**63 - 1
    _, out, _ = run(f"a b\t{largest}\n", "-recompute", "-sort", "-write", "-")
    assert out == f"a\t{2**63 - 1024}\na b\t{largest}\n"


@pytest.mark.parametrize("method", [["-wbdiscount"], ["-addsmooth", "1"], ["-cdiscount", "0.5", "-interpolate"]])
def test_infinite_counts_make_a_model_of_some_kind(method: list[str], tmp_path: Path) -> None:
    status, _, _ = run("a 1e400\na b inf\nb 1\n", "-float-counts", *method, "-lm", str(tmp_path / "lm"))
    assert status == 0
    assert (tmp_path / "lm").read_text().startswith("\n\\data\\\nngram 1=")
