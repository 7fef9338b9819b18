"""Work that takes its time: processes that are stopped, and what goes on when the command is typed again."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.small_world import write_images
from helpers.typed_commands import done

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="other signals there")
JOURNAL = ".tokens.partial-journal"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Enough frames for several processes, a dictionary, and their tokens."""
    root = tmp_path_factory.mktemp("world")
    write_images(root / "few", frames=12)
    write_images(root / "run", frames=704)
    done("train-words", root / "few", "-o", root / "words.npz", "--size", 3, "--image-size", 32, "-q")
    done("tokenize", root / "run", "-w", root / "words.npz", "-o", root / "tokens", "-q", "--jobs", 1)
    return root


def tokenizing(world: Path, out: Path) -> "subprocess.Popen[str]":
    """A run with two processes, that has results in its journal."""
    # A shell may have it ignore interrupts.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += "if __name__ == '__main__':\n    from placerec.cli import main; main()"
    args = ["tokenize", world / "run", "-w", world / "words.npz", "-o", out / "tokens", "--jobs", "2", "--no-cache"]
    command = [sys.executable, "-c", code, *map(str, args)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    journal, until = out / JOURNAL, time.monotonic() + 60
    size = journal.stat().st_size if journal.exists() else 0
    while not journal.exists() or journal.stat().st_size == size:
        assert time.monotonic() < until, "no result comes"
        assert process.poll() is None, "it was over too soon"
        time.sleep(0.005)
    return process


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_to_be_terminated_is_to_be_interrupted(world: Path, tmp_path: Path) -> None:
    with tokenizing(world, tmp_path) as process:
        process.terminate()
        assert process.stderr is not None
        assert process.stderr.read() == "placerec: interrupted\n"
    assert process.returncode == 1
    assert os.listdir(tmp_path) == [JOURNAL]


def test_whoever_is_stopped_goes_on_from_there(world: Path, tmp_path: Path) -> None:
    with tokenizing(world, tmp_path) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        workers = [int(pid) for pid in children if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]
        os.kill(workers[0], signal.SIGKILL)
        assert process.stderr is not None
        talk = process.stderr.read()
    assert process.returncode == 1
    assert talk == "placerec: a process of the work was killed; give it more memory, or fewer jobs\n"
    assert os.listdir(tmp_path) == [JOURNAL]
    first = (tmp_path / JOURNAL).read_bytes()

    with tokenizing(world, tmp_path) as process:
        # As the terminal does: to all processes.
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr is not None
        talk = process.stderr.read()
    assert process.returncode == 1
    assert talk == "placerec: interrupted\n"
    assert os.listdir(tmp_path) == [JOURNAL]
    second = (tmp_path / JOURNAL).read_bytes()
    assert second.startswith(first)
    assert len(second) > len(first)

    done(
        "tokenize", world / "run", "-w", world / "words.npz", "-o", tmp_path / "tokens", "-q", "--jobs", 1, "--no-cache"
    )
    assert os.listdir(tmp_path) == ["tokens"]
    assert contents(tmp_path / "tokens") == contents(world / "tokens")
