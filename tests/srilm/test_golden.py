"""The golden runs of the reference tools, to the byte: all in this process, some through the files in bin/.

`golden` is what was planned, `fuzz` what chance found, `scripts` the tools that are scripts, `tools/golden` has count
models, classes and hidden words.
"""

import subprocess
from pathlib import Path

import pytest
from helpers.srilm_runs import differences, golden_cases, prepare, run_tool

BIN = Path(__file__).resolve().parents[2] / "bin"


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
        ("tools/golden", "disambig", 32),
        ("tools/golden", "hidden-ngram", 24),
        ("tools/golden", "ngram", 23),
        ("tools/golden", "ngram-class", 18),
        ("tools/golden", "ngram-count", 8),
        ("tools/golden", "replace-words-with-classes", 5),
        ("tools/golden", "uniform-classes", 2),
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
        if found := differences(case, golden, folder, *run_tool(tool, case["args"], stdin)):
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
