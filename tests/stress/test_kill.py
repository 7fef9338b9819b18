"""The short version of `kill.py`."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and /proc")


@pytest.mark.parametrize("command", ["tokenize", "train-words", "train-lm", "update", "experiment"])
def test_a_killed_command_ends_in_the_same_bytes(command: str) -> None:
    program = Path(__file__).with_name("kill.py")
    args = [sys.executable, str(program), "--small", "--kills", "2", "--jobs", "1", command]
    done = subprocess.run(args, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    kills, _, _, _, same, left = map(int, done.stdout.splitlines()[-1].split()[2:])
    assert (kills, same, left) == (2, 2, 0)
