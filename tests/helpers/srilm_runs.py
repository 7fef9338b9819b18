"""Golden runs of the reference tools: their inputs, and what a run did otherwise."""

import gzip
import json
from pathlib import Path
from typing import Any

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
