"""What needs a process of its own: pipes, closed streams, signals, locales."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from helpers.small_world import write_images, write_tokens

from placerec.cli import Commands, commands
from placerec.model import train_lm

COMMAND = [sys.executable, "-m", "placerec"]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    write_tokens(root / "tokens")
    train_lm([root / "tokens"], root / "model", as_in_paper=True)
    return root


def run(*args: object, stdin: bytes = b"", **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [*COMMAND, *map(str, args)]
    return subprocess.run(command, input=stdin, capture_output=True, env=os.environ | environment, timeout=60)


def test_each_answer_is_flushed(world: Path) -> None:
    # With this set, Python would flush by itself.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(
        [*COMMAND, "decode", "-", "-m", str(world / "model")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        # An answer that is not flushed never comes: the test is to fail then, and not to wait.
        alarm = threading.Timer(20, process.kill)
        alarm.start()
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline().startswith("frame\ttime\t"), "the header comes before any word"
        for i in range(3):
            process.stdin.write("w01\n")
            process.stdin.flush()
            assert process.stdout.readline().startswith(f"{i}\t\t\tw01\t1\t")
        process.stdin.close()
        assert process.wait(20) == 0
        alarm.cancel()


def test_a_reader_that_has_enough_is_no_error(world: Path) -> None:
    with subprocess.Popen(
        [*COMMAND, "decode", "-", "-m", str(world / "model")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        process.stdin.write(b"w01\n" * 10)
        process.stdin.close()
        assert process.stderr.read() == b""
        assert process.wait(20) == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_told(world: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, "decode", "-q", str(world / "tokens/run1.tsv"), "-m", str(world / "model")],
            stdout=full,
            stderr=subprocess.PIPE,
        )
    assert done.returncode == 1
    assert done.stderr == b"placerec: standard output: No space left on device\n"


@pytest.mark.parametrize("command", ["decode", "evaluate"])
def test_a_closed_stdin_is_told(world: Path, command: str) -> None:
    code = "import sys; sys.stdin = None; from placerec.cli import main; main()"
    model = ["-m", str(world / "model")] if command == "decode" else []
    done = subprocess.run([sys.executable, "-c", code, command, "-", *model], capture_output=True, text=True)
    assert done.returncode == 2
    assert "`-` reads standard input, and that is closed" in done.stderr


def test_bytes_that_are_no_utf8_are_an_unknown_word(world: Path) -> None:
    for strict in ({}, {"PYTHONIOENCODING": "utf-8:strict"}):
        done = run("decode", "-", "-m", world / "model", stdin=b"w01\nw\xff\nw02\n", **strict)
        assert done.returncode == 0
        assert [line.split("\t")[4] for line in done.stdout.decode().splitlines()[1:]] == ["1", "0", "1"]
        assert "<stdin>:2: the word 'w\ufffd' is not in the models' vocabulary" in done.stderr.decode()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-16"])
def test_output_is_utf8_whatever_the_locale(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "run.tsv").write_text("place\tword\nKüche\ta\nBüro\tb\n", encoding="utf-8")
    (tmp_path / "vocab.txt").write_text("a\nb\n")
    train_lm([tmp_path / "run.tsv"], tmp_path / "mödel", as_in_paper=True)
    done = run("decode", tmp_path / "run.tsv", "-m", tmp_path / "mödel", PYTHONIOENCODING=encoding, LC_ALL="C")
    assert done.returncode == 0, done.stderr
    assert done.stdout.decode().splitlines()[0].endswith("\tBüro\tKüche")
    failed = run("decode", tmp_path / "nö.tsv", "-m", tmp_path / "mödel", PYTHONIOENCODING=encoding, LC_ALL="C")
    assert "nö.tsv: no such file or folder" in failed.stderr.decode()


@pytest.mark.skipif(sys.platform == "win32", reason="other signals there")
def test_an_interrupt_is_one_line_and_leaves_no_half_file(tmp_path: Path) -> None:
    write_images(tmp_path / "seq", frames=200)
    # Slow enough to be met at work, and it says when it is there.
    code = (
        "import signal, sys, time, placerec.vision.work\n"
        "d = sys.modules['placerec.vision.work']\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "real = d.describe_frame\n"
        # One write: two threads are at work.
        "def slow(*args):\n    sys.stdout.write('ready\\n')\n    sys.stdout.flush()\n"
        "    time.sleep(0.02)\n    return real(*args)\n"
        "d.describe_frame = slow\n"
        "from placerec.cli import main; main()\n"
    )
    out = tmp_path / "out" / "words.npz"
    with subprocess.Popen(
        [sys.executable, "-c", code, "train-words", str(tmp_path / "seq"), "-o", str(out), "--no-cache"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        _, talk = process.communicate(timeout=20)
    assert process.returncode == 1
    assert talk == "placerec: interrupted\n"
    # What goes on from there.
    assert [path.name for path in out.parent.iterdir()] == [".words.npz.partial-journal"]


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device", "a.tsv"), "placerec: a.tsv: No space left on device"),
        (MemoryError("37 GiB"), "placerec: not enough memory (37 GiB); give less at a time"),
        (UnicodeEncodeError("ascii", "aü", 1, 2, "no"), "placerec: 'ü' cannot be written as ascii; set PYTHONUTF8=1"),
    ],
)
def test_what_the_system_refuses_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception, line: str
) -> None:
    def refuse(*args: object, **options: object) -> None:
        raise error

    monkeypatch.setattr("click.Group.invoke", refuse)
    assert isinstance(commands, Commands)
    with pytest.raises(SystemExit) as ended:
        commands.main(["check", "x"])
    assert ended.value.code == 1
    assert capsys.readouterr().err.startswith(line)


def test_a_line_end_in_a_name_does_not_break_the_line(tmp_path: Path) -> None:
    done = run("inspect", tmp_path / "a\nb.arpa")
    assert done.stderr.decode() == f"placerec: {tmp_path}/a\\nb.arpa: no such file\n"
