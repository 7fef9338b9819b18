"""The 467 golden runs of the reference tools, to the byte: all in this process, some through the files in bin/."""

import subprocess
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path

import pytest
from helpers.srilm_runs import differences, golden_cases, prepare

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.ngram_merge import ngram_merge

BIN = Path(__file__).resolve().parents[2] / "bin"
TOOLS: dict[str, Callable[[Sequence[str], Streams], int]] = {
    "ngram-count": ngram_count,
    "ngram": ngram,
    "ngram-merge": ngram_merge,
}


@pytest.mark.parametrize(("tool", "least"), [("ngram-count", 300), ("ngram", 146), ("ngram-merge", 21)])
def test_golden_runs_are_identical(
    tool: str, least: int, shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    golden = shared / "srilm/golden"
    cases = golden_cases(golden, tool)
    assert len(cases) >= least
    wrong = {}
    for case in cases:
        folder = tmp_path / case["id"]
        folder.mkdir()
        monkeypatch.chdir(folder)
        stdin = prepare(case, golden, folder)
        out, err = BytesIO(), BytesIO()
        status = TOOLS[tool](case["args"], Streams(BytesIO(stdin), out, err))
        if found := differences(case, golden, folder, status, out.getvalue(), err.getvalue()):
            wrong[case["id"]] = found
    assert not wrong


@pytest.mark.parametrize("tool", TOOLS)
def test_the_files_in_bin_give_the_same(tool: str, shared: Path, tmp_path: Path) -> None:
    golden = shared / "srilm/golden"
    for case in golden_cases(golden, tool)[::40]:
        folder = tmp_path / case["id"]
        folder.mkdir()
        stdin = prepare(case, golden, folder)
        done = subprocess.run([BIN / tool, *case["args"]], input=stdin, capture_output=True, cwd=folder, check=False)
        err = done.stderr.replace(str(BIN).encode() + b"/", b"")
        assert not differences(case, golden, folder, done.returncode, done.stdout, err), case["id"]
