"""The golden runs of the reference tools, to the byte: all in this process, some through the files in bin/.

`golden` is what was planned, `fuzz` what chance found, `scripts` the tools that are scripts.
"""

import subprocess
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path

import pytest
from helpers.srilm_runs import differences, golden_cases, prepare

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.add_ppls import add_ppls
from placerec.srilm.tools.change_lm_vocab import change_lm_vocab
from placerec.srilm.tools.compute_best_mix import compute_best_mix
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.ngram_merge import ngram_merge

BIN = Path(__file__).resolve().parents[2] / "bin"
TOOLS: dict[str, Callable[[Sequence[str], Streams], int]] = {
    "ngram-count": ngram_count,
    "ngram": ngram,
    "ngram-merge": ngram_merge,
    "compute-best-mix": compute_best_mix,
    "change-lm-vocab": change_lm_vocab,
    "add-ppls": add_ppls,
}


@pytest.mark.parametrize(
    ("runs", "tool", "least"),
    [
        ("golden", "ngram-count", 300),
        ("golden", "ngram", 146),
        ("golden", "ngram-merge", 21),
        ("fuzz", "ngram-count", 65),
        ("fuzz", "ngram", 65),
        ("scripts", "compute-best-mix", 6),
        ("scripts", "change-lm-vocab", 6),
        ("scripts", "add-ppls", 2),
    ],
)
def test_golden_runs_are_identical(
    runs: str, tool: str, least: int, shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    golden = shared / "srilm" / runs
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


@pytest.mark.parametrize("tool", ["ngram-count", "ngram", "ngram-merge"])
def test_the_files_in_bin_give_the_same(tool: str, shared: Path, tmp_path: Path) -> None:
    golden = shared / "srilm/golden"
    for case in golden_cases(golden, tool)[::40]:
        folder = tmp_path / case["id"]
        folder.mkdir()
        stdin = prepare(case, golden, folder)
        done = subprocess.run([BIN / tool, *case["args"]], input=stdin, capture_output=True, cwd=folder, check=False)
        err = done.stderr.replace(str(BIN).encode() + b"/", b"")
        assert not differences(case, golden, folder, done.returncode, done.stdout, err), case["id"]
