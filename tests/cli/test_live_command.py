"""`placerec decode --live` as it is typed: with a network camera, Ctrl-C, and readers that stop or stand still."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from itertools import chain, islice, repeat
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.network_camera import jpegs, network_camera
from helpers.typed_commands import done, fails, make_words, misused

fcntl = pytest.importorskip("fcntl", reason="processes are interrupted in other ways where there is no such module")

SUMMARY = (
    r"frames seen (\d+), answered (\d+) \([\d.]+ a second\), dropped (\d+); ms from arrival to answer: median [\d.]+"
)
# However this process was started, that one is to hear of Ctrl-C.
PLACEREC = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from placerec.cli import main; main()"
)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("live")
    make_words(root)
    return root


@pytest.fixture(scope="module")
def pictures(world: Path) -> list[bytes]:
    return jpegs(world / "runs/seq2/std_cam")


def start(world: Path, address: str, *args: str, stdout: int = subprocess.PIPE) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", PLACEREC, "decode", f"camera:{address}", "--live"]
    command += ["-w", str(world / "words.npz"), "-m", str(world / "seen-model"), *args]
    return subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, text=True)


def counts(stderr: str) -> tuple[int, int, int]:
    """Frames seen, answered and dropped."""
    found = re.search(SUMMARY, stderr)
    assert found, stderr
    seen, answered, dropped = map(int, found.groups())
    return seen, answered, dropped


def test_a_camera_until_it_ends(world: Path, pictures: list[bytes]) -> None:
    with network_camera(pictures, wait=0.05) as address:
        run = done("decode", f"camera:{address}", "--live", "-w", world / "words.npz", "-m", world / "seen-model")
    header, *lines = run.stdout.splitlines()
    assert header == "frame\ttime\tplace\tword\tselected\tbest\thall\tkitchen"
    seen, answered, dropped = counts(run.stderr)
    assert (seen, answered + dropped) == (len(pictures), len(pictures))
    assert len(lines) == answered
    numbers = [int(line.split("\t")[0]) for line in lines]
    assert numbers == sorted(set(numbers))
    assert f"camera:{address}: gives no more images" in run.stderr


@pytest.mark.parametrize(
    "args", [(), ("--json",), ("--method", "mtd", "--unknown", "--per", "second", "--max-gap", "9")]
)
def test_an_interrupt_ends_it_well(args: tuple[str, ...], world: Path, pictures: list[bytes]) -> None:
    with network_camera(chain.from_iterable(repeat(pictures)), wait=0.02) as address:
        run = start(world, address, *args)
        assert run.stdout
        early = list(islice(run.stdout, 5))
        run.send_signal(signal.SIGINT)
        late, stderr = run.communicate(timeout=60)
    assert run.returncode == 0, stderr
    text = "".join(early) + late
    assert text.endswith("\n")
    rows = text.splitlines()
    if "--json" in args:
        answers = [json.loads(row) for row in rows]
        assert all(sum(answer["belief"].values()) == pytest.approx(1) for answer in answers)
    else:
        assert len({len(row.split("\t")) for row in rows}) == 1
        assert rows.pop(0).endswith("unknown") == ("--unknown" in args)
    assert counts(stderr)[1] == len(rows) >= 4
    assert "Traceback" not in stderr


def test_a_reader_that_has_enough_ends_it_well(world: Path, pictures: list[bytes]) -> None:
    with network_camera(chain.from_iterable(repeat(pictures)), wait=0.02) as address:
        run = start(world, address)
        assert run.stdout
        assert run.stderr
        with run.stdout, run.stderr:
            assert run.stdout.readline().startswith("frame\t")
            run.stdout.close()
            stderr = run.stderr.read()
        assert run.wait(60) == 0, stderr
    assert re.fullmatch(rf"(warning: .*dropped so far.*\n)*camera:{address}: frames seen .*\n", stderr)


@pytest.mark.skipif(not hasattr(fcntl, "F_SETPIPE_SZ"), reason="needs a pipe that is soon full")
def test_behind_a_reader_that_stands_still_the_newest_waits(world: Path, pictures: list[bytes]) -> None:
    over = threading.Event()
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    with network_camera(islice(chain.from_iterable(repeat(pictures)), 300), wait=0.005, over=over) as address:
        run = start(world, address, "--json", stdout=writing)
        os.close(writing)
        assert over.wait(60)
        assert run.stderr
        with open(reading, encoding="utf-8") as lines, run.stderr:
            answers = [json.loads(line) for line in lines]
            stderr = run.stderr.read()
        assert run.wait(60) == 0
    seen, answered, dropped = counts(stderr)
    assert answered == len(answers)
    assert answered + dropped == seen == 300
    assert dropped > 100
    assert answers[-1]["frame"] == "000299"
    assert "frames dropped so far: they come faster than they are worked on" in stderr


def test_what_a_camera_saw_until_the_interrupt_is_written_whole(
    world: Path, pictures: list[bytes], tmp_path: Path
) -> None:
    command = [sys.executable, "-c", PLACEREC, "tokenize"]
    with network_camera(chain.from_iterable(repeat(pictures)), wait=0.02) as address:
        options = ["-w", str(world / "words.npz"), "-o", str(tmp_path / "tokens")]
        run = subprocess.Popen([*command, f"camera:{address}", *options], stderr=subprocess.PIPE, text=True)
        assert run.stderr
        with run.stderr:
            assert run.stderr.readline() == f"camera:{address}: recording until Ctrl-C\n"
            with pytest.raises(subprocess.TimeoutExpired):
                run.wait(2)
            run.send_signal(signal.SIGINT)
            stderr = run.stderr.read()
        assert run.wait(60) == 0, stderr
    came, dropped = map(int, re.findall(r"(\d+) images came, (\d+) of them dropped", stderr)[0])
    (stream,) = (tmp_path / "tokens").glob("*.tsv")
    assert stream.stem == address.removeprefix("http://").replace(":", "-").replace("/", "-")
    assert len(stream.read_text().splitlines()) == 1 + came - dropped
    assert came > 0


def write_video(path: Path, pictures: list[bytes], rate: float) -> Path:
    decoded = [cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR) for picture in pictures]
    images = [image for image in decoded if image is not None]
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, (width, height))
    for image in images:
        writer.write(image)
    writer.release()
    return path


def test_a_video_is_played_at_its_own_pace(world: Path, pictures: list[bytes], tmp_path: Path) -> None:
    run = "-w", world / "words.npz", "-m", world / "seen-model"
    slow, fast = (
        write_video(tmp_path / "slow.mp4", pictures, 6),
        write_video(tmp_path / "fast.mp4", 25 * pictures, 2000),
    )
    begin = time.monotonic()
    live = done("decode", slow, "--live", *run)
    assert time.monotonic() - begin > 11 / 6
    files = done("decode", slow, *run).stdout.splitlines()
    seen, answered, dropped = counts(live.stderr)
    assert (seen, answered + dropped) == (12, 12)
    # On a machine that stands still for a sixth of a second a frame is dropped.
    if not dropped:
        assert live.stdout.splitlines() == files
    seen, answered, dropped = counts(done("decode", fast, "--live", *run).stderr)
    assert seen == answered + dropped == 300
    assert dropped > 0
    every = done("decode", fast, "--live", "--every", 100, "--json", *run)
    assert counts(every.stderr)[0] == 3
    assert {json.loads(line)["frame"] for line in every.stdout.splitlines()} <= {"000000", "000100", "000200"}


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ((), "--live takes one camera or video, and needs -w to see it"),
        (("camera:1", "-w", "w.npz"), "--live takes one camera or video, and needs -w to see it"),
        (("-", "-w", "w.npz"), "--live takes one camera or video, and needs -w to see it"),
        (("-w", "w.npz", "-o", "b"), "--live answers on stdout and writes no files: it takes neither -o nor --explain"),
        (
            ("-w", "w.npz", "--explain"),
            "--live answers on stdout and writes no files: it takes neither -o nor --explain",
        ),
        (("-w", "w.npz", "--smooth"), "--live answers each frame before later words are known: it takes none of"),
        (("-w", "w.npz", "--lag", "1"), "--live answers each frame before later words are known: it takes none of"),
        (("-w", "w.npz", "--viterbi"), "--live answers each frame before later words are known: it takes none of"),
        (("-w", "w.npz", "--method", "majority", "--unknown"), "majority has no use for unknown; leave it out"),
    ],
)
def test_what_makes_no_sense_live(args: tuple[str, ...], message: str) -> None:
    misused(message, "decode", "camera:0", "--live", "-m", "model", *args)


def test_sources_that_are_not_there(world: Path) -> None:
    with network_camera([]) as address:
        pass
    run = "--live", "-w", world / "words.npz", "-m", world / "seen-model"
    fails(f"camera:{address}: cannot be opened as a camera; check the address", "decode", f"camera:{address}", *run)
    fails("no such", "decode", world / "nothing.mp4", *run)
    fails("is a token stream, and live decoding is of images", "decode", world / "seen/seq1.tsv", *run)
