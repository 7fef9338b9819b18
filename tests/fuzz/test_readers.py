"""A few hundred damaged files for each reader; readers.py beside this goes on for as long as one likes."""

import logging
from pathlib import Path

import mutations
import numpy as np
import pytest
import readers
from harness import Reader, same

from placerec.errors import LanguageModelError

CASES = {"text": 60, "counts": 100, "arpa": 250, "arpa-strict": 400, "count-model": 150, "scored": 150}
# Of the other readers.
FEW = 80


@pytest.mark.parametrize("kind", readers.READERS)
def test_damaged_files_are_read_or_refused(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)
    cases = CASES.get(kind, FEW)
    found = readers.fuzz(kind, 1, cases=cases)
    assert list(found) == [""], "\n".join(found.values())
    assert found[""] == f"{kind}: {cases} inputs, 0 findings"


def _bad_check(path: Path, _: object) -> None:
    if b"\0" in path.read_bytes():
        raise KeyError("NUL")
    if b"\r" in path.read_bytes():
        same("results", 1, 2)
    if b"\v" in path.read_bytes():
        np.float32(1) / np.float32(0)
    if b"x" in path.read_bytes():
        raise LanguageModelError("one of placerec's own")


def test_faults_are_found_and_made_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(readers.READERS, "bad", Reader(mutations.text, _bad_check))
    found = readers.fuzz("bad", 0, cases=600)
    kinds = {message.split(" ")[0]: report for message, report in found.items()}
    assert set(kinds) == {"KeyError", "results", "RuntimeWarning", ""}
    assert kinds["KeyError"].endswith(r" of 1 bytes: b'\x00'")
    assert kinds["results"].endswith(r" of 1 bytes: b'\r'")


def test_a_hang_ends() -> None:
    def hang() -> None:
        while True:
            pass

    with pytest.raises(TimeoutError, match=r"more than 0\.05 s"), readers.limited(0.05):
        hang()
