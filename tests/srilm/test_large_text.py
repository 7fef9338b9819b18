"""Texts that are larger than memory: the same bytes, bounded memory, and nothing left behind."""

import gzip
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.errors import OutputError
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram_count import ngram_count


@contextmanager
def little_memory() -> Iterator[None]:
    """A text is read some words at a time, and hardly any of them are held in memory."""
    with (
        patch("placerec.srilm.text.sentences._BLOCK", 16),
        patch("placerec.srilm.text.sentences._BATCH", 4),
        patch("placerec.srilm.text.numbering._MANY", 2),
        patch("placerec.lm.stored_text.BLOCK", 8),
        patch("placerec.lm.stored_text.IN_MEMORY", 8),
        patch("placerec.lm.stored_text.WAITING", 4),
    ):
        yield


def run(arguments: Sequence[str], text: bytes) -> tuple[int, bytes, bytes]:
    out, err = BytesIO(), BytesIO()
    status = ngram_count(["-text", "-", *arguments], Streams(BytesIO(text), out, err))
    return status, out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vocabulary."""
    path = tmp_path_factory.mktemp("closed") / "words"
    path.write_text("a\nc1\n1\n")
    return path


OPTIONS = [
    (),
    ("-order", "1"),
    ("-order", "20"),
    ("-vocab", "words"),
    ("-unk", "-tolower"),
    ("-no-sos",),
    ("-no-eos", "-order", "2"),
    ("-text-has-weights",),
    ("-text-has-weights-last", "-float-counts"),
    ("-float-counts", "-no-sos"),
    ("-map-unk", "b", "-vocab", "words"),
]
WRITTEN = [("-sort",), (), ("-lm", "-", "-wbdiscount", "-interpolate", "-gt3min", "1", "-debug", "1")]
WORDS = ["a", "b", "B", "c1", "1", "2.5", "<s>", "</s>", "<unk>", "x\v", "##", "a\0", "a word of forty bytes!".title()]
LINES = st.lists(st.lists(st.sampled_from(WORDS), max_size=6).map(" ".join), max_size=14)


@pytest.mark.parametrize("options", OPTIONS)
@settings(max_examples=20)
@given(lines=LINES, written=st.sampled_from(WRITTEN), end=st.sampled_from(["", "\n"]))
def test_little_memory_gives_the_same_bytes(
    options: Sequence[str], lines: list[str], written: Sequence[str], end: str, closed: Path
) -> None:
    text = ("\n".join(lines) + end).encode("latin-1")
    arguments = [str(closed) if argument == "words" else argument for argument in (*options, *written)]
    expected = run(arguments, text)
    with little_memory():
        assert run(arguments, text) == expected


def test_packed_text_and_standard_input_are_read_in_blocks_too(tmp_path: Path) -> None:
    text = b"".join(b"a b%d c\n" % (i % 7) for i in range(200))
    (tmp_path / "x.gz").write_bytes(gzip.compress(text))
    expected = run(["-sort"], text)
    with little_memory():
        assert run(["-sort"], text) == expected
        assert run(["-sort", "-text", str(tmp_path / "x.gz")], b"") == expected
    (tmp_path / "x.gz").write_bytes(gzip.compress(text)[:-9])
    with little_memory():
        status, out, err = run(["-text", str(tmp_path / "x.gz")], b"")
    assert (status, out) == (1, b"")
    assert err.startswith(f"{tmp_path}/x.gz: ".encode())


def test_messages_come_in_the_order_of_lines() -> None:
    text = b"x a\n" + b"1 " + b"a " * 50001 + b"\ny a\n"
    _, _, err = run(["-text-has-weights"], text)
    assert re.findall(r"line (\d)", err.decode()) == ["1", "2", "3"]


@pytest.mark.parametrize("comment", [b"", b"##\n"])
def test_the_words_of_lines_that_are_too_long_are_not_listed(comment: bytes, tmp_path: Path) -> None:
    text = comment + b"a\n" + b"b " * 50001 + b"\n" + b"c " * 50000 + b"\n"
    words = tmp_path / "words"
    status, _, err = run(["-order", "1", "-write-vocab-index", str(words)], text)
    assert (status, err) == (0, b"-: line %d: line too long?\n" % (3 if comment else 2))
    assert words.read_text() == "0 <unk>\n1 <s>\n2 </s>\n3 -pau-\n4 a\n5 c\n.\n"


def test_the_largest_weights_are_whole_numbers() -> None:
    arguments = ["-text-has-weights", "-no-sos", "-no-eos", "-order", "1", "-sort"]
    _, out, _ = run(arguments, b"9223372036854775806 a\n1 a\n9007199254740993 b\n")
    assert b"a\t9223372036854775807\n" in out
    assert b"b\t9007199254740993\n" in out


def test_sums_beyond_the_largest_number_end_in_a_message() -> None:
    status, out, err = run(["-text-has-weights", "-order", "1"], b"9223372036854775807 a\n1 a\n")
    assert (status, out) == (1, b"")
    assert b"a sum of counts is above 9223372036854775807, the most that can be counted" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_an_error_of_one_line() -> None:
    full = open("/dev/full", "r+b", buffering=0)  # noqa: SIM115
    with little_memory(), patch("tempfile.TemporaryFile", lambda **_: full), pytest.raises(OutputError) as caught:
        run([], b"a b c d e f g h\n" * 9)
    assert re.search(r"kept there: No space left on device; set TMPDIR to a folder with room$", str(caught.value))


# Counts a text as bin/ngram-count does, with much less memory for it, and prints the most memory that was used.
CHILD = """
import re, sys
from placerec.lm import stored_text
from placerec.srilm.tools.run import run
stored_text.IN_MEMORY, stored_text.WAITING = 1 << 19, 1 << 16
status = run("ngram-count", sys.argv[1:])
print(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1])
sys.exit(status)
"""


def count_in_child(text: Path, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", CHILD, "-text", str(text), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """4 MB of words, and the same eight times over."""
    folder = tmp_path_factory.mktemp("large")
    words = np.array([f"w{i:03d}" for i in range(200)])
    drawn = np.random.default_rng(0).geometric(0.1, 800_000) % 200
    text = "".join(" ".join(line) + "\n" for line in words[drawn].reshape(-1, 20))
    (folder / "once").write_text(text)
    (folder / "eight").write_text(text * 8)
    return folder


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak of memory from /proc")
def test_memory_depends_on_the_ngrams_and_not_on_the_length_of_the_text(large: Path, tmp_path: Path) -> None:
    options = ["-order", "2", "-wbdiscount", "-lm", str(tmp_path / "lm")]
    # A peak moves by some 7 MB, as threads happen to meet: three turns, of which the nearest are compared.
    turns = {
        name: [count_in_child(large / name, *options, TMPDIR=str(tmp_path)) for _ in range(3)]
        for name in ("once", "eight")
    }
    assert {turn.returncode for done in turns.values() for turn in done} == {0}, turns["eight"][0].stderr
    once, eight = ([int(turn.stdout) for turn in turns[name]] for name in ("once", "eight"))
    assert min(eight) < 1.15 * max(once)
    assert [path.name for path in tmp_path.iterdir()] == ["lm"]


def test_a_folder_for_temporary_files_that_cannot_be_used(large: Path, tmp_path: Path) -> None:
    missing = str(tmp_path / "none")
    done = count_in_child(large / "once", "-lm", str(tmp_path / "lm"), TMPDIR=missing)
    assert done.returncode == 1
    assert done.stderr == (
        f"ngram-count: {missing}: a text too large for memory cannot be kept there: No such file or directory; "
        "set TMPDIR to a folder with room\n"
    )
    assert list(tmp_path.iterdir()) == []
