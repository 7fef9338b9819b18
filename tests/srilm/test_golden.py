"""The 467 golden runs of the reference tools, to the byte: all in this process, some through the files in bin/."""

import gzip
import json
import subprocess
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest

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
Case = dict[str, Any]


def golden_cases(golden: Path, tool: str) -> list[Case]:
    cases = [json.loads(line) for line in (golden / "cases.jsonl").read_text().splitlines()]
    return [case for case in cases if case["tool"] == tool]


def stored(folder: Path, name: str) -> bytes:
    path = folder / name
    return path.read_bytes() if path.exists() else gzip.decompress(path.with_name(path.name + ".gz").read_bytes())


def prepare(case: Case, golden: Path, folder: Path) -> bytes:
    """Lay out the inputs of a case in an empty folder; its standard input."""
    for name in case["inputs"]:
        (folder / Path(name).name).write_bytes(stored(golden, name))
    return stored(golden, case["stdin_file"]) if case.get("stdin_file") else b""


def differences(case: Case, golden: Path, folder: Path, status: int, out: bytes, err: bytes) -> list[str]:
    """What a run in `folder` did otherwise than the golden one."""
    wrong = [] if status == case["exit"] else [f"exit {status}"]
    wrong += [] if out == stored(golden, case["stdout_file"]) else ["stdout"]
    wrong += [] if err == stored(golden, case["stderr_file"]) else ["stderr"]
    for name in case.get("outputs", []):
        written, expected = (folder / name).read_bytes(), stored(golden, f"expected/{case['id']}/{name}")
        unpack = gzip.decompress if name.endswith(".gz") else bytes
        wrong += [] if unpack(written) == unpack(expected) else [name]
    return wrong + [name for name in case.get("absent_outputs", []) if (folder / name).exists()]


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
