"""An update that is killed, at whatever moment: the old model is there or the new one, and the next run mends the rest.

As a program, this file is what is killed: it forks once for each moment, so that one start of Python serves them all.
"""

import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from placerec import files
from placerec.files import restore_folder
from placerec.model import train_lm, update
from placerec.words import WordStream, write_stream, write_vocabulary

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs fork and kill")
MOMENTS = 10


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("exchange", ["swap", "moves"])
def test_the_old_model_or_the_new_one(exchange: str) -> None:
    # Thousands of small files: in memory where there is such a folder.
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as root:
        done = subprocess.run(
            [sys.executable, "-W", "ignore::DeprecationWarning", __file__, root, exchange],
            capture_output=True,
            text=True,
        )
    assert (done.returncode, done.stderr) == (0, "")
    found = {name: int(count) for name, count in (item.split("=") for item in done.stdout.split())}
    # A test that kills too late, or always too early, proves nothing.
    assert min(found["old"], found["steps"]) > 20
    assert found["new"] > 0
    assert (found["absent"] > 0) == (exchange == "moves")


def main(root: Path, exchange: str) -> None:
    write_vocabulary(["a", "b"], root / "vocab.txt")
    write_stream(WordStream.of("first", [*"aabba"], ["hall", "hall", "hall", "kitchen", "kitchen"]), root / "first.tsv")
    write_stream(WordStream.of("today", [*"bba"], ["hall"] * 3), root / "today.tsv")
    train_lm([root / "first.tsv"], root / "old", as_in_paper=True)
    train_lm([root / "first.tsv", root / "today.tsv"], root / "new", as_in_paper=True)
    if exchange == "moves":
        files._swap = lambda first, second: False
    found = {"old": 0, "new": 0, "absent": 0, "steps": 0}
    # Every step that Python reports, until the update ends before its step comes; then moments by the clock.
    killed = True
    while killed:
        shutil.copytree(root / "old", root / "model")
        killed = forked(partial(at_step, found["steps"], root), None)
        found["steps"] += 1
        found[settle(root)] += 1
    generator = random.Random(0)
    for _ in range(MOMENTS):
        shutil.copytree(root / "old", root / "model")
        forked(partial(update, root / "model", [root / "today.tsv"]), generator.uniform(0, 0.03))
        found[settle(root)] += 1
    sys.stdout.write(" ".join(f"{name}={count}" for name, count in found.items()))


def at_step(step: int, root: Path) -> None:
    """Update, and be killed at the `step`-th call that reaches the system."""
    left = step

    def hook(event: str, _: object) -> None:
        nonlocal left
        if event.split(".")[0] in ("open", "os", "shutil", "tempfile", "fcntl", "ctypes"):
            left -= 1
            if left == -1:
                os.kill(os.getpid(), 9)

    sys.addaudithook(hook)
    update(root / "model", [root / "today.tsv"])


def forked(work: Callable[[], None], seconds: float | None) -> bool:
    """Do `work` in a child, killed after `seconds` if given: whether it was killed."""
    child = os.fork()
    if child == 0:
        work()
        os._exit(0)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(child, 9)
    status = os.waitpid(child, 0)[1]
    if not os.WIFSIGNALED(status) and os.WEXITSTATUS(status):
        raise RuntimeError("the update failed by itself")
    return os.WIFSIGNALED(status)


def settle(root: Path) -> str:
    """What a killed update has left; run again, it is new and nothing else is there; then it is removed."""
    model, old, new = root / "model", contents(root / "old"), contents(root / "new")
    found = contents(model)
    state = "absent" if not model.exists() else "old" if found == old else "new" if found == new else "half"
    if state == "half":
        raise RuntimeError(f"half an update: {sorted(found)}")
    if state == "new":
        restore_folder(model)
    else:
        update(model, [root / "today.tsv"])
    if contents(model) != new or len(list(root.iterdir())) != 6:
        raise RuntimeError(f"left behind: {sorted(path.name for path in root.iterdir())}")
    shutil.rmtree(model)
    return state


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
