"""Peak memory of the commands on n frames and on ten times as many.

    python tests/benchmarks/memory.py [--frames 20000] [--times 10] [--jobs 2] [COMMAND...]

The frames are links to a few small pictures. The peak is that of the largest process of a command (ru_maxrss).
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
import numpy as np
from helpers.small_world import VOCABULARY, run_through

from placerec.words import write_stream, write_vocabulary

ROW = "{:<12}" + "{:>12}" * 5
# File systems allow some ten thousand names for one file.
LINKS = 30_000
SMALL = ("--image-size", "16", "--jobs")
COMMANDS = {
    "describe": ("describe", "images", "-o", "d.npz", "--no-cache", *SMALL),
    "train-words": (
        (
            "train-words",
            "images",
            "-o",
            "w.npz",
            "--no-cache",
            "--size",
            "3",
            "--components",
            "8",
            "--epochs",
            "4",
            *SMALL,
        )
    ),
    "tokenize": ("tokenize", "images", "-w", "w.npz", "-o", "tokens", "--no-cache", "--jobs"),
    "train-lm": ("train-lm", "streams", "-o", "model", "--order", "3"),
}


def main() -> None:
    """Print a line for each command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", metavar="COMMAND")
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--jobs", default="2")
    given = parser.parse_args()
    say(ROW.format("command", "frames", "seconds", "peak MB", "ratio", "bytes/frame"))
    with tempfile.TemporaryDirectory() as folder:
        worlds = {frames: Path(folder) / str(frames) for frames in (given.frames, given.frames * given.times)}
        for frames, world in worlds.items():
            make_world(world, frames)
        for name in given.commands or COMMANDS:
            before = None
            for frames, world in worlds.items():
                seconds, peak = measured(name, world, given.jobs)
                ratio = more = "-"
                if before is not None:
                    ratio = f"{peak / before[1]:.3f}"
                    more = f"{(peak - before[1]) / (frames - before[0]):.0f}"
                say(ROW.format(name, frames, f"{seconds:.1f}", f"{peak / 1e6:.1f}", ratio, more))
                before = frames, peak


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def make_world(world: Path, frames: int) -> None:
    """A folder of `frames` pictures, and token streams of ten times as many frames."""
    (world / "images").mkdir(parents=True)
    rng = np.random.default_rng(0)
    originals: list[Path] = []
    for number in range(frames):
        path = world / "images" / f"t{number / 10 + 1e9:.6f}_x0.0_y0.0_a0.0.png"
        if number % LINKS < 16:
            originals = originals if number % LINKS else []
            originals.append(path)
            y, x = np.mgrid[:24, :32]
            wave = np.sin((x * rng.random() + y * rng.random()) * 0.9)
            assert cv2.imwrite(
                str(path), (127 + 90 * wave + rng.normal(0, 8, wave.shape)).clip(0, 255).astype(np.uint8)
            )
        else:
            os.link(originals[number % 16], path)
    for number in range(max(1, frames // 100)):
        write_stream(run_through(f"run{number}", number, 1000), world / "streams" / f"run{number}.tsv")
    write_vocabulary(VOCABULARY, world / "streams" / "vocab.txt")


def measured(name: str, world: Path, jobs: str) -> tuple[float, int]:
    """Seconds and the largest process in bytes."""
    args = [*COMMANDS[name], *([jobs] if COMMANDS[name][-1] == "--jobs" else [])]
    began = time.monotonic()
    child = os.posix_spawn(sys.executable, [sys.executable, "-c", _IN.format(str(world)), *args, "-q"], os.environ)
    _, status, usage = os.wait4(child, 0)
    assert status == 0, f"{name}: {status}"
    return time.monotonic() - began, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


_IN = "if __name__ == '__main__': import os; os.chdir({0!r}); from placerec.cli import main; main()"

if __name__ == "__main__":
    main()
