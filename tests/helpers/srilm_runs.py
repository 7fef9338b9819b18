"""Runs of SRILM's tools in this process, and golden ones: their inputs, and what a run did otherwise."""

import gzip
import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.run import function_of

Case = dict[str, Any]


def run_tool(tool: str, arguments: Sequence[str], stdin: bytes = b"") -> tuple[int, bytes, bytes]:
    """The status, output and messages of a tool."""
    streams = Streams(BytesIO(stdin), out := BytesIO(), err := BytesIO())
    status = function_of(tool)(arguments, streams)
    return status, out.getvalue(), err.getvalue()


def call(tool: str, *arguments: str, stdin: bytes = b"") -> tuple[int, str, str]:
    """`run_tool` with text for output and messages."""
    status, out, err = run_tool(tool, arguments, stdin)
    return status, out.decode("latin-1"), err.decode("latin-1")


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
    # The order of a gawk array is nobody's promise.
    by_line = "awk-order" in case.get("tags", [])
    for name in case.get("outputs", []):
        pair = (folder / name).read_bytes(), stored(golden, f"expected/{case['id']}/{name}")
        written, expected = map(gzip.decompress if name.endswith(".gz") else bytes, pair)
        same = sorted(written.split(b"\n")) == sorted(expected.split(b"\n")) if by_line else written == expected
        wrong += [] if same else [name]
    return wrong + [name for name in case.get("absent_outputs", []) if (folder / name).exists()]
