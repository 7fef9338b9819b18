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


def test_counts_end_at_the_largest_number() -> None:
    largest = 2**63 - 1
    assert run("a\t" + "1" * 5000 + "\n", "-write", "-")[1] == f"a\t{largest}\n"
    _, out, _ = run(f"a b\t{10**30}\n", "-recompute", "-sort", "-write", "-")
    assert out == f"a\t{2**63 - 1024}\na b\t{largest}\n"


@pytest.mark.parametrize("method", [["-wbdiscount"], ["-addsmooth", "1"], ["-cdiscount", "0.5", "-interpolate"]])
def test_infinite_counts_make_a_model_of_some_kind(method: list[str], tmp_path: Path) -> None:
    status, _, _ = run("a 1e400\na b inf\nb 1\n", "-float-counts", *method, "-lm", str(tmp_path / "lm"))
    assert status == 0
    assert (tmp_path / "lm").read_text().startswith("\n\\data\\\nngram 1=")
